"""Write the reference tables to this folder:  cd tests && python -m reference.make_tables

eq1.csv     p and T of Eq. 1, by mpmath with 50 digits, for l/o up to 10^6.
eq2.csv     V, 1 - V, V̂ and 1 - V̂ of Eq. 2.  Square grids up to 40 x 40 are computed by the paper's double sum as printed. Larger squares, and rectangles with sides up to 10^6, are computed by the appendix's sum for both axes, term by term.

Arguments are hexadecimal floats, results are decimals with 30 digits.  The tables are
deterministic, and a test compares them with the output of this file.
"""

import csv
import decimal
import io
import math
import random
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import mpmath

from reference import exact

FOLDER = Path(__file__).parent
DIGITS = 30

HARD_TRANSPARENCIES = (
    # These arguments were found by a search. The rounding errors of l/o, of its product with
    # log(1-D) and of the logarithm itself have the same sign, and T is just below a power of two.
    ("0x1.fffffffffffccp-1", "0x1.0528d702e309bp+3", "0x1.05153797b6b81p-1"),
    ("0x1.1fb92f2a57ce2p-11", "0x1.020fd57de6d87p+16", "0x1.fa033fc143a99p-5"),
    ("0x1.4cf2f932bc21fp-1", "0x1.1a3ef196f1312p+11", "0x1.16addadd09971p+2"),
    ("0x1.da728e965f4a8p-3", "0x1.082c78f9c4382p+6", "0x1.fe5fef6893b46p-6"),
    ("0x1.02ea3538a413ap-3", "0x1.005418d2a66d9p+15", "0x1.ed4e4e6b86c1ap+2"),
    ("0x1.9aee8ade7eb06p-2", "0x1.0a69c4c34664ep+4", "0x1.0839856406cfep-5"),
)
"""Values of D, l and o for which T loses most digits if its exponent is a product of rounded
factors.
"""


def tables() -> dict[str, str]:
    """All tables by file name."""
    return {"eq1.csv": _text(_eq1()), "eq2.csv": _text(_eq2())}


# --- Eq. 1 ---------------------------------------------------------------------------------


def _eq1() -> Iterator[tuple[str, ...]]:
    yield "slice_density", "volume_height", "occluder_size", "density", "transparency"
    with mpmath.workdps(50):
        for slice_density, height, size in _volumes():
            ratio = mpmath.mpf(height) / mpmath.mpf(size)
            log_t = ratio * mpmath.log1p(-mpmath.mpf(slice_density))
            if log_t < -800:
                continue  # T is 0. One row below represents such cases.
            yield (
                *(value.hex() for value in (slice_density, height, size)),
                mpmath.nstr(-mpmath.expm1(log_t), DIGITS),
                mpmath.nstr(mpmath.exp(log_t), DIGITS),
            )


def _volumes() -> Iterator[tuple[float, float, float]]:
    for slice_density in (1e-300, 1e-20, 1e-9, 0.0095, 0.1, 0.5, 0.9, 0.999, 1 - 1e-10, 1 - 1e-16):
        for ratio in (0.0, 1e-6, 0.3, 1.0, 7.0, 87.69, 1e3, 1e6):
            yield slice_density, 0.2 * ratio, 0.2
    yield 0.5, 780.0, 1.0  # T rounds to 0
    yield 0.5, 1074.0, 1.0  # T is the smallest float
    yield 0.5, 53.0, 1.0  # p rounds to 1
    for hard in HARD_TRANSPARENCIES:
        slice_density, height, size = map(float.fromhex, hard)
        yield slice_density, height, size
    source = random.Random(1)
    for _ in range(200):
        size = 10 ** source.uniform(-3, 1)
        slice_density = source.choice(
            (source.random(), 10 ** source.uniform(-12, 0), 1 - 10 ** source.uniform(-16, 0))
        )
        # |ln T| is from 1e-6 to 700, if this is possible with l/o up to 10^6.
        ratio = min(10 ** source.uniform(-6, math.log10(700)) / -math.log1p(-slice_density), 1e6)
        yield slice_density, size * ratio, size


# --- Eq. 2 ---------------------------------------------------------------------------------


def _eq2() -> Iterator[tuple[str, ...]]:
    yield (
        *("density", "transparency", "rows", "columns", "dhat"),
        *("visibility", "mean_squared_error", "normalized_visibility", "visibility_shortfall"),
    )
    source = random.Random(2)
    for rows, columns, dhat, shortfall in _shortfalls(source):
        # T is empty if it equals 1 - p exactly; otherwise p is the float nearest to 1 - T.
        transparency = 10 ** source.uniform(-30, -16) if source.random() < 0.2 else None
        density = _density(source) if transparency is None else 1.0 - transparency
        p = Fraction(density) if transparency is None else 1 - Fraction(transparency)
        visibility = exact.visibility(p, shortfall)
        yield (
            density.hex(),
            "" if transparency is None else transparency.hex(),
            str(rows),
            str(columns),
            dhat.hex(),
            *map(_decimal, (visibility, 1 - visibility, 1 - shortfall, shortfall)),
        )


def _shortfalls(source: random.Random) -> Iterator[tuple[int, int, float, Fraction]]:
    for side in (1, 2, 3, 4, 5, 7, 10, 19, 31, 40):
        for dhat in _disparities(side, source):
            yield side, side, dhat, exact.double_sum(side, dhat) / side**4
    for rows, columns in ((1, 2), (1, 50), (5, 10), (7, 8), (1, 10**6), (3, 10**5), (10**6, 10**6)):
        for dhat in _disparities(columns, source):
            if min(columns, 1 / max(dhat, 1e-300)) > 50_000:
                continue  # The sum would take minutes. A few such cases are below.
            both = exact.appendix_sum(rows, dhat) * exact.appendix_sum(columns, dhat)
            yield rows, columns, dhat, both
    for side, dhat in ((10**6, 1e-6), (10**6, 3e-6), (200_000, 1e-12), (123_457, 1 / 123_456)):
        yield side, side, dhat, exact.appendix_sum(side, dhat) ** 2


def _disparities(side: int, source: random.Random) -> Iterator[float]:
    yield from (0.0, 5e-324, 1e-300, 1.0, 1.7, 1e300)
    for k in {2, 3, max(side - 1, 1), source.randint(2, 1000)}:
        # Beyond this d̂, the samples of a pair do not share occluders. The sum has a kink at this
        # d̂.
        at = 1.0 / k
        yield from (math.nextafter(at, 0.0), at, math.nextafter(at, 1.0))
    for _ in range(6):
        yield source.uniform(0.0, 1.1)
        yield 10 ** source.uniform(-8, 0)


def _density(source: random.Random) -> float:
    return source.choice(
        (source.random(), 10 ** source.uniform(-300, 0), 1 - 10 ** source.uniform(-16, 0), 0.567)
    )


# --- Files ---------------------------------------------------------------------------------


def _decimal(value: Fraction) -> str:
    with decimal.localcontext(prec=DIGITS, Emin=-9999, Emax=9999):
        return str(decimal.Decimal(value.numerator) / decimal.Decimal(value.denominator))


def _text(rows: Iterator[tuple[str, ...]]) -> str:
    with io.StringIO(newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)
        return file.getvalue()


def main() -> None:
    """Write the tables."""
    for name, text in tables().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
        print(f"{name}: {text.count(chr(10)) - 1} rows")


if __name__ == "__main__":
    main()
