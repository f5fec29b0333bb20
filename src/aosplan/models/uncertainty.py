"""Standard errors of a prediction, and the contributions that they include and omit.

A plot is one sample of a forest, and it has few trees.  The standard errors describe the difference
from the mean prediction of such plots.  They also include the errors of the opacity and of the
plot's edges.  `Uncertainty.parts` has each contribution; `OMITTED` lists what is never included.

**The plot, telecentric.** p̄, V and V̂ are smooth functions of means over targets. To first order,
each of them is the mean over targets of an *influence* z(t). Let s² be the variance of z within the
plot, and A the integral of the correlation of z (the *integral range*). The plot then corresponds
to n = plot area/A independent targets, and the variance of the mean is s²/n (Matheron). The values
of z are relative to the mean of this plot, not of all plots. The covariance at every lag is
therefore too small by the variance of the mean of the plot. This variance is added to the
covariance at every lag.

**The plot, in perspective.** The rays from all targets to one camera converge, so the rays of an
aperture cross only a part of the canopy. At another place, the same aperture would see through
another part. The prediction is therefore computed for apertures at four places of the plot. The
variance is the sum of two terms: the variance of the mean over these apertures, computed as above,
and the variance between the apertures. Plots also differ in their number of trees. Data from one
plot cannot show this difference. A difference in the number of trees changes p̄ and V. It hardly
changes V̂, which is relative to p̄. The standard errors of p̄ and V are therefore multiplied by
`PERSPECTIVE`.

The standard errors were compared with the differences between halves and between quarters of plots,
for two real plots and for generated stands. About 70 % of the differences are within one standard
error, and about 95 % are within two (`benchmarks/uncertainty.py`).

**Opacity.** The share of light that a cell blocks also has an error. If the opacity is computed
from pulses, the energy of each return is not known. There are two bounds: the first return of a
pulse has all the energy, or the last return has all of it. The true prediction can be anywhere
between the predictions for these bounds. The standard error is therefore their difference divided
by √12. If each voxel with a point is treated as opaque, the result depends on the size of the
voxels. A user may choose sizes within about one octave. The prediction is therefore compared with
those for voxels of twice and of half the size, and the standard error is half of the larger
difference. In a dense stand, the larger difference is the difference from the prediction for
smaller voxels, because larger voxels hide everything. The prediction for smaller voxels is
extrapolated (`finer`).

**Clumps.** Pulses do not resolve clumps that are smaller than the distance between pulses. V̂ is
therefore too high. `CLUMPS` has the errors for generated stands with known leaves
(`benchmarks/opacity.py`). They are treated as standard errors.

**Models with statistics** of a point cloud: a model is made from each quarter of the plot, and each
model makes a prediction for the same sites. The standard deviation of the four predictions is twice
the standard error of their mean.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from aosplan.models.model import Prediction
    from aosplan.scenes.voxels import VoxelVolume

    Floats = NDArray[np.float64]

UNIFORM = 1.0 / math.sqrt(12.0)
"""Standard deviation of a value that is uniformly distributed between two bounds, divided by the
distance between the bounds.
"""

OCTAVE = 0.5
"""Standard error that is caused by the size of voxels, divided by the larger difference from the
predictions with voxels of twice and of half the size.
"""

STEEPEST = 2.0
"""Largest exponent, if the optical depth is described as a power of the voxel size. It is the
exponent of the area of a voxel.
"""

PERSPECTIVE = 1.2
"""Factor by which the standard errors of p̄ and V in perspective are multiplied. It is fitted to
differences between halves and quarters of real plots.
"""

CLUMPS = (
    (1.5, (0.02, 0.02, 0.25)),
    (3.0, (0.02, 0.02, 0.16)),
    (7.0, (0.01, 0.015, 0.10)),
    (20.0, (0.01, 0.015, 0.075)),
    (40.0, (0.009, 0.015, 0.05)),
    (80.0, (0.009, 0.015, 0.032)),
    (350.0, (0.004, 0.004, 0.016)),
    (math.inf, (0.003, 0.002, 0.012)),
)
"""Errors of p, V and V̂ that are caused by unresolved clumps. Each entry is for clouds with fewer
pulses per square metre than its first number. The errors are root mean squares over generated
stands and over voxels of 0.15 to 0.5 m.
"""

SMALLEST_QUARTER = 8
"""Smallest number of cells along each side of a quarter for which a prediction is made."""

OMITTED = (
    "differences between this forest and another one",
    "wind, season and light",
    "the slope of the ground",
    "errors of registration and of the camera",
)
"""Causes of error that no standard error includes."""

OMITTED_BY_STATISTICS = "the error of the model, which assumes independent occluders"


class ErrorPart(NamedTuple):
    """One contribution to standard errors.  `normalized` is None if V̂ is not defined.

    `source` is ``plot``, ``opacity``, ``clumps`` or ``edges``.
    """

    source: str
    density: float
    expected: float
    normalized: float | None


class Uncertainty(NamedTuple):
    """Standard errors of a prediction, and the method by which they were computed.

    `normalized` is None if V̂ is not defined, because everything or nothing is hidden.  The squares
    of `parts` add up to the squares of the standard errors.
    """

    density: float
    expected: float
    normalized: float | None
    method: str
    parts: tuple[ErrorPart, ...] = ()
    omits: tuple[str, ...] = OMITTED

    def document(self) -> dict[str, Any]:
        """The standard errors as a mapping of plain values."""
        own = self._asdict()
        return own | {"parts": [part._asdict() for part in self.parts], "omits": list(self.omits)}


def of_targets(hidden: Floats, cell: int = 1) -> Uncertainty:
    """Standard errors of the prediction for a periodic plot, computed from the share of the views
    in which each target is hidden.

    Parameters
    ----------
    hidden
        Shape (rows, columns): share of the views that do not see a target, 0 to 1.
    cell
        Side of a cell in targets.  The targets of a cell are averaged before the correlation is
        computed.
    """
    return _of_plot(*_of_fields(hidden, hidden * hidden, cell), "integral range")


def of_apertures(hidden: Sequence[Floats], cell: int = 1) -> Uncertainty:
    """Standard errors for the perspective view, from apertures at several places of a periodic plot.

    Parameters
    ----------
    hidden
        One array of shares for each aperture, as in `of_targets`. A target has the same index in
        all arrays.
    cell
        As in `of_targets`.
    """
    import numpy as np

    mean = np.mean(hidden, axis=0)
    errors = _of_fields(mean, np.mean([each * each for each in hidden], axis=0), cell)
    found = [_statistics(float(each.mean()), float((each * each).mean())) for each in hidden]

    def both(error: float, values: Sequence[float]) -> float:
        return math.hypot(error, float(np.std(values, ddof=1)))

    defined = [vhat for _, _, vhat in found if vhat is not None]
    known = errors[2] is not None and len(defined) == len(hidden)
    return _of_plot(
        PERSPECTIVE * both(errors[0], [p for p, _, _ in found]),
        PERSPECTIVE * both(errors[1], [v for _, v, _ in found]),
        both(errors[2] or 0.0, defined) if known else None,
        f"integral range and {len(hidden)} apertures",
    )


def _of_plot(density: float, expected: float, normalized: float | None, method: str) -> Uncertainty:
    part = ErrorPart("plot", density, expected, normalized)
    return Uncertainty(*part[1:], method, (part,))


def _statistics(p: float, square: float) -> tuple[float, float, float | None]:
    """p̄, V and V̂ from two means over targets: the mean of the hidden share, and the mean of its
    square.
    """
    spread = p * (1.0 - p)
    return p, 1.0 - square, 1.0 - (square - p * p) / spread if spread > 0.0 else None


def _of_fields(hidden: Floats, squares: Floats, cell: int) -> tuple[float, float, float | None]:
    """Standard errors of p̄, V and V̂, from the hidden share of each target and from the square of
    this share.
    """
    p, square = float(hidden.mean()), float(squares.mean())
    t = 1.0 - p
    of_density = hidden - p
    of_square = squares - square
    normalized = None
    if p * t > 0.0:
        shortfall = (square - p * p) / (p * t)
        of_shortfall = (of_square - (2.0 * p + shortfall * (1.0 - 2.0 * p)) * of_density) / (p * t)
        normalized = _standard_error(of_shortfall, cell)
    return _standard_error(of_density, cell), _standard_error(of_square, cell), normalized


def with_doubt(
    errors: Uncertainty, one: Prediction, other: Prediction, share: float, source: str
) -> Uncertainty:
    """Add an independent error to standard errors. It is computed from the difference of two
    predictions.

    Parameters
    ----------
    errors
        Standard errors so far.
    one, other
        Predictions for two bounds, for instance of the opacity.  The true value is between these
        predictions.
    share
        Standard error divided by the difference of the two predictions.
    source
        Name of the part.
    """
    return with_part(
        errors,
        ErrorPart(
            source,
            share * abs(one.density - other.density),
            share * abs(one.expected - other.expected),
            share * abs(one.normalized - other.normalized),
        ),
    )


def with_part(errors: Uncertainty, part: ErrorPart) -> Uncertainty:
    """Add an independent part to standard errors.  If V̂ was not defined, it remains undefined."""
    normalized = errors.normalized
    if normalized is None:
        part = part._replace(normalized=None)
    else:
        normalized = math.hypot(normalized, part.normalized or 0.0)
    return errors._replace(
        density=math.hypot(errors.density, part.density),
        expected=math.hypot(errors.expected, part.expected),
        normalized=normalized,
        method=f"{errors.method}, and {part.source}",
        parts=(*errors.parts, part),
    )


def of_voxel_size(middle: Prediction, coarse: Prediction) -> ErrorPart:
    """The part of the standard errors that is caused by the size of voxels.

    Parameters
    ----------
    middle, coarse
        Predictions with the voxels of a stand, and with voxels of twice the size.
    """
    others = coarse, finer(middle, coarse)

    def error(name: str) -> float:
        here = float(getattr(middle, name))
        return OCTAVE * max(abs(here - float(getattr(other, name))) for other in others)

    return ErrorPart("opacity", error("density"), error("expected"), error("normalized"))


def finer(middle: Prediction, coarse: Prediction) -> Prediction:
    """The prediction for voxels of half the size, extrapolated from two sizes.

    The optical depth -ln(1 - p̄) is nearly a power of the voxel size: it is proportional to the area
    of the voxels if all points are in different voxels, and it is constant if all voxels of the
    foliage contain points.  V̂ is extrapolated linearly in the logarithm of the size.

    Parameters
    ----------
    middle, coarse
        Predictions with the voxels of a stand, and with voxels of twice the size.
    """
    if not 0.0 < middle.transparency < 1.0:
        return middle
    depth = -math.log(middle.transparency)
    exponent = 1.0
    if coarse.transparency > 0.0:
        exponent = math.log2(max(-math.log(coarse.transparency) / depth, 1.0))
    clear = math.exp(-depth / 2.0 ** min(exponent, STEEPEST))
    shortfall = min(max(2.0 * middle.shortfall - coarse.shortfall, 0.0), 1.0)
    return middle._replace(density=1.0 - clear, transparency=clear, shortfall=shortfall)


def of_clumps(pulses_per_m2: float) -> ErrorPart:
    """The part of the standard errors that is caused by clumps that a given number of pulses per
    square metre does not resolve.
    """
    errors = next(errors for most, errors in CLUMPS if pulses_per_m2 < most)
    return ErrorPart("clumps", *errors)


def _standard_error(influence: Floats, cell: int) -> float:
    """Standard error of the mean of a correlated field on a periodic plot."""
    from aosplan.scenes.occluder_statistics import correlation_range

    rows, columns = influence.shape
    cells = influence.reshape(rows // cell, cell, columns // cell, cell).mean(axis=(1, 3))
    variance = float(cells.var())
    if variance <= 1e-30:
        return 0.0
    area, lags = correlation_range(cells)
    # The mean of the plot has the variance v. Its subtraction has reduced each covariance by v. The
    # equation for v is therefore v = s² A + lags v.
    share = min(lags / cells.size, 0.9)
    return math.sqrt(variance * area / cells.size / (1.0 - share))


def of_parts(predictions: Sequence[Prediction]) -> Uncertainty:
    """Standard errors of the prediction for a whole plot, from predictions for its equal parts."""
    import numpy as np

    def error(values: list[float]) -> float:
        return float(np.std(values, ddof=1)) / math.sqrt(len(values))

    defined = all(0.0 < each.density < 1.0 for each in predictions)
    errors = _of_plot(
        error([each.density for each in predictions]),
        error([each.expected for each in predictions]),
        error([each.normalized for each in predictions]) if defined else None,
        f"{len(predictions)} parts of the plot",
    )
    return errors._replace(omits=(OMITTED_BY_STATISTICS, *OMITTED))


def quarters(volume: VoxelVolume) -> Iterator[VoxelVolume]:
    """The four quarters of a plot.  If the number of rows or columns is odd, the last row or column
    is left out.

    The result is empty if a quarter would have fewer than `SMALLEST_QUARTER` cells along a side.
    """
    rows, columns = (cells // 2 for cells in volume.occupied.shape[1:])
    if min(rows, columns) >= SMALLEST_QUARTER:
        for south in (0, rows):
            for west in (0, columns):
                part = volume.occupied[:, south : south + rows, west : west + columns]
                yield volume.of_voxels(part)
