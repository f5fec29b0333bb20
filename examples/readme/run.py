"""Make the two pictures of the README:  python examples/readme/run.py

`beneath.png` shows one photo beside the integral of a plan's photos; `agreement.png` compares the
models with simulations.  All random numbers are from fixed seeds.  The script needs the extras
`figures` and `pictures`.
"""

import sys
from importlib import import_module
from pathlib import Path


def main():
    sys.path.insert(0, str(Path(__file__).parent))
    for name in ("beneath", "agreement"):
        print(f"{name}.png", flush=True)
        import_module(name).main()


if __name__ == "__main__":
    main()
