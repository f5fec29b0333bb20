"""Review of a flight: the sites without a photo, the visibility of the photos, and the flight to
the missing sites.

A photo belongs to the nearest site if it is within a tolerance. A site without photos is missing.
The visibility of the photos is predicted for their recorded positions, with the scene and model of
the plan. The position noise of the plan is not used, because the recorded positions are known. A
photo that belongs to no site is also included if its footprint contains the centre of the grid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan import __version__
from aosplan.messages import SCHEMA, Message
from aosplan.models.model import prediction_document
from aosplan.planning.planner import plan
from aosplan.planning.result import flight_document
from aosplan.planning.sites import route_of
from aosplan.postflight.best_views import MOST_VIEWS
from aosplan.postflight.topup import TopUp, topup_within
from aosplan.postflight.views import Views, along_heading, in_axes, predicted

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from aosplan.maps.coverage_map import CoverageMap
    from aosplan.models.model import Prediction
    from aosplan.planning.request import PlanRequest
    from aosplan.planning.result import Plan
    from aosplan.solver.problem import OnTrial

ALONE_M = 1.0
"""Tolerance for a single site, which has no neighbours.  It is about the accuracy of GNSS."""

ROUNDED_M = 2e-4
"""Rounding error of positions in files."""

ALTITUDE_SHARE = 0.05
"""Relative difference between recorded and planned altitude above which there is a warning."""


class FlownDetection(NamedTuple):
    """Three probabilities of detection: of the plan, with the flown photos, and with the flown
    photos together with photos at the missing sites.
    """

    planned: float
    flown: float | None
    completed: float | None


@dataclass(frozen=True)
class Review:
    """Comparison of a flight with its plan.

    Attributes
    ----------
    plan
        The plan.  It has a location if the request or the photos have one.
    views
        The photos.
    east_m, north_m
        Positions of the photos relative to the origin of the plan.
    tolerance_m
        Largest distance between a photo and its site.
    sites
        Indices of the plan's sites among its waypoints.
    missing
        Indices of the sites without a photo, in flight order.
    site_of, off_m
        For each photo, index of the nearest site in `sites`, and the distance to it.
    flown, completed
        Prediction for the photos, and for the photos together with photos at the missing sites;
        None if there is no single prediction.
    counted
        Number of photos that the prediction includes.
    topup
        The plan with a path through the missing sites only. It is None if no sites are missing.
        Over an area, it has the missing sites that close gaps of the coverage. If there is a time
        limit, it has as many of these sites as the time allows.
    warnings
        Warnings for the user.
    detection
        Probability that the plan's target is found. Over an area, it is the mean over the places.
        It is None without a target, or if there is no single prediction.
    coverage
        Coverage of an area by the photos, at each place; None without an area.
    after
        The coverage by the flown photos together with the photos of the top-up.
    """

    plan: Plan
    views: Views
    east_m: list[float]
    north_m: list[float]
    tolerance_m: float
    sites: list[int]
    missing: list[int]
    site_of: NDArray[np.intp]
    off_m: NDArray[np.float64]
    flown: Prediction | None
    completed: Prediction | None
    counted: int
    topup: Plan | None
    warnings: tuple[Message, ...]
    detection: FlownDetection | None = None
    coverage: CoverageMap | None = None
    after: CoverageMap | None = None

    @property
    def strays(self) -> list[int]:
        """Indices of photos that belong to no site."""
        return np.flatnonzero(~_near(self.off_m, self.tolerance_m)).tolist()

    @property
    def errors_m(self) -> tuple[float, float] | None:
        """Root mean square and largest distance between photos and their sites; None if no photo
        belongs to a site.
        """
        off = self.off_m[_near(self.off_m, self.tolerance_m)]
        return (math.sqrt(float(np.mean(off * off))), float(off.max())) if len(off) else None

    def document(self) -> dict[str, Any]:
        """The review as plain values: the output of ``review --json``."""
        ways, errors = self.plan.waypoints, self.errors_m
        planned = self.plan.solution.prediction
        return {
            "schema": SCHEMA,
            "version": __version__,
            "request": self.plan.request.document(),
            "model": self.plan.model,
            "origin": None if self.plan.origin is None else list(self.plan.origin),
            "tolerance_m": self.tolerance_m,
            "positions": len(self.views),
            "counted": self.counted,
            "sites": len(self.sites),
            "sites_flown": len(self.sites) - len(self.missing),
            "off_site_m": None
            if errors is None
            else {"root_mean_square": errors[0], "largest": errors[1]},
            "planned": prediction_document(planned),
            "flown": None if self.flown is None else prediction_document(self.flown),
            **({} if self.detection is None else {"detection": self.detection._asdict()}),
            "completed": None if self.completed is None else prediction_document(self.completed),
            **({} if self.coverage is None else {"coverage": self._coverage_document()}),
            "missing": [
                {
                    name: value
                    for name, value in ways[index]._asdict().items()
                    if name != "photo" and value is not None
                }
                for index in self.missing
            ],
            "strays": [
                {
                    "index": index,
                    "name": self.views.name(index),
                    "east_m": self.east_m[index],
                    "north_m": self.north_m[index],
                    "nearest_site": self.sites[self.site_of[index]],
                    "off_m": float(self.off_m[index]),
                }
                for index in self.strays
            ],
            "topup": None if self.topup is None else flight_document(self.topup),
            "warnings": [warning._asdict() for warning in self.warnings],
        }

    def _coverage_document(self) -> dict[str, Any]:
        assert self.coverage is not None
        assert self.after is not None
        return {**self.coverage.document(), "gap_share_completed": self.after.gap_share}


def review(
    wanted: PlanRequest,
    views: Views,
    *,
    tolerance_m: float | None = None,
    longest_s: float = math.inf,
    folder: str = "",
    progress: Callable[[int, int], None] | None = None,
    on_trial: OnTrial | None = None,
) -> Review:
    """Compare recorded views with a plan.

    Parameters
    ----------
    wanted
        The request of the plan.
    views
        The photos. Positions in metres are relative to the origin of the plan. If the plan has no
        location, it is moved to the location at which most of its sites have a photo.
    tolerance_m
        Largest distance between a photo and its site; by default half of the smaller pitch.
    longest_s
        Longest time of the top-up, from take-off to landing.
    folder, progress, on_trial
        As in `aosplan.planning.planner.plan`.

    Raises
    ------
    RequestError
        In the same cases as `plan`, or if a position is too far from the plan.
    InfeasibleError
        In the same cases as `plan`, or if no missing photo can be taken within the time of the
        top-up.
    """
    # The flight is compared with the whole plan, not only with the part of the last battery.
    wanted = replace(wanted, resume_at=None, sensitivity=False)
    assumed = views.places is not None and not wanted.has_place
    if assumed:
        heading = wanted.heading if isinstance(wanted.heading, float) else 0.0
        wanted = replace(wanted, origin=views.middle(heading))
    planned = plan(wanted, folder=folder, progress=progress, on_trial=on_trial)
    if tolerance_m is None:
        pattern = planned.solution.pattern
        pitch_m = pattern.nearest * planned.solution.baseline_m if pattern.samples > 1 else 0.0
        tolerance_m = 0.5 * pitch_m or ALONE_M
    alike = 1
    if assumed:
        planned, alike = _laid_on(planned, views, tolerance_m)
    east, north = views.local_m(planned.origin)
    ways = planned.waypoints
    photo = ways.photo or [True] * len(ways)
    sites = [index for index, taken in enumerate(photo) if taken]
    sites_m = np.array([(ways.east_m[index], ways.north_m[index]) for index in sites])
    points_m = np.column_stack([east, north])
    off_m, site_of = _nearest(sites_m, points_m)
    near = _near(off_m, tolerance_m)
    there = np.zeros(len(sites), dtype=bool)
    there[site_of[near]] = True
    missing = [sites[place] for place in np.flatnonzero(~there)]
    warnings = [*planned.notices, *views.messages()]
    if assumed:
        warnings.append(_of_origin(planned, f"{there.sum()} of {len(sites)}", alike))
    warnings += _of_distances(near, off_m, tolerance_m)
    warnings += _of_altitudes(planned, views)
    counted = points_m[near | _sees_middle(planned, points_m)]
    area = None
    if planned.layout.survey is not None:
        area = _AreaReview(planned, points_m, sites_m, there, site_of, near)
    topup = _topup_of(planned, missing, area, longest_s)
    more_m = sites_m[np.searchsorted(sites, [] if topup is None else topup.sites)]
    if topup is not None:
        warnings += topup.messages(longest_s)
    coverage = after = detection = None
    if area is not None:
        coverage, after = area.coverage, area.after(more_m)
        detection = _mean_detections(coverage, after)
    reason = _unpredictable(planned, len(sites), len(counted) + len(missing))
    flown = completed = None
    if reason is not None:
        warnings.append(reason)
    else:
        flown, completed = _predictions(planned, counted, more_m)
        detection = detection or _detections(planned, counted, more_m)
        warnings += _of_blind(len(points_m) - len(counted))
    return Review(
        planned,
        views,
        east,
        north,
        tolerance_m,
        sites,
        missing,
        site_of,
        off_m,
        flown,
        completed,
        len(counted),
        None if topup is None else topup.plan,
        tuple(warnings),
        detection,
        coverage,
        after,
    )


def _topup_of(
    planned: Plan, missing: list[int], area: _AreaReview | None, longest_s: float
) -> TopUp | None:
    """The flight to the missing sites.  Over an area, it is the flight to those missing sites that
    close gaps.
    """
    gains = np.ones(len(missing))
    if area is not None:
        missing, gains = [missing[place] for place in area.closing], area.gains
    return topup_within(planned, missing, gains, longest_s) if missing else None


class _AreaReview:
    """Coverage of an area by photos, and the missing sites that close gaps of the coverage."""

    def __init__(
        self,
        planned: Plan,
        points_m: NDArray[np.float64],
        sites_m: NDArray[np.float64],
        there: NDArray[np.bool_],
        site_of: NDArray[np.intp],
        near: NDArray[np.bool_],
    ) -> None:
        from aosplan.maps.coverage_map import Coverage

        self._ground = ground = Coverage(planned)
        # Each site is counted once, at its own position, however many photos it has.
        self._points_m = points_m
        self._sites_m = np.vstack([sites_m[np.unique(site_of[near])], points_m[~near]])
        self.coverage = ground.of(points_m, self._sites_m)
        self.closing = ground.closing(points_m, self._sites_m, sites_m[~there]).tolist()
        gains = ground.gains(self.coverage, sites_m[~there][self.closing])
        self.gains = gains.astype(np.float64)

    def after(self, more_m: NDArray[np.float64]) -> CoverageMap:
        """The coverage with additional photos at given positions."""
        if not len(more_m):
            return self.coverage
        points, sites = (np.vstack([each, more_m]) for each in (self._points_m, self._sites_m))
        return self._ground.of(points, sites)


def _mean_detections(coverage: CoverageMap, after: CoverageMap) -> FlownDetection | None:
    """Mean probabilities of detection over an area; None for a plan without a target."""
    inside = coverage.cells.inside_rows
    planned, flown, completed = (
        None if each is None else float(each[inside].mean())
        for each in (
            coverage.planned_detection,
            coverage.flown_detection,
            after.flown_detection,
        )
    )
    return None if planned is None else FlownDetection(planned, flown, completed)


def _detections(
    planned: Plan, flown_m: NDArray[np.float64], missing_m: NDArray[np.float64]
) -> FlownDetection | None:
    """Probability that the target is found, with photos at the same positions as in
    `_predictions`.
    """
    if planned.detection is None:
        return None
    from aosplan.planning.plan_detection import detection_at

    def found(points_m: NDArray[np.float64]) -> float | None:
        if not len(points_m):
            return None
        return detection_at(planned.inputs, in_axes(planned, *points_m.T)).probability

    completed = found(np.vstack([flown_m, missing_m]))
    flown = found(flown_m) if len(missing_m) else completed
    return FlownDetection(planned.detection.probability, flown, completed)


def _laid_on(planned: Plan, views: Views, reach_m: float) -> tuple[Plan, int]:
    """The plan with the origin at which its sites fit the photos best, and the number of origins
    that fit equally well.
    """
    from aosplan.geodesy import to_wgs84
    from aosplan.postflight.registration import registered

    sites = planned.layout.sites
    taken = np.column_stack([sites.east_m, sites.north_m])[np.asarray(sites.photo, dtype=bool)]
    found = registered(taken, np.column_stack(views.local_m(planned.origin)), reach_m)
    if found is None:
        return planned, 1
    assert planned.origin is not None  # The caller has given the plan an origin.
    (latitude,), (longitude,) = to_wgs84(planned.origin, *found.offset_m.reshape(2, 1).tolist())
    origin = latitude, longitude
    request = planned.request.filled({"origin": origin})
    inputs = planned.inputs._replace(request=request, origin=origin)
    layout = planned.layout._replace(origin=origin)
    route = route_of(inputs, layout, planned.solution.baseline_m)
    return replace(planned, inputs=inputs, layout=layout, route=route), found.alike


def _nearest(
    sites_m: NDArray[np.float64], points_m: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Distance of each point to the nearest site, and index of that site."""
    from scipy.spatial import cKDTree

    off_m, site_of = cKDTree(sites_m).query(points_m)
    return np.asarray(off_m), np.asarray(site_of)


def _near(off_m: NDArray[np.float64], tolerance_m: float) -> NDArray[np.bool_]:
    near: NDArray[np.bool_] = off_m <= tolerance_m + ROUNDED_M
    return near


def _sees_middle(planned: Plan, points_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether the centre of the grid is within the footprint of each photo."""
    east, north = points_m.T
    half = 0.5 * np.array(planned.camera.footprint_m(planned.altitude_m))
    sees: NDArray[np.bool_] = np.all(
        np.abs(along_heading(east, north, planned.heading_deg)) <= half, axis=1
    )
    return sees


def _unpredictable(planned: Plan, sites: int, photos: int) -> Message | None:
    """The reason why there is no single prediction for the sites and the photos; None if there is a
    single prediction.
    """
    if planned.layout.survey is not None or sites != planned.solution.pattern.samples:
        message = (
            "the sites do not form a single grid, so no visibility is predicted for the photos"
        )
        return Message("no_single_aperture", message)
    if photos > MOST_VIEWS:
        message = (
            f"{photos} photos are too many; the visibility is predicted for at most {MOST_VIEWS}"
        )
        return Message("too_many_views", message)
    return None


def _predictions(
    planned: Plan, flown_m: NDArray[np.float64], missing_m: NDArray[np.float64]
) -> tuple[Prediction | None, Prediction]:
    """Prediction for the photos, and for the photos together with photos at the missing sites."""
    completed = predicted(planned, in_axes(planned, *np.vstack([flown_m, missing_m]).T))
    if not len(missing_m):
        return completed, completed
    flown = predicted(planned, in_axes(planned, *flown_m.T)) if len(flown_m) else None
    return flown, completed


def _of_origin(planned: Plan, flown: str, alike: int) -> Message:
    latitude, longitude = planned.origin or (math.nan, math.nan)
    where = f"so that most of its sites have a photo, {flown}"
    if alike > 1:
        where += (
            f" (there are {alike} positions at which equally many sites have a photo; this "
            "position fits the first sites)"
        )
    return Message(
        "origin_assumed",
        f"the plan has no location: it is placed {where}, with its origin at "
        f"{latitude:.7f},{longitude:.7f}; if this position is wrong, give --origin or the "
        "--heading that was flown",
    )


def _of_distances(
    near: NDArray[np.bool_], off_m: NDArray[np.float64], tolerance_m: float
) -> Iterator[Message]:
    if not near.any():
        yield Message(
            "no_photo_at_any_site",
            f"no photo is within {tolerance_m:.3g} m of a site; the nearest photo is "
            f"{off_m.min():.4g} m away; check that the photos belong to this plan, and check "
            "its origin and heading",
        )


def _of_blind(count: int) -> Iterator[Message]:
    if count:
        many = count > 1
        yield Message(
            "photos_aside",
            f"{count} photo{'s' if many else ''} far from every site "
            f"{'do' if many else 'does'} not see the ground below the middle of the grid and "
            f"{'are' if many else 'is'} left out of the visibility",
        )


def _of_altitudes(planned: Plan, views: Views) -> Iterator[Message]:
    """A warning if photos were not taken at the planned altitude.  There is no warning if one of
    the altitudes is not known.
    """
    if planned.route.datum is not None:
        return  # For a flight over terrain, the reference of the heights in files is not known.
    expected = planned.altitude_m + planned.inputs.focal_height_m
    known = np.array([each for each in views.altitudes_m if each is not None])
    off = known[np.abs(known - expected) > ALTITUDE_SHARE * expected]
    if len(off):
        yield Message(
            "altitude_differs",
            f"{len(off)} of {len(known)} photos were taken from {off.min():.4g} to "
            f"{off.max():.4g} m, but the visibility is predicted for the planned "
            f"{expected:.4g} m; give the --altitude that was flown",
        )
