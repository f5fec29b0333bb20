"""Comparison of a plan's probability of detection with a simulated search.

The prediction is made by `aosplan.models.detection` or `aosplan.models.counted_detection` for the
scene of the plan. The search (`aosplan.simulation.search`) uses forests that were not used for the
prediction: random slices or stands, or the voxels of a point cloud with other radiances.

Two comparisons are made. *At the same threshold*: the predicted probability of detection is
compared with the share of targets that the detector finds with the predicted threshold. They agree
within `TOLERANCE` for nine photos or more. *At the same false-alarm rate*: the number of false
alarms per hectare is counted at the predicted threshold. Then another threshold is computed, with
which the detector has the specified rate of false alarms in the searched forests. The share of
targets that the detector finds with this threshold is reported. If only a few hectares are
searched, this threshold is an extrapolation, and the rate may differ by a factor of 2 to 3.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.errors import RequestError
from aosplan.grid.patterns import local_sites
from aosplan.models.clutter import HECTARE_M2
from aosplan.models.counted_detection import tail_level
from aosplan.models.seen_share import SHARES
from aosplan.simulation.compare import FOREST_OF
from aosplan.simulation.experiments import check_views
from aosplan.simulation.forests import generator, maker
from aosplan.simulation.search import SIZE_M, TargetRadiance, search_layers, search_volume

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from aosplan.planning.result import Plan
    from aosplan.simulation.search import Searched

FORESTS = 8
"""Default number of forests that are searched."""

TOLERANCE = 0.05
"""Largest accepted systematic difference at the same threshold."""

MOST_ERRORS = 2.5
"""Accepted number of standard errors in addition to `TOLERANCE`."""


class SearchComparison(NamedTuple):
    """A predicted probability of detection and the results of simulated searches.

    Attributes
    ----------
    predicted
        Prediction for the plan.
    simulated, standard_error
        Share of the targets found with the predicted threshold, and its standard error from the
        variation between forests.
    simulated_at_rate
        Share of the targets found with the threshold that gives the specified rate of false alarms
        in the searched forests.
    false_alarms_per_hectare, stated_per_hectare
        False alarms per hectare with the predicted threshold, and the specified number.
    seen, seen_errors
        For each s of `SHARES`, the simulated probability of a seen share of at least s, and its
        standard error.
    seen_predicted
        For each s of `SHARES`, the predicted probability of a seen share of at least s.
    forest, forests, targets, hectares, seed
        Kind and number of forests, number of targets, searched area, random seed.
    """

    predicted: float
    simulated: float
    standard_error: float
    simulated_at_rate: float
    false_alarms_per_hectare: float
    stated_per_hectare: float
    seen: tuple[float, ...]
    seen_errors: tuple[float, ...]
    seen_predicted: tuple[float, ...]
    forest: str
    forests: int
    targets: int
    hectares: float
    seed: int

    @property
    def agree(self) -> bool:
        """Whether prediction and simulation agree at the same threshold."""
        allowed = TOLERANCE + MOST_ERRORS * self.standard_error
        return abs(self.predicted - self.simulated) <= allowed

    def document(self) -> dict[str, Any]:
        """The comparison as plain values, ``search`` in a simulation's JSON document."""
        names = [f"{share:g}" for share in SHARES]
        return {
            "predicted": self.predicted,
            "simulated": self.simulated,
            "standard_error": self.standard_error,
            "agree": self.agree,
            "tolerance": TOLERANCE,
            "simulated_at_rate": self.simulated_at_rate,
            "false_alarms_per_hectare": self.false_alarms_per_hectare,
            "stated_per_hectare": self.stated_per_hectare,
            "seen_at_least": dict(zip(names, self.seen, strict=True)),
            "forest": self.forest,
            "forests": self.forests,
            "targets": self.targets,
            "hectares": self.hectares,
            "seed": self.seed,
        }


def compare_search(
    plan: Plan,
    *,
    seed: int = 1,
    forest: str | None = None,
    forests: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> SearchComparison:
    """Search simulated forests for the target of a plan.

    Parameters
    ----------
    plan
        A plan with a detection.
    seed
        Random seed of forests, radiances, places and directions.
    forest
        ``uniform``, ``layered``, ``clumped`` or ``cloud``; None for the forest that corresponds to
        the scene.
    forests
        Number of forests, at least 2; by default `FORESTS`.
    progress
        Function that is called with the number of finished forests and the total number of forests.

    Raises
    ------
    RequestError
        If the plan has no target to find, or if the forest cannot be searched.
    """
    detection = plan.detection
    if detection is None:
        raise RequestError("the plan has no target to find", "give --find person")
    check_views(plan.solution.pattern.samples)
    forests = forests or FORESTS
    forest = forest or FOREST_OF[plan.scene.kind if plan.volume is None else "cloud"]
    found = []
    for index, each in enumerate(_searches(plan, forest, seed, forests)):
        found.append(each)
        if progress is not None:
            progress(index + 1, forests)
    level, area = detection.threshold, sum(each.area_m2 for each in found) / HECTARE_M2
    peaks = np.sort(np.concatenate([each.peaks for each in found]))[::-1]
    at_rate = tail_level(peaks, detection.false_alarms * area)
    shares = [_mean_of([each.seen >= share for each in found]) for share in SHARES]
    mean, error = _mean_of([each.outputs > level for each in found])
    return SearchComparison(
        predicted=detection.probability,
        simulated=mean,
        standard_error=error,
        simulated_at_rate=_mean_of([each.outputs > at_rate for each in found])[0],
        false_alarms_per_hectare=float(np.count_nonzero(peaks > level)) / area,
        stated_per_hectare=detection.false_alarms,
        seen=tuple(share for share, _ in shares),
        seen_errors=tuple(error for _, error in shares),
        seen_predicted=tuple(detection.seen.at_least(share) for share in SHARES),
        forest=forest,
        forests=len(found),
        targets=sum(len(each.outputs) for each in found),
        hectares=area,
        seed=seed,
    )


def _searches(plan: Plan, forest: str, seed: int, forests: int) -> Iterator[Searched]:
    """Yield the results of the search for one forest after the other."""
    detection = plan.detection
    assert detection is not None
    contrast, offset, crowns = detection.signature
    # A cold target is found in the same way as a warm target.
    sign = -1.0 if contrast < 0.0 else 1.0
    look = TargetRadiance(*detection.target, sign * contrast, sign * offset, crowns)
    above = plan.scene.above(plan.request.focal_height)
    pattern, baseline, altitude = plan.solution.pattern, plan.solution.baseline_m, plan.altitude_m
    heading = plan.heading_deg if forest == "cloud" else 0.0
    sites = np.column_stack(local_sites(pattern, baseline, heading))
    if above is None or plan.coverage is None:
        raise RequestError("no occluder is above the focal plane, so there is nothing to search")
    if forest in ("uniform", "layered"):
        for index in range(forests):
            yield search_layers(above.slices(), sites, altitude, look, seed=seed, index=index)
        return
    if forest == "cloud" and plan.volume is None:
        raise RequestError("--forest cloud needs the voxels of a point cloud")
    if forest not in ("clumped", "cloud"):
        raise RequestError(
            f"targets cannot be simulated with --forest {forest}, because noise patterns have no ground",
            "give --forest uniform, layered, clumped or cloud",
        )
    for index in range(forests):
        volume, height = plan.volume, plan.request.focal_height
        if forest == "clumped":
            volume, height = maker(above, forest)(generator(seed, index), (SIZE_M, SIZE_M)), 0.0
        assert volume is not None
        yield search_volume(
            volume, sites, altitude, look, seed=seed + 1, index=index, focal_height_m=height
        )


def _mean_of(hits: list[Any]) -> tuple[float, float]:
    """Mean over all targets, and its standard error from the variation between forests."""
    means = [float(each.mean()) for each in hits]
    error = float(np.std(means, ddof=1)) / math.sqrt(len(means)) if len(means) > 1 else math.nan
    return float(np.mean(means)), error
