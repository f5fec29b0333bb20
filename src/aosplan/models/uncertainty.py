"""How far a prediction may be off for want of more of the same forest: standard errors.

A plot is one sample of a forest, and its trees are few.  Two estimates say what another plot of
the same size and kind would scatter by; neither knows of what both plots lack, such as points of
the cloud, nor of what a model leaves out.

**Measured model.**  p̄, V and V̂ are smooth functions of means over targets, so to first order each
is itself a mean, of an *influence* z(t) of every target.  With s² the variance of z within the plot
and A the integral of its correlation, its *integral range*, n = plot area/A targets would do if
they were independent, and the mean has the variance s²/n (Matheron).  The plot's own mean has been
taken from z, which takes the same share of variance from each of the lags that A sums up; that is
put back.  Of 360 pairs of halves of generated plots, 63 to 72 % differ by less than the two errors
together, and 92 to 97 % by less than twice that (`benchmarks/uncertainty.py`).  Plots with few
crowns, which a wide aperture sees over and over again, state up to a half too little.

**Opacity.**  How much a cell hides is measured as well, or assumed.  If it comes from pulses, the
energy of a return is not known: the first return of a pulse has at most all of it, and so has the
last.  Between the predictions for these two the truth may lie anywhere, so their difference/√12 is
one more standard error.  If voxels with a point in them count as opaque, their size decides: half
the difference to voxels of twice the size is the error, as one octave of sizes is what a user may
choose from.

**Models of statistics**, where they come from a cloud: the model is made from each quarter of the
plot, and what the four predict for the same sites scatters by twice the error of their mean.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from aosplan.models.model import Prediction
    from aosplan.scenes.voxels import VoxelVolume

    Floats = NDArray[np.float64]

UNIFORM = 1.0 / math.sqrt(12.0)
"""Standard deviation of what lies anywhere between two bounds, over their distance."""

OCTAVE = 0.5
"""Standard error of the size of voxels, over the difference to twice that size."""

SMALLEST_QUARTER = 8
"""Cells along the side of a plot's quarter from which it says anything of the plot."""


class Uncertainty(NamedTuple):
    """Standard errors of a prediction, and how they were found.

    `normalized` is None where V̂ is not defined: where all is hidden, or nothing.
    """

    density: float
    expected: float
    normalized: float | None
    method: str


def of_targets(hidden: Floats, cell: int = 1) -> Uncertainty:
    """Standard errors from how often each target of a wrapped plot is hidden.

    Parameters
    ----------
    hidden
        Shape (rows, columns): share of the views that do not see a target, 0 to 1.
    cell
        Targets along a side that are taken together for the correlation.
    """
    p = float(hidden.mean())
    t = 1.0 - p
    square = float((hidden * hidden).mean())
    of_density = hidden - p
    of_square = hidden * hidden - square
    normalized = None
    if p * t > 0.0:
        shortfall = (square - p * p) / (p * t)
        of_shortfall = (of_square - (2.0 * p + shortfall * (1.0 - 2.0 * p)) * of_density) / (p * t)
        normalized = _standard_error(of_shortfall, cell)
    return Uncertainty(
        _standard_error(of_density, cell),
        _standard_error(of_square, cell),
        normalized,
        "integral range",
    )


def with_opacity(
    errors: Uncertainty, one: Prediction, other: Prediction, share: float
) -> Uncertainty:
    """Add the doubt about opacity to standard errors, as of `with_doubt`."""
    return with_doubt(errors, one, other, share, "opacity")


def with_doubt(
    errors: Uncertainty, one: Prediction, other: Prediction, share: float, name: str
) -> Uncertainty:
    """Add a doubt to standard errors, as an independent error.

    Parameters
    ----------
    errors
        Standard errors for the finite plot.
    one, other
        Predictions between which the truth may lie: for two opacities, say.
    share
        Standard error as a share of their difference.
    name
        What the doubt is about.
    """

    def both(error: float, difference: float) -> float:
        return math.hypot(error, share * difference)

    normalized = errors.normalized
    if normalized is not None:
        normalized = both(normalized, one.normalized - other.normalized)
    return Uncertainty(
        both(errors.density, one.density - other.density),
        both(errors.expected, one.expected - other.expected),
        normalized,
        f"{errors.method}, and {name}",
    )


def _standard_error(influence: Floats, cell: int) -> float:
    """Standard error of the mean of a correlated field that wraps around at its edges."""
    from aosplan.scenes.occluder_statistics import correlation_range

    rows, columns = influence.shape
    cells = influence.reshape(rows // cell, cell, columns // cell, cell).mean(axis=(1, 3))
    variance = float(cells.var())
    if variance <= 1e-30:
        return 0.0
    area, lags = correlation_range(cells)
    # With the variance v of the plot's mean, each covariance is too small by v: v = s² A + lags v.
    share = min(lags / cells.size, 0.9)
    return math.sqrt(variance * area / cells.size / (1.0 - share))


def of_parts(predictions: Sequence[Prediction]) -> Uncertainty:
    """Standard errors of a whole from predictions for its equal parts."""
    import numpy as np

    def error(values: list[float]) -> float:
        return float(np.std(values, ddof=1)) / math.sqrt(len(values))

    defined = all(0.0 < each.density < 1.0 for each in predictions)
    return Uncertainty(
        error([each.density for each in predictions]),
        error([each.expected for each in predictions]),
        error([each.normalized for each in predictions]) if defined else None,
        f"{len(predictions)} parts of the plot",
    )


def quarters(volume: VoxelVolume) -> Iterator[VoxelVolume]:
    """The four quarters of a plot, odd rows and columns left out; none where they are too small."""
    from dataclasses import replace

    rows, columns = (cells // 2 for cells in volume.occupied.shape[1:])
    if min(rows, columns) >= SMALLEST_QUARTER:
        for south in (0, rows):
            for west in (0, columns):
                part = volume.occupied[:, south : south + rows, west : west + columns]
                yield replace(volume, occupied=part, bounds=None)
