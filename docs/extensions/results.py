"""Generates tables of the results of benchmarks as Markdown, from their files."""

import csv
from pathlib import Path

from .presets import table

RESULTS = Path(__file__).parents[2] / "benchmarks" / "results"


def results(name):
    """A table of results.  Numbers have three digits."""
    with (RESULTS / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    return table(
        [_words(each) for each in header], [[_short(cell) for cell in row] for row in rows]
    )


def stress():
    """The table of largest errors, without the text above it."""
    lines = (RESULTS / "numerical_stress.md").read_text("utf-8").splitlines()
    return "\n".join(line for line in lines if line.startswith("|"))


def _words(name):
    return name.replace("_", " ").strip()


def _short(cell):
    try:
        value = float(cell)
    except ValueError:
        return cell
    return cell if value.is_integer() and abs(value) < 1e7 else f"{value:.3g}"
