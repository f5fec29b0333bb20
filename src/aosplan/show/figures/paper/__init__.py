"""Make every figure of the paper that shows data:  python examples/paper/run.py

Figures and their numbers are written to examples/paper/results.  Differences from the paper are
printed with their reasons.  It needs the extras `figures` and `pictures`.  Names such as 7 or 2b
select figures.
"""

import sys
import time
from importlib import import_module
from pathlib import Path

FIGURES = ("2b", "3", "4", "5", "6", "7", "8", "9", "10")


def main(names):
    sys.path.insert(0, str(Path(__file__).parent))
    unknown = [name for name in names if name not in FIGURES]
    if unknown:
        sys.exit(f"no figure {unknown[0]}: one of {', '.join(FIGURES)}")
    for name in names or FIGURES:
        print(f"Figure {name}", flush=True)
        start = time.perf_counter()
        import_module(f"figure_{name}").main()
        print(f"  {time.perf_counter() - start:.1f} s", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
