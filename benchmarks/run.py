"""Run every benchmark of the repository.  Tables and figures are written to results/.

Run: python benchmarks/run.py [NAME ...]
"""

from __future__ import annotations

import os
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))


def main() -> None:
    names = sys.argv[1:] or sorted(
        name[:-3] for name in os.listdir(HERE) if name.endswith(".py") and name != "run.py"
    )
    for name in names:
        print(f"== {name}", flush=True)
        subprocess.run([sys.executable, os.path.join(HERE, f"{name}.py")], check=True)


if __name__ == "__main__":
    main()
