"""Standard errors of a prediction because of the limited size of the plot.

A plot is one sample of a forest with few trees.  Two methods estimate how much the prediction would
vary between plots of the same size and kind.  Neither includes what all plots lack, such as missing
points of a cloud, nor simplifications of a model.

**Measured model.**  p̄, V and V̂ are smooth functions of means over targets.  To first order, each
is therefore a mean of an *influence* z(t) of every target.  Let s² be the variance of z within the
plot, and A the integral of its correlation, the *integral range*.  The mean then has the same
variance s²/n as a mean of n = plot area/A independent targets (Matheron).  Because the plot's own
mean has been subtracted from z, each covariance in A is too small by the variance of that mean;
this is corrected.  For 360 pairs of halves of generated plots, 63 to 72 % differ by less than one
combined standard error, and 92 to 97 % by less than two (`benchmarks/uncertainty.py`).  For plots
with few crowns, which a wide aperture sees repeatedly, the standard error is up to a half too
small.

**Opacity.**  The opacity of a cell is measured or assumed.  If it is fitted to pulses, the energies
of the returns are unknown.  The two extremes are that the first return has all of the energy of its
pulse, and that the last return has it.  The true prediction may be anywhere between the two, so
their difference divided by √12 is a further standard error.  If voxels that contain a point are
opaque, their size determines the result.  Users may choose among sizes of about an octave, so the
error is half the difference to voxels of twice the size.

**Uniform and layered model**, if the scene comes from a cloud: the model is created from each
quarter of the plot.  The standard deviation of the four predictions for the same sites is twice the
standard error of their mean.
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
"""Standard deviation of a uniform distribution between two bounds, divided by their distance."""

OCTAVE = 0.5
"""Standard error due to the voxel size, divided by the difference to twice that size."""

SMALLEST_QUARTER = 8
"""Smallest number of cells along a quarter of a plot for which the quarters are used."""


class Uncertainty(NamedTuple):
    """Standard errors of a prediction, and the method by which they were found.

    `normalized` is None if V̂ is not defined, because all targets are hidden or none.
    """

    density: float
    expected: float
    normalized: float | None
    method: str


def of_targets(hidden: Floats, cell: int = 1) -> Uncertainty:
    """Standard errors from the share of views that hide each target of a periodic plot.

    Parameters
    ----------
    hidden
        Shape (rows, columns): share of the views that do not see a target, 0 to 1.
    cell
        Number of targets along each side of the blocks that are averaged for the correlation.
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
    """Add the uncertainty of opacity to standard errors, as `with_doubt` does."""
    return with_doubt(errors, one, other, share, "opacity")


def with_doubt(
    errors: Uncertainty, one: Prediction, other: Prediction, share: float, name: str
) -> Uncertainty:
    """Add another independent error to standard errors.

    Parameters
    ----------
    errors
        Standard errors for the finite plot.
    one, other
        Two predictions between which the true one may be, for example for two opacities.
    share
        Standard error as a share of the difference between the predictions.
    name
        Name of the source of the error.
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
    """Standard error of the mean of a correlated field that is periodic."""
    from aosplan.scenes.occluder_statistics import correlation_range

    rows, columns = influence.shape
    cells = influence.reshape(rows // cell, cell, columns // cell, cell).mean(axis=(1, 3))
    variance = float(cells.var())
    if variance <= 1e-30:
        return 0.0
    area, lags = correlation_range(cells)
    # Each covariance is too small by the variance v of the plot's mean, so v = s² A + lags v.
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
    """The four quarters of a plot without odd rows and columns; none if they would be too small."""
    from dataclasses import replace

    rows, columns = (cells // 2 for cells in volume.occupied.shape[1:])
    if min(rows, columns) >= SMALLEST_QUARTER:
        for south in (0, rows):
            for west in (0, columns):
                part = volume.occupied[:, south : south + rows, west : west + columns]
                yield replace(volume, occupied=part, bounds=None)
