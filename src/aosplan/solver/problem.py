"""The problem for the solver: target, bounds, kind of grid, and objective."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

from aosplan.flight.kinematics import Timing
from aosplan.grid.patterns import AnyFrame, AnyPattern, frame_at, index_for, pattern_for
from aosplan.models.model import at_heading
from aosplan.numerics import smallest_root

if TYPE_CHECKING:
    from collections.abc import Callable

    from aosplan.models.model import Prediction, VisibilityModel

    OnTrial = Callable[["Problem", AnyPattern, float], None]

OBJECTIVES = ("samples", "aperture", "time", "visibility", "contrast", "detection")
"""Objectives of a plan.  The last three are maximised.  The objective ``detection`` is not passed
to the solver.
"""

TOLERANCE = 1e-12
"""Relative tolerance on the shortfall when the number of samples is determined."""

ROUNDING = 1e-15
"""Relative tolerance on the shortfall when the baseline is determined.  It is the size of rounding
errors.
"""


def target_text(symbol: str, target: float) -> str:
    """A target in the form that messages show. `symbol` is V̂ or V."""
    return f"{symbol} = {target:.10g}"


def reached_text(symbol: str, reached: float) -> str:
    """The value that is reached, in the form that messages show."""
    return f"{symbol} = {reached:.4g}"


class Requirement(NamedTuple):
    """A target for the normalised visibility V̂ or the visibility V, with the exact value that the
    user wrote.
    """

    quantity: str
    target: Fraction

    def value_of(self, prediction: Prediction) -> float:
        """The predicted value of this quantity."""
        return prediction.normalized if self.quantity == "normalized" else prediction.expected

    @property
    def symbol(self) -> str:
        """The symbol of the quantity in messages."""
        return "V̂" if self.quantity == "normalized" else "V"

    @property
    def asked(self) -> tuple[str, float]:
        """Symbol and target: the first arguments of the functions in `aosplan.solver.refusals`."""
        return self.symbol, float(self.target)

    def __str__(self) -> str:
        """The target in the form that messages show."""
        return target_text(*self.asked)

    def is_met(self, prediction: Prediction, tolerance: float = TOLERANCE) -> bool:
        """Whether a prediction reaches the target, within a relative tolerance on the shortfall."""
        return self.excess(prediction, tolerance) <= 0.0

    def excess(self, prediction: Prediction, tolerance: float = TOLERANCE) -> float:
        """Difference between the error of a prediction, 1 - V̂ or 1 - V, and the error that the
        target allows. It is at most 0 if the target is met.
        """
        normalized = self.quantity == "normalized"
        error = prediction.shortfall if normalized else prediction.mean_squared_error
        return error - _left_by(self.target) * (1.0 + tolerance)

    def fewest_independent(self, model: VisibilityModel) -> int | None:
        """Number of samples that would meet the target if all were independent (K = 1/N).

        This is a lower bound of the number of samples if K >= 1/N. This condition is true for
        models whose visibility increases with the baseline, and the bound is used only for these
        models. For voxels and for oblique rays, K may be slightly less than 1/N, because the hidden
        share may differ between views.

        The result is None if no number of samples meets the target.  With K = 1/N, the condition of
        `is_met` is 1/N <= 1 - V̂ or p (p + T/N) <= 1 - V.  Both conditions are solved in exact
        arithmetic.
        """
        allowed = (1 - self.target) * (1 + Fraction(TOLERANCE))
        if self.quantity == "normalized":
            return math.ceil(1 / allowed)
        p, t = Fraction(model.density), Fraction(model.transparency)
        left = allowed - p * p
        return max(math.ceil(p * t / left), 1) if left > 0 else None


@lru_cache(maxsize=256)
def _left_by(target: Fraction) -> float:
    """1 minus the target."""
    return float(1 - target)


class CommonGround(NamedTuple):
    """The ground that all samples have to see.  It limits the size of the grid.

    Attributes
    ----------
    footprint_m
        Size of the ground that a photo shows, along and across the heading.
    least_m
        Size of the ground that all samples have to see: the size of a target, or the size of a
        pixel.
    over_area
        Whether the grid is repeated over an area.  All samples then have to see a cell between
        sites.
    """

    footprint_m: tuple[float, float]
    least_m: tuple[float, float] = (0.0, 0.0)
    over_area: bool = False

    def widest_m(self, sites: AnyPattern | AnyFrame) -> float:
        """Largest baseline at which all samples see enough common ground; infinite for one sample."""
        if sites.longer_side == 0.0:
            return math.inf
        cell = sites.pitch if self.over_area else (0.0, 0.0)
        sides = zip(self.footprint_m, self.least_m, sites.extent, cell, strict=True)
        return min(
            (size - least) / (side + more) for size, least, side, more in sides if side + more > 0.0
        )

    def allows(self, sites: AnyPattern | AnyFrame, baseline_m: float) -> bool:
        """Whether the samples of a pattern see enough common ground."""
        return baseline_m <= self.widest_m(sites) * (1.0 + TOLERANCE)


class Bounds(NamedTuple):
    """Bounds on the baseline, the number of samples and the extent, or fixed values of these
    quantities.
    """

    max_aperture_m: float | None = None
    max_samples: int | None = None
    baseline_m: float | None = None
    samples: int | None = None
    ground: CommonGround | None = None

    @property
    def on_extent(self) -> bool:
        """Whether the extent of the grid has a bound."""
        return self.max_aperture_m is not None or self.ground is not None


class GridKind(NamedTuple):
    """A kind of grid by name, with the parameters of lanes and spirals."""

    name: str = "trimmed"
    lanes: int = 3
    lane_pitch: float = 4.0

    @property
    def title(self) -> str:
        """The kind as it is shown in messages."""
        if self.name == "lanes":
            return f"{self.lanes} lanes of pitch {self.lane_pitch:g}"
        return f"spiral of pitch {self.lane_pitch:g}" if self.name == "spiral" else self.name

    def frame(self, index: int) -> AnyFrame:
        """The frame with a given index, counted from 1, in the sequence of this kind of grid."""
        return frame_at(self.name, index, lanes=self.lanes, lane_pitch=self.lane_pitch)

    def pattern(self, samples: int) -> AnyPattern:
        """The smallest pattern of this kind with at least the given number of samples."""
        return pattern_for(self.name, samples, lanes=self.lanes, lane_pitch=self.lane_pitch)

    def index_of(self, samples: int) -> int:
        """Index of the first frame that has at least the given number of samples."""
        return index_for(self.name, samples, lanes=self.lanes)


class Problem(NamedTuple):
    """The input of the solver: a model, a target, a kind of grid, bounds and an objective.

    `surrogate` is a quick approximation of a model whose visibility may decrease if the baseline
    increases. If `count_required` is true, the smallest number of samples at the baseline of the
    solution is computed. If `seek_remedy` is true, a remedy is computed for the hint of an error.
    Both computations take additional time. Before a search evaluates a pattern at a baseline, it
    calls `on_trial` with the problem, the pattern and the baseline [m].
    """

    model: VisibilityModel
    requirement: Requirement
    grid: GridKind = GridKind()
    bounds: Bounds = Bounds()
    objective: str = "samples"
    timing: Timing = Timing()
    surrogate: VisibilityModel | None = None
    count_required: bool = True
    seek_remedy: bool = True
    on_trial: OnTrial | None = None

    @property
    def name(self) -> str:
        """Name of the problem in messages: its kind of grid, and its heading if it has
        a heading.
        """
        heading = self.model.heading_deg
        return f"{self.grid.title} at {heading:g}°" if heading else self.grid.title

    def turned(self, heading_deg: float) -> Problem:
        """The same problem at another heading.  If the model does not depend on the heading, the
        problem itself is returned.
        """
        before = self.model.heading_deg
        if before is None or before == heading_deg:
            return self
        model = at_heading(self.model, heading_deg)
        surrogate = self.surrogate and at_heading(self.surrogate, heading_deg)
        # The wind is given along the axes of the path. Its components therefore change if the axes
        # turn.
        turn = math.radians(heading_deg - before)
        x, y = self.timing.wind
        wind = (x * math.cos(turn) + y * math.sin(turn), y * math.cos(turn) - x * math.sin(turn))
        timing = self.timing._replace(wind=wind) if any(self.timing.wind) else self.timing
        return self._replace(model=model, surrogate=surrogate, timing=timing)

    def surrogate_prediction(self, pattern: AnyPattern, baseline_m: float) -> Prediction:
        """Prediction of the surrogate, or of the model if there is no surrogate."""
        return (self.surrogate or self.model).predict(pattern, baseline_m)

    def meets(self, pattern: AnyPattern, baseline_m: float, tolerance: float = TOLERANCE) -> bool:
        """Whether a pattern at a baseline reaches the target."""
        return self.requirement.is_met(self.model.predict(pattern, baseline_m), tolerance)

    def widest_m(self, sites: AnyPattern | AnyFrame) -> float:
        """Largest baseline to try for a pattern, or for the patterns of a frame.

        A larger baseline does not improve the visibility, or it exceeds a bound on the size of the
        grid.
        """
        cap, side = self.widest_baseline_m / sites.nearest, sites.longer_side
        if self.bounds.ground is not None:
            cap = min(cap, self.bounds.ground.widest_m(sites))
        return min(cap, self.widest_aperture_m / side) if side > 0.0 else cap

    @property
    def widest_baseline_m(self) -> float:
        """Baseline beyond which the visibility does not improve.

        With position noise, larger baselines than this improve the visibility slightly, but need a
        much larger aperture. They are tried only if the number of samples is fixed, or if aperture
        or time is the objective.
        """
        priced = self.objective in ("aperture", "time") or self.bounds.samples is not None
        return self.model.independent_baseline_m if priced else self.model.sharp_baseline_m

    @property
    def widest_aperture_m(self) -> float:
        """Largest extent that the bounds and the size of the scene allow."""
        bound = self.bounds.max_aperture_m
        return min(math.inf if bound is None else bound, self.model.widest_aperture_m)

    def smallest_baseline_m(self, pattern: AnyPattern) -> float | None:
        """Smallest baseline within the bounds at which a pattern meets the target, or None."""
        widest = self.widest_m(pattern)
        if not self.meets(pattern, widest):
            return None
        if not self.meets(pattern, widest, ROUNDING):
            return widest
        return smallest_root(
            lambda baseline: self.requirement.excess(
                self.model.predict(pattern, baseline), ROUNDING
            ),
            0.0,
            widest,
        )
