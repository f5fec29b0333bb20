"""How guided positions were chosen, and plain grids within the same time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from aosplan.flight.track import FlightPoints
    from aosplan.grid.patterns import Pattern
    from aosplan.models.model import Prediction

CHOSEN_WITH, PREDICTED_WITH = "first half of the pulses", "second half of the pulses"


class PlainFlight(NamedTuple):
    """A plain grid at the same place that takes at most the time of the request, or at most the
    time of the guided positions.

    Attributes
    ----------
    kind, trigger
        Kind of grid (``lanes``, ``line``, ``square`` or ``trimmed``), and whether photos are taken
        at stops or while flying.
    pattern, pitch_m
        The grid, and its pitch along the heading and across it.
    time_s
        Time from take-off to landing.
    prediction, least_expected, unseen_share
        Prediction with the second half of the pulses; V with dense foliage wherever no pulse has
        passed; share of the place that is not visible in any photo.
    """

    kind: str
    trigger: str
    pattern: Pattern
    pitch_m: tuple[float, float]
    time_s: float
    prediction: Prediction
    least_expected: float
    unseen_share: float

    @property
    def samples(self) -> int:
        """Number of photos."""
        return self.pattern.samples

    def document(self) -> dict[str, Any]:
        """The grid as plain values."""
        return {
            "kind": self.kind,
            "trigger": self.trigger,
            "rows": self.pattern.rows,
            "columns": self.pattern.columns,
            "pitch_m": list(self.pitch_m),
            "samples": self.samples,
            "time_s": self.time_s,
            "density": self.prediction.density,
            "expected": self.prediction.expected,
            "normalized": self.prediction.normalized,
            "least_expected": self.least_expected,
            "unseen_share": self.unseen_share,
        }


class GuidedResult(NamedTuple):
    """How guided positions were chosen.

    Attributes
    ----------
    sites
        The positions in flight order, with the points at which the route turns around no-fly zones.
    target_area_m2, targets, target_pitch_m
        Size of the target area, number of its targets, and distance between neighbouring targets.
    candidates, step_m, reach_m
        Number, spacing and extent (along the heading and across it) of the candidate positions.
    reason
        What limits the extent of the candidates.
    pulses
        Number of pulses of both halves.
    chosen_expected
        V, predicted with the half of the pulses that the positions were chosen with.
    least_expected
        V, predicted with the other half and with dense foliage wherever no pulse has passed.
    unseen_share
        Share of the place that is not visible in any photo, predicted with the other half.
    one_photo
        Visibility in one photo from above the middle of the place, predicted with the other half.
    plain
        The best grid of each kind within the same time, the best one first.
    """

    sites: FlightPoints
    target_area_m2: float
    targets: int
    target_pitch_m: float
    candidates: int
    step_m: float
    reach_m: tuple[float, float]
    reason: str
    pulses: int
    chosen_expected: float
    least_expected: float
    unseen_share: float
    one_photo: float
    plain: tuple[PlainFlight, ...]

    def document(self) -> dict[str, Any]:
        """``guided`` of a plan's JSON document."""
        return {
            "chosen_with": CHOSEN_WITH,
            "predicted_with": PREDICTED_WITH,
            "pulses": self.pulses,
            "target_area_m2": self.target_area_m2,
            "targets": self.targets,
            "target_pitch_m": self.target_pitch_m,
            "candidates": self.candidates,
            "step_m": self.step_m,
            "reach_m": list(self.reach_m),
            "chosen_expected": self.chosen_expected,
            "least_expected": self.least_expected,
            "unseen_share": self.unseen_share,
            "plain": [flight.document() for flight in self.plain],
        }
