"""The largest error of every model at extreme arguments:  python benchmarks/numerical_stress.py

It runs the checks of `tests/reference/stress.py`.  For every quantity of every model, it prints the
largest error relative to exact or 60-digit arithmetic, and the arguments at which this error
occurs.  The table is written to benchmarks/results/numerical_stress.md.
"""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "tests"))
from reference import stress  # noqa: E402 (its folder has to be on the path first)

HEADER = """# Numerical stress

Every model at its corners: d̂ at breakpoints and one unit in the last place beside them, p within
1e-16 of 0 and of 1, N up to 10^12, b from 1e-9 to 1e9 m, cameras 1 mm above the canopy.  Errors are
against exact fractions, or 60 digits of mpmath, of the very floats that the models get; an ulp is
the unit in the last place of the exact value, 1.1e-16 to 2.2e-16 of it.

Written by `python benchmarks/numerical_stress.py`; `tests/test_stress.py` holds the bounds.

| model | quantity | corners | worst error [ulp] | relative | where |
|---|---|---:|---:|---:|---|
"""


def main() -> None:
    rows = [
        f"| {model} | {quantity} | {found.cases} | {found.ulps:.2f} | {found.relative:.1e} "
        f"| {found.corner} |"
        for (model, quantity), found in stress.worst(stress.every_check()).items()
    ]
    text = HEADER + "\n".join(rows) + "\n"
    print(text, end="")
    path = HERE / "results" / "numerical_stress.md"
    path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
