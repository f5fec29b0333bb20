"""Run time and error of Eq. 2:  python benchmarks/equation_error.py

The quantities are V and 1 - V̂ of square grids from 4 to 10^12 samples, at d̂ = 0.4 and p = 0.567.
They are computed by

- the paper's double sum as printed, in plain Python;
- the same sum with NumPy arrays;
- averages of shifted noise patterns of several sizes, as in the paper's Figs. 3 and 4;
- aosplan, for single values and for an array.  Each result is compared with exact rational
  arithmetic (tests/reference/exact.py).  It also measures the rate of `aosplan.visibility` for
  arrays of random p, n and d̂.  It takes about a minute, prints a table, and writes it to
  benchmarks/results/ together with a figure.
"""

import csv
import math
import platform
import statistics
import sys
import time
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np

import aosplan

mpl.use("Agg")
from matplotlib import pyplot as plt

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "tests"))
from reference import exact  # noqa: E402 (its folder has to be on the path first)

DENSITY = 0.567
OCCLUDER_PX, DISPARITY_PX = 5, 2
DHAT = DISPARITY_PX / OCCLUDER_PX

SIDES = (2, 3, 5, 7, 10, 30, 100, 300, 1000, 3000, 10**4, 10**5, 10**6)
SLOWEST_S = 2.0
"""If a method takes longer than this, it is not run for larger N."""

LARGEST_ARRAY = 10_000
"""Largest side for which the double sum is computed with one array (0.8 GB)."""

PATTERNS = {2: (100, 300, 1000, 3000), 5: (100, 300, 1000, 3000), 10: (100, 300, 1000, 3000)}
"""Sizes [px] of noise patterns by side of the grid."""

SEEDS = range(6)
TRIPLES = 1_000_000


class Row(NamedTuple):
    """One method at one N: the median time for a value, and the relative errors."""

    method: str
    samples: int
    seconds: float
    error_v: float
    error_shortfall: float
    ulps_v: float


# --- The methods ---------------------------------------------------------------------------


def as_printed(p: float, side: int, d: float) -> float:
    total = 0.0
    for i in range(1, side):
        for j in range(side):
            total += (side - i) * (side - j) * max(0.0, 1 - i * d) * max(0.0, 1 - j * d)
    n = side**2
    return 1 - p**2 - p * (1 - p) / n**2 * (n + 4 * total)


def as_arrays(p: float, side: int, d: float) -> float:
    i = np.arange(1.0, side)[:, None]
    j = np.arange(0.0, side)[None, :]
    terms = ((side - i) * np.maximum(0.0, 1 - i * d)) * ((side - j) * np.maximum(0.0, 1 - j * d))
    n = float(side) ** 2
    return 1 - p**2 - p * (1 - p) / n**2 * (n + 4 * float(terms.sum()))


def averaged_noise(p: float, side: int, size: int, seed: int) -> float:
    rng = np.random.default_rng(seed)
    cells = rng.random((size // OCCLUDER_PX, size // OCCLUDER_PX)) < p
    pattern = np.kron(cells, np.ones((OCCLUDER_PX, OCCLUDER_PX), dtype=np.float32))
    average = np.zeros_like(pattern)
    for i in range(side):
        for j in range(side):
            average += np.roll(pattern, (i * DISPARITY_PX, j * DISPARITY_PX), axis=(0, 1))
    return 1 - float(np.mean((average / side**2).astype(float) ** 2))


# --- Measuring -----------------------------------------------------------------------------


def timed(call) -> float:
    """Median seconds of five calls; short calls are repeated until each timing takes 20 ms."""
    start = time.perf_counter()
    call()
    once = time.perf_counter() - start
    if once > 1.0:
        return once
    repeats = max(1, math.ceil(0.02 / max(once, 1e-9)))
    rounds = []
    for _ in range(5):
        start = time.perf_counter()
        for _ in range(repeats):
            call()
        rounds.append((time.perf_counter() - start) / repeats)
    return statistics.median(rounds)


def relative(value: float, reference: Fraction) -> float:
    return float(abs(Fraction(float(value)) - reference) / reference)


def from_v(v: float) -> float:
    """1 - V̂, computed from V and its limits."""
    p = DENSITY
    return ((1 - p**2) - v) / (p * (1 - p))


def measure() -> list[Row]:
    rows = []

    def add(method: str, side: int, seconds: float, v: float, shortfall: float | None = None):
        k = exact.grid_shortfall(side, side, DHAT)
        reference = exact.visibility(DENSITY, k)
        rows.append(
            Row(
                method,
                side**2,
                seconds,
                relative(v, reference),
                relative(from_v(v) if shortfall is None else shortfall, k),
                exact.ulps(v, reference),
            )
        )

    for method, function, largest in (
        ("double sum, plain Python", as_printed, math.inf),
        ("double sum, NumPy", as_arrays, LARGEST_ARRAY),
    ):
        for side in SIDES:
            if side > largest:
                break
            seconds = timed(lambda f=function, n=side: f(DENSITY, n, DHAT))
            add(method, side, seconds, function(DENSITY, side, DHAT))
            if seconds > SLOWEST_S:
                break

    for side, sizes in PATTERNS.items():
        for size in sizes:
            seconds = timed(lambda n=side, m=size: averaged_noise(DENSITY, n, m, 0))
            runs = [averaged_noise(DENSITY, side, size, seed) for seed in SEEDS]
            add(f"noise pattern of {size} px", side, seconds, runs[0])
            # A single run may be accurate by chance. The root mean square of all runs is therefore
            # used.
            reference = exact.visibility(DENSITY, k := exact.grid_shortfall(side, side, DHAT))
            rows[-1] = rows[-1]._replace(
                error_v=rms([relative(v, reference) for v in runs]),
                error_shortfall=rms([relative(from_v(v), k) for v in runs]),
                ulps_v=rms([exact.ulps(v, reference) for v in runs]),
            )

    for side in SIDES:
        n = side
        seconds = timed(lambda n=n: aosplan.visibility(DENSITY, n, n, DHAT))
        v = aosplan.visibility(DENSITY, n, n, DHAT)
        add("aosplan, one value", side, seconds, v, aosplan.visibility_shortfall(n, n, DHAT))
    count = 100_000
    for side in SIDES:
        n = np.full(count, float(side))
        d = np.full(count, DHAT)
        seconds = timed(lambda n=n, d=d: aosplan.visibility(DENSITY, n, n, d)) / count
        v = aosplan.visibility(DENSITY, n, n, d)[0]
        add("aosplan, array", side, seconds, v, aosplan.visibility_shortfall(n, n, d)[0])
    return rows


def rms(values: list[float]) -> float:
    return math.sqrt(statistics.fmean(value**2 for value in values))


def rates() -> dict[str, list[float]]:
    """Millions of random triples (p, n, d̂) per second, measured five times for each case."""
    rng = np.random.default_rng(0)
    p = rng.random(TRIPLES)
    n = rng.integers(2, 1001, TRIPLES).astype(float)
    other = n.copy()
    d = rng.uniform(0.0, 1.2, TRIPLES)
    found = {}
    for name, call in (
        ("square grids", lambda: aosplan.visibility(p, n, n, d)),
        ("rows x columns", lambda: aosplan.visibility(p, n, other, d)),
    ):
        call()
        found[name] = []
        for _ in range(5):
            start = time.perf_counter()
            call()
            found[name].append(TRIPLES / (time.perf_counter() - start) / 1e6)
    return found


# --- Output --------------------------------------------------------------------------------

STYLES = {
    "double sum, plain Python": ("#b2182b", "s"),
    "double sum, NumPy": ("#ef8a62", "D"),
    "noise patterns (simulation)": ("#7f7f7f", "^"),
    "aosplan, one value": ("#2166ac", "o"),
    "aosplan, array": ("#1a9850", "v"),
}
FLOOR = 1e-17
"""Position at which an error of 0 is drawn in the figure."""

LOWEST = 1e-19
"""Lower end of the figure."""


def kind_of(row: Row) -> str:
    return "noise patterns (simulation)" if row.method.startswith("noise") else row.method


def power(samples: int) -> str:
    exponent = math.floor(math.log10(samples))
    factor = samples // 10**exponent
    return f"$10^{exponent}$" if factor == 1 else f"${factor} \\cdot 10^{exponent}$"


def draw(rows: list[Row], path: Path) -> None:
    plt.rcParams.update({"font.size": 10, "axes.spines.top": False, "axes.spines.right": False})
    figure, axes = plt.subplots(1, 2, figsize=(12.5, 6.6), sharex=True, sharey=True)
    panels = (("error_v", "visibility V"), ("error_shortfall", "shortfall 1 − V̂"))
    for axis, (field, quantity) in zip(axes, panels, strict=True):
        axis.axhspan(LOWEST, 2**-53, color="#e8f1e8", zorder=0)
        axis.text(1e-3, 1.5 * LOWEST, "nearest float: half an ulp", ha="center", color="#4d7f4d")
        for kind, (color, marker) in STYLES.items():
            draw_kind(axis, [row for row in rows if kind_of(row) == kind], field, color, marker)
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.set_xlim(5e-10, 4e2)
        axis.set_ylim(LOWEST, 10.0)
        axis.set_title(f"Error of the {quantity}", loc="left", fontweight="bold")
        axis.set_xlabel("run time of one value [s]")
        axis.grid(visible=True, which="major", color="#e5e5e5", linewidth=0.7)
        axis.set_axisbelow(True)
        axis.tick_params(labelleft=True)
    axes[0].set_ylabel("relative error against exact arithmetic (0 is drawn at $10^{-17}$)")
    handles = [
        plt.Line2D([], [], color=color, marker=marker, linestyle="none", label=kind)
        for kind, (color, marker) in STYLES.items()
    ]
    figure.legend(handles=handles, loc="lower center", ncols=len(handles), frameon=False)
    figure.suptitle(
        "Eq. 2 for N = 4 … $10^{12}$ samples, d̂ = 0.4, p = 0.567: run time against error",
        x=0.01, ha="left", fontsize=13,
    )  # fmt: skip
    figure.tight_layout(rect=(0, 0.04, 1, 1))
    figure.savefig(path, dpi=120)
    plt.close(figure)


def draw_kind(axis, rows: list[Row], field: str, color: str, marker: str) -> None:
    """Draw the points of a method, with labels at the first and the last N."""

    def place(row):
        return row.seconds, max(getattr(row, field), FLOOR)

    def line(chosen, style):
        axis.plot(
            *zip(*map(place, chosen), strict=True), linestyle=style, linewidth=1, color=color,
            marker=marker, markersize=7, markeredgecolor="white", alpha=0.9,
        )  # fmt: skip

    def name(row, text, shift, align="left"):
        axis.annotate(
            text, place(row), xytext=shift, textcoords="offset points", ha=align, color=color,
            fontsize=9,
        )  # fmt: skip

    kind = kind_of(rows[0])
    if kind.startswith("aosplan"):
        line(rows, "none")
        lowest = min(rows, key=lambda row: getattr(row, field))
        name(lowest, "N = 4 … $10^{12}$", (0, -18), "center")
    elif kind.startswith("double"):
        line(rows, "-")
        below = kind.endswith("NumPy") and field == "error_v"
        beside = (8, -3) if kind.endswith("Python") else (0, -18 if below else 10)
        name(rows[-1], f"N = {power(rows[-1].samples)}", beside, "left" if beside[0] else "center")
    else:
        for index, samples in enumerate(sorted({row.samples for row in rows})):
            chosen = [row for row in rows if row.samples == samples]
            line(chosen, "-")
            last = chosen[-1]
            if field == "error_v":  # Otherwise the three labels would overlap.
                name(last, f"N = {samples}", (-2, -18 - 13 * (2 - index)), "center")
            else:
                name(last, f"N = {samples}", (8, -3))


def main() -> None:
    results = HERE / "results"
    results.mkdir(exist_ok=True)
    rows = measure()
    print(
        f"{'method':<26} {'N':>14} {'time [s]':>10} {'error of V':>11} {'[ulp]':>9} {'of 1-V̂':>9}"
    )
    for row in rows:
        print(
            f"{row.method:<26} {row.samples:>14} {row.seconds:>10.2e} {row.error_v:>11.1e} "
            f"{row.ulps_v:>9.2g} {row.error_shortfall:>9.1e}"
        )
    with (results / "equation_error.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(Row._fields)
        writer.writerows(
            (row.method, row.samples, *(f"{value:.4g}" for value in row[2:])) for row in rows
        )
    draw(rows, results / "equation_error.png")
    print()
    found = rates()
    with (results / "equation_rate.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("arrays", "median_millions_per_second", "lowest", "highest"))
        writer.writerows(
            (name, *(f"{value:.1f}" for value in (statistics.median(runs), min(runs), max(runs))))
            for name, runs in found.items()
        )
    for name, runs in found.items():
        print(
            f"aosplan.visibility, {name}: {statistics.median(runs):.1f} million (p, n, d̂) a second "
            f"(median of 5, {min(runs):.1f} to {max(runs):.1f}), one thread, NumPy {np.__version__}, "
            f"Python {platform.python_version()}"
        )
    print(f"written: {results / 'equation_error.csv'}, {results / 'equation_error.png'}")


if __name__ == "__main__":
    main()
