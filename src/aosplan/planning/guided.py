"""Guided positions: sites that are chosen for one place with a point cloud of this place.

The candidates are positions of a lattice. From each of them, a photo shows the whole target area,
and the lines of sight to the area stay above the plot. The sites are chosen with the voxels of one
half of the pulses (`aosplan.solver.guided_sites`). The prediction is made with the voxels of the
other half. Otherwise, the prediction would be too high, because some of the chosen sites are good
only by chance in the voxels with which they were chosen. Both halves have some blind spots in
common: voxels that no pulse has passed. The choice therefore assumes dense foliage in these voxels.

Plain grids are chosen and predicted with the same halves, for comparison. Their longest flight time
is the time of the request, or else the flight time of the guided positions. Guided positions are
accepted only if they are better than the best plain grid, both with the assumption of dense foliage
and without it.

The idea to compute the visibility of a place from each camera position, and to choose positions by
it, is from Nathan, Strand, Shutin and Bimber (2024, arXiv 2402.06991).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.errors import InfeasibleError, RequestError
from aosplan.flight.track import FlightPoints
from aosplan.grid.patterns import Scattered
from aosplan.messages import Limit
from aosplan.models.place import PlaceModel, PlaceViews, joint_density, prediction_of
from aosplan.planning.guided_candidates import candidates_of
from aosplan.planning.guided_result import GuidedResult
from aosplan.planning.plain_flights import plain_flights
from aosplan.planning.route import timing_at_baseline
from aosplan.planning.sites import Layout, route_of
from aosplan.planning.solved_plan import Memo, SolvedPlan, coverage_of, problem_with
from aosplan.planning.target_area import located_stand, target_area_of
from aosplan.scenes.plot_frame import plot_frame
from aosplan.solver.guided_sites import most_visible, visibility
from aosplan.solver.solution import Solution

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.areas.no_fly import NoFlyZones
    from aosplan.planning.guided_candidates import Candidates
    from aosplan.planning.resolve import PlanInputs
    from aosplan.planning.target_area import TargetArea
    from aosplan.scenes.plot_frame import PlotFrame
    from aosplan.scenes.voxels import VoxelVolume

    Floats = NDArray[np.float64]
    Indices = NDArray[np.intp]

SAMPLES = 25
"""Number of positions if the request has neither a number of samples nor a time."""

MOST_SAMPLES = 100
"""Default for the largest number of positions if the request has a time."""

FEWER = (1.0, 0.8, 0.6, 0.4, 0.25)
"""Fractions of the largest number of positions that fit into the time. Each of these numbers is
tried, and the number with the highest visibility is used.
"""


class Tour(NamedTuple):
    """The chosen candidates in flight order, the points of the route, and the total time of all
    flights.
    """

    order: Indices
    sites: FlightPoints
    time_s: float


def solve_guided(inputs: PlanInputs) -> SolvedPlan:
    """Choose positions for the target area of a plan, and predict the visibility from them.

    Raises
    ------
    RequestError
        If the scene has no voxels with a location and pulses, or does not cover the place.
    InfeasibleError
        If there are too few candidates, or no flight fits into the time.
    """
    volume = located_stand(inputs, "--grid guided")
    if volume.halves is None:
        reason = volume.opacity.reason if volume.opacity is not None else ""
        raise RequestError(
            "--grid guided needs opacity from the pulses of a point cloud, half of which are kept "
            f"for the prediction{f': {reason}' if reason else ''}",
            "give a point cloud with pulses of several returns, without --opacity voxels, or "
            "another --grid",
        )
    area = target_area_of(inputs)
    frame, zones = plot_frame(volume, area.origin), _zones(inputs)
    first, second = volume.halves
    chooses, safe, judges, doubts = (
        _views(inputs, volume.of_voxels(voxels), area, frame)
        for voxels in (first.measured, first.dense, second.measured, second.dense)
    )
    candidates = candidates_of(inputs, area, frame, chooses, zones)
    on_plot = frame.onto_plot(candidates.points_m)
    joint = joint_density(safe.hidden(on_plot))
    planner = _Planner(inputs, area, candidates, joint, zones)
    tour = planner.chosen()
    model = PlaceModel(judges, frame, inputs.heading_deg)
    seen, least = (views.hidden(on_plot[tour.order]) for views in (judges, doubts))
    pattern = Scattered(
        tuple((float(x), float(y)) for x, y in candidates.places[tour.order].tolist())
    )
    prediction = prediction_of(seen)
    _, coverage = coverage_of(inputs, Memo())
    problem = problem_with(inputs, model)
    solution = Solution(
        pattern=pattern,
        baseline_m=candidates.step_m,
        prediction=prediction,
        samples_required=None,
        limits=planner.limits(tour),
        met=inputs.requirement.is_met(prediction),
    )
    low, high = area.bounds_m(0.0)
    result = GuidedResult(
        sites=tour.sites,
        target_area_m2=area.area_m2,
        targets=len(judges.targets_m),
        target_pitch_m=judges.pitch_m,
        candidates=len(candidates.places),
        step_m=candidates.step_m,
        reach_m=candidates.reach_m,
        reason=candidates.reason,
        pulses=0 if volume.opacity is None else volume.opacity.pulses or 0,
        chosen_expected=prediction_of(chooses.hidden(on_plot[tour.order])).expected,
        least_expected=prediction_of(least).expected,
        unseen_share=float(seen.all(axis=0).mean()),
        one_photo=1.0 - float(model.hidden_at([(0.5 * (low + high))[::-1]])[0]),
        plain=plain_flights(
            inputs,
            area,
            candidates,
            joint_density(chooses.hidden(on_plot)),
            max(tour.time_s, 60.0 * (inputs.within_min or 0.0)),
            model,
            PlaceModel(doubts, frame, inputs.heading_deg),
        ),
    )
    _check_better(result, prediction.expected)
    return SolvedPlan(inputs, problem, coverage, solution, problem.grid, result)


def _check_better(result: GuidedResult, expected: float) -> None:
    """Refuse guided positions that are not better than the best plain grid with the same flight
    time.

    Raises
    ------
    InfeasibleError
        If the visibility is not higher than the visibility of the grid. Both are compared with the
        opacity from the pulses, and with dense foliage wherever no pulse has passed.
    """
    if not result.plain:
        return
    best = result.plain[0]
    if expected > best.prediction.expected and result.least_expected > best.least_expected:
        return
    along_m, across_m = best.pitch_m
    lanes = ""
    if best.kind == "lanes":
        lanes = f" --lanes {best.pattern.rows} --lane-pitch {across_m / along_m:.4g}"
    raise InfeasibleError(
        f"guided positions are not better here than a plain grid: their V is {expected:.3g}, or "
        f"{result.least_expected:.3g} if there is dense foliage wherever no pulse has passed; a "
        f"plain grid with the same flight time has V = {best.prediction.expected:.3g}, or "
        f"{best.least_expected:.3g} with this foliage",
        f"give --grid {best.kind}{lanes} --samples {best.samples} --baseline {along_m:g} --trigger "
        f"{best.trigger} for this plain grid, or a point cloud with flight lines from more sides",
    )


def _views(
    inputs: PlanInputs, volume: VoxelVolume, area: TargetArea, frame: PlotFrame
) -> PlaceViews:
    return PlaceViews(
        volume, inputs.altitude_m, area.on(frame), focal_height_m=inputs.focal_height_m
    )


def _zones(inputs: PlanInputs) -> NoFlyZones:
    import shapely

    from aosplan.areas.no_fly import NoFlyZones

    return NoFlyZones(shapely.Polygon() if inputs.area is None else inputs.area.keep_out)


class _Planner:
    """Choice and order of sites among the candidates."""

    def __init__(
        self,
        inputs: PlanInputs,
        area: TargetArea,
        candidates: Candidates,
        joint: Floats,
        zones: NoFlyZones,
    ) -> None:
        self._inputs, self._origin, self._candidates = inputs, area.origin, candidates
        self._joint, self._zones = joint, zones
        low = candidates.places.min(axis=0)
        self._stride = int(np.ptp(candidates.places[:, 0])) + 1
        self._cells = (candidates.places - low) @ np.array([1, self._stride])
        self._timing, _ = timing_at_baseline(inputs.flight, inputs.heading_deg, candidates.step_m)
        self._tours: dict[int, Tour] = {}

    def chosen(self) -> Tour:
        """The best sites, either the requested number of them or those that can be flown in the
        requested time.
        """
        bounds, within = self._inputs.bounds, self._inputs.within_min
        found = len(self._cells)
        count = bounds.samples
        if count is None and within is None:
            count = min(SAMPLES, found, bounds.max_samples or SAMPLES)
        if count is not None:
            if count > found:
                raise InfeasibleError(
                    f"there are only {found} candidate positions for {count} samples: "
                    f"{self._candidates.reason}",
                    f"give --samples {found}, or a smaller --baseline",
                )
            tour = self._tour(count)
            if within is not None and tour.time_s > 60.0 * within:
                minutes = math.ceil(tour.time_s / 6.0) / 10.0
                raise InfeasibleError(
                    f"{count} guided positions take {minutes:g} min, more than --within {within:g}",
                    "give fewer --samples, or a longer --within",
                )
            return tour
        assert within is not None
        return self._within(60.0 * within, min(found, bounds.max_samples or MOST_SAMPLES))

    def _within(self, longest_s: float, most: int) -> Tour:
        """The sites with the highest visibility that can be flown within a given time."""
        low, high = 0, most + 1
        while high - low > 1:
            middle = (low + high) // 2
            fits = self._tour(middle).time_s <= longest_s
            low, high = (middle, high) if fits else (low, middle)
        if low == 0:
            minutes = math.ceil(self._tour(1).time_s / 6.0) / 10.0
            raise InfeasibleError(
                f"not even one guided position can be flown within {longest_s / 60.0:g} min, from "
                "take-off to landing",
                f"--within {minutes:g} is enough for one",
            )
        counts = dict.fromkeys(max(round(part * low), 1) for part in FEWER)
        tours = [tour for tour in map(self._tour, counts) if tour.time_s <= longest_s]
        return max(tours, key=lambda tour: visibility(self._joint, tour.order))

    def _tour(self, count: int) -> Tour:
        """The best `count` sites, in an order with a short path, and the flights to them."""
        if count not in self._tours:
            self._tours[count] = self._ordered(most_visible(self._joint, count))
        return self._tours[count]

    def _ordered(self, sites: Indices) -> Tour:
        from aosplan.areas.survey import routed
        from aosplan.areas.tour import tour_of

        points = self._candidates.points_m
        cells = np.argsort(self._cells[sites], kind="stable")
        sites = sites[cells]
        order = sites[
            tour_of(
                self._cells[sites], self._stride, points[sites], self._timing, self._zones
            ).order
        ]
        tours = []
        for way in (order, order[::-1]):
            flown, photo = routed(points[way], self._zones)
            east, north = flown.T.tolist()
            layout = Layout(FlightPoints(east, north, photo), self._origin)
            route = route_of(self._inputs, layout, self._candidates.step_m)
            tours.append(Tour(way, layout.sites, route.total_time_s))
        return min(tours, key=lambda tour: tour.time_s)

    def limits(self, tour: Tour) -> tuple[Limit, ...]:
        """The limits that determined the number and the choice of the sites."""
        candidates, bounds = self._candidates, self._inputs.bounds
        samples, reach = len(tour.order), max(candidates.reach_m)
        of = f"of {len(self._cells)} candidates, which are {candidates.step_m:g} m apart"
        if bounds.samples is not None:
            text = f"the number of positions is given; these positions are the best {of}"
        elif self._inputs.within_min is not None:
            text = (
                f"these are the best positions {of}, for a flight of at most "
                f"{self._inputs.within_min:g} min from take-off to landing"
            )
        else:
            text = f"these are the best positions {of}; --samples N or --within MIN changes their number"
        return (
            Limit("samples", samples, samples, text),
            Limit("reach_m", reach, reach, candidates.reason),
        )
