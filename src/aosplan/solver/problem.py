"""What is asked of the solver, and what it answers: targets, bounds, grids, solutions."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

from aosplan.flight.kinematics import Timing
from aosplan.grid.patterns import AnyFrame, Sites, frame_at, index_for, pattern_for
from aosplan.numerics import smallest_root
from aosplan.solver.refusals import target_text

if TYPE_CHECKING:
    from collections.abc import Callable

    from aosplan.models.model import Prediction, VisibilityModel

    OnTrial = Callable[["Problem", Sites, float], None]

OBJECTIVES = ("samples", "aperture", "time", "visibility", "contrast", "detection")
"""What a plan may minimise, or, the last three, maximise.  Detection is not for the solver."""

TOLERANCE = 1e-12
"""Relative tolerance on the shortfall when samples are counted."""

ROUNDING = 1e-15
"""The same when a baseline is solved for: no more than rounding may excuse."""


class Requirement(NamedTuple):
    """A target: normalised visibility V̂, or absolute visibility V; exact as it was written."""

    quantity: str
    target: Fraction

    def value_of(self, prediction: Prediction) -> float:
        """What a prediction reaches of this quantity."""
        return prediction.normalized if self.quantity == "normalized" else prediction.expected

    @property
    def symbol(self) -> str:
        """How messages call the quantity."""
        return "V̂" if self.quantity == "normalized" else "V"

    @property
    def asked(self) -> tuple[str, float]:
        """Symbol and target, as `aosplan.solver.refusals` takes them."""
        return self.symbol, float(self.target)

    def __str__(self) -> str:
        """The target as messages show it."""
        return target_text(*self.asked)

    def is_met(self, prediction: Prediction, tolerance: float = TOLERANCE) -> bool:
        """Whether a prediction reaches the target, to a relative tolerance of the shortfall."""
        return self.excess(prediction, tolerance) <= 0.0

    def excess(self, prediction: Prediction, tolerance: float = TOLERANCE) -> float:
        """What a prediction lacks to the target; at most 0 where it is met."""
        normalized = self.quantity == "normalized"
        error = prediction.shortfall if normalized else prediction.mean_squared_error
        return error - _left_by(self.target) * (1.0 + tolerance)

    def fewest_independent(self, model: VisibilityModel) -> int | None:
        """Samples that would do if all were independent: a lower bound where K >= 1/N.

        So it is for every pattern of a model that rises with the baseline, and only those are asked.
        Of voxels, and of oblique rays, K can be a little below: views that hide unlike shares
        spread less than their mean does.

        None where no number of samples reaches the target.  With K = 1/N, `is_met` reads
        1/N <= 1 - V̂ or p (p + T/N) <= 1 - V; both are solved in exact arithmetic.
        """
        allowed = (1 - self.target) * (1 + Fraction(TOLERANCE))
        if self.quantity == "normalized":
            return math.ceil(1 / allowed)
        p, t = Fraction(model.density), Fraction(model.transparency)
        left = allowed - p * p
        return max(math.ceil(p * t / left), 1) if left > 0 else None


@lru_cache(maxsize=256)
def _left_by(target: Fraction) -> float:
    """What a target leaves to 1."""
    return float(1 - target)


class CommonGround(NamedTuple):
    """The ground that all samples have to see, which bounds the grid.

    Attributes
    ----------
    footprint_m
        Ground that a photo shows, along and across the heading.
    least_m
        What of it all samples have to see along either: the size of a target, or a pixel.
    over_area
        Whether the grid is repeated over an area: then they have to see a cell between sites.
    """

    footprint_m: tuple[float, float]
    least_m: tuple[float, float] = (0.0, 0.0)
    over_area: bool = False

    def widest_m(self, sites: Sites | AnyFrame) -> float:
        """Widest baseline at which a pattern leaves so much ground; infinite for a single sample."""
        if sites.longer_side == 0.0:
            return math.inf
        cell = sites.pitch if self.over_area else (0.0, 0.0)
        sides = zip(self.footprint_m, self.least_m, sites.extent, cell, strict=True)
        return min(
            (size - least) / (side + more) for size, least, side, more in sides if side + more > 0.0
        )

    def allows(self, sites: Sites | AnyFrame, baseline_m: float) -> bool:
        """Whether a pattern at a baseline leaves so much ground."""
        return baseline_m <= self.widest_m(sites) * (1.0 + TOLERANCE)


class Bounds(NamedTuple):
    """Bounds on the unknowns, or fixed values for them."""

    max_aperture_m: float | None = None
    max_samples: int | None = None
    baseline_m: float | None = None
    samples: int | None = None
    ground: CommonGround | None = None

    @property
    def on_extent(self) -> bool:
        """Whether anything bounds the extent of the grid."""
        return self.max_aperture_m is not None or self.ground is not None


class GridKind(NamedTuple):
    """A kind of grid by name, and what it needs to know."""

    name: str = "trimmed"
    lanes: int = 3
    lane_pitch: float = 4.0

    @property
    def title(self) -> str:
        """The kind as messages call it."""
        if self.name == "lanes":
            return f"{self.lanes} lanes of pitch {self.lane_pitch:g}"
        return f"spiral of pitch {self.lane_pitch:g}" if self.name == "spiral" else self.name

    def frame(self, index: int) -> AnyFrame:
        """The frame at a place of the sequence, from 1."""
        return frame_at(self.name, index, lanes=self.lanes, lane_pitch=self.lane_pitch)

    def pattern(self, samples: int) -> Sites:
        """The smallest pattern of this kind with at least this many samples."""
        return pattern_for(self.name, samples, lanes=self.lanes, lane_pitch=self.lane_pitch)

    def index_of(self, samples: int) -> int:
        """Place of the first frame that takes this many samples."""
        return index_for(self.name, samples, lanes=self.lanes)


class Problem(NamedTuple):
    """Everything the solver needs: a model, a target, a kind of grid, bounds and an objective.

    `surrogate` is a quick approximation of a model whose visibility need not rise with the baseline.  Where
    nobody asks for the fewest samples at the answer's baseline, they need not be counted, nor a
    remedy be sought where nobody reads it.
    `on_trial` is told of the problem, a pattern and a baseline [m] before a search looks at them.
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
        """How messages tell it from others: its kind of grid, and its heading where it has one."""
        heading = self.model.heading_deg
        return f"{self.grid.title} at {heading:g}°" if heading else self.grid.title

    def turned(self, heading_deg: float) -> Problem:
        """The same problem at another heading; itself if the model has none."""
        before = self.model.heading_deg
        if before is None or before == heading_deg:
            return self
        model = self.model.at_heading(heading_deg)
        surrogate = None if self.surrogate is None else self.surrogate.at_heading(heading_deg)
        # The wind stays where it is, while the axes of the path turn.
        turn = math.radians(heading_deg - before)
        x, y = self.timing.wind
        wind = (x * math.cos(turn) + y * math.sin(turn), y * math.cos(turn) - x * math.sin(turn))
        timing = self.timing._replace(wind=wind) if any(self.timing.wind) else self.timing
        return self._replace(model=model, surrogate=surrogate, timing=timing)

    def surrogate_prediction(self, pattern: Sites, baseline_m: float) -> Prediction:
        """What the surrogate, or the model where there is none, says of a pattern at a baseline."""
        return (self.surrogate or self.model).predict(pattern, baseline_m)

    def meets(self, pattern: Sites, baseline_m: float, tolerance: float = TOLERANCE) -> bool:
        """Whether a pattern at a baseline reaches the target."""
        return self.requirement.is_met(self.model.predict(pattern, baseline_m), tolerance)

    def widest_m(self, sites: Sites | AnyFrame) -> float:
        """Widest baseline worth trying for a pattern, or those of a frame.

        Beyond it nothing is gained, or the bound on the aperture is broken.
        """
        cap, side = self.widest_baseline_m / sites.nearest, sites.longer_side
        if self.bounds.ground is not None:
            cap = min(cap, self.bounds.ground.widest_m(sites))
        return min(cap, self.widest_aperture_m / side) if side > 0.0 else cap

    @property
    def widest_baseline_m(self) -> float:
        """Baseline beyond which nothing is gained, or nothing but what position noise takes.

        The latter where that is worth no aperture of three times the size: unless the number of
        samples is fixed, or aperture or time tell what it is worth.
        """
        priced = self.objective in ("aperture", "time") or self.bounds.samples is not None
        return self.model.independent_baseline_m if priced else self.model.sharp_baseline_m

    @property
    def widest_aperture_m(self) -> float:
        """Largest extent that the bounds, and what is known of the scene, allow."""
        bound = self.bounds.max_aperture_m
        return min(math.inf if bound is None else bound, self.model.widest_aperture_m)

    def smallest_baseline_m(self, pattern: Sites) -> float | None:
        """Smallest baseline at which a pattern meets the target; None where none within bounds."""
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
