"""Surveys: the waypoints that cover an area with the grid of a plan, and the ground that they
cover.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import shapely

from aosplan.areas.area import quiet
from aosplan.areas.cell_runs import CellRuns, runs_of, united
from aosplan.areas.coverage import (
    CellLattice,
    RequiredGrid,
    centred_lattice,
    image_cells,
    overlapped_cells,
    seen_cells,
    site_counts,
    sites_for,
    sites_seeing,
    window_of,
)
from aosplan.areas.no_fly import NoFlyZones
from aosplan.areas.tour import shortest_m, total, tour_of
from aosplan.errors import InfeasibleError, RequestError
from aosplan.flight.track import FlightPoints
from aosplan.grid.patterns import MOST_SITES, Pattern
from aosplan.messages import Message
from aosplan.numerics import heading_axis, turned

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.areas.area import Area
    from aosplan.areas.cell_runs import Whole
    from aosplan.flight.kinematics import Timing

    Points = NDArray[np.float64]


class Survey(NamedTuple):
    """A flight over an area.

    Attributes
    ----------
    sites_flown
        Sites in flight order, with the turning points around no-fly zones if there are any.
    origin
        Latitude and longitude of the origin of the coordinates.
    area_m2, clear_m2, no_fly_m2
        Size of the area, of its part for which one photo is enough, and of its part in no-fly
        zones.
    covered_share
        Share of the cells of the area that are covered by the rule of `aosplan.areas.coverage`.
    fewest_looks
        Smallest number of sites in the rectangle around any point below canopy; None without
        canopy.
    sites, sites_in_rectangle
        Number of sites that are flown, and number of sites that the whole rectangle around the area
        would need.
    sites_in_no_fly, sites_enclosed
        Number of sites that were dropped because they are in a no-fly zone or enclosed by one.
    rectangle_m, pitch_m
        Size of the rectangle of the coverage rule, and pitch of the sites, both along and across
        the heading.
    length_m
        Length of the path from the first site to the last, including detours around zones.
    axis
        Whether lines are flown along the heading or across it.
    shortest_m
        Lower bound of `length_m` for any order of the sites.
    simplified_m, projection_error
        The attributes of `aosplan.areas.area.Area` with these names.
    notices
        Warnings for the user.
    """

    sites_flown: FlightPoints
    origin: tuple[float, float]
    area_m2: float
    clear_m2: float
    no_fly_m2: float
    covered_share: float
    fewest_looks: int | None
    sites: int
    sites_in_rectangle: int
    sites_in_no_fly: int
    sites_enclosed: int
    rectangle_m: tuple[float, float]
    pitch_m: tuple[float, float]
    axis: str
    length_m: float
    shortest_m: float
    simplified_m: float
    projection_error: float
    notices: tuple[Message, ...]

    def document(self) -> dict[str, Any]:
        """The survey as plain values, ``area`` in a plan's JSON document."""
        own = self._asdict()
        for name in ("sites_flown", "notices", "length_m"):
            del own[name]
        plain = {n: list(v) if isinstance(v, tuple) else v for n, v in own.items()}
        return plain | {
            "over_shortest": self.length_m / self.shortest_m if self.shortest_m > 0.0 else None
        }


@quiet
def survey_of(
    area: Area,
    pattern: Pattern,
    *,
    baseline_m: float,
    heading_deg: float,
    footprint_m: tuple[float, float],
    max_sites: int,
    timing: Timing,
) -> Survey:
    """The flight that covers an area with the grid of a plan.

    Parameters
    ----------
    area
        The area to cover.
    pattern, baseline_m
        The grid that every point below canopy has to see.
    heading_deg
        Direction of the grid, clockwise from true north.
    footprint_m
        Size of an image on the focal plane, along and across the heading.
    max_sites
        Largest number of sites.  A plan with more sites is refused before the sites are computed.
    timing
        Flight settings, which determine the order of the sites.

    Raises
    ------
    InfeasibleError
        If images are too small for the coverage rule, or if all sites are in no-fly zones.
    RequestError
        If the area needs more sites than `max_sites`.
    """
    turn = _Turn(heading_deg)
    whole, canopy, clear = (turn.shape(part) for part in (area.whole, area.canopy, area.clear))
    hidden = not canopy.is_empty and baseline_m > 0.0
    if hidden:
        window = _window(pattern, baseline_m, footprint_m)
    else:  # One photo is enough for the whole area.
        window = window_of(Pattern(1, 1), footprint_m)
        canopy, clear = whole, shapely.Polygon()
    _check_size(canopy, window.pitch_m, window.samples, max_sites)
    _check_size(clear, footprint_m, 1, max_sites)

    image = image_cells(footprint_m, window.pitch_m)
    lattice = centred_lattice(canopy, whole, window, max(window.columns, image[0]) + 1)
    placements = overlapped_cells(canopy, lattice)
    at_sites = lattice.moved(-0.5 * (window.columns - 1), -0.5 * (window.rows - 1))
    wanted = sites_for(placements, window, lattice.stride)
    clear_cells = overlapped_cells(clear, at_sites)
    _refuse_more(wanted.size, max_sites, "")
    extra = sites_seeing(
        clear_cells.without(seen_cells(wanted, image, lattice.stride)), image, lattice.stride
    )
    wanted = united(np.append(wanted.start, extra), np.append(wanted.stop, extra + 1))
    _refuse_more(wanted.size, max_sites, "")

    zones = NoFlyZones(turn.shape(area.keep_out))
    sites, in_zone, enclosed = _allowed(wanted.numbers(), at_sites, zones)
    points = at_sites.middles(sites)
    tour = tour_of(sites, lattice.stride, points, timing, zones)
    way, photo = routed(points[tour.order], zones)
    east, north = turn.back(way)

    share, fewest = _covered(
        sites, (canopy, clear), (placements, clear_cells), window, (lattice, at_sites), image
    )
    x_low, y_low, x_high, y_high = shapely.bounds(whole).tolist()
    around = [
        max(math.ceil(size / pitch - 1e-9), 1) + more - 1
        for size, pitch, more in zip(
            (x_high - x_low, y_high - y_low),
            window.pitch_m,
            (window.columns, window.rows),
            strict=True,
        )
    ]
    result = Survey(
        sites_flown=FlightPoints((east + 0.0).tolist(), (north + 0.0).tolist(), photo),
        origin=area.origin,
        area_m2=float(area.whole.area),
        clear_m2=float(area.clear.area),
        no_fly_m2=float(shapely.intersection(area.whole, area.keep_out).area),
        covered_share=share,
        fewest_looks=fewest if hidden else None,
        sites=len(sites),
        sites_in_rectangle=around[0] * around[1],
        sites_in_no_fly=in_zone,
        sites_enclosed=enclosed,
        rectangle_m=window.size_m,
        pitch_m=window.pitch_m,
        axis=tour.axis,
        length_m=total(way, float),
        shortest_m=shortest_m(sites, lattice.stride, points),
        simplified_m=area.simplified_m,
        projection_error=area.projection_error,
        notices=area.notices,
    )
    return result._replace(notices=result.notices + tuple(_losses(result, pattern.samples)))


class _Turn:
    """Conversion between (east, north) and (x along the heading, y to its right)."""

    def __init__(self, heading_deg: float) -> None:
        self.axis = heading_axis(heading_deg)

    def shape(self, shape: Any) -> Any:
        """A shape in x and y."""
        return shapely.transform(shape, self._points)

    def _points(self, points: Points) -> Points:
        east, north = points.T
        return np.round(np.column_stack(turned(east, north, self.axis)), 7)

    def back(self, points: Points) -> tuple[Points, Points]:
        """Points in x and y, converted to east and north."""
        x, y = points.T
        return turned(x, y, self.axis)


def _window(pattern: Pattern, baseline_m: float, footprint_m: tuple[float, float]) -> RequiredGrid:
    """The window of a pattern.  It is refused if the footprint is smaller than the rectangle of the
    coverage rule.
    """
    window = window_of(pattern, (baseline_m, baseline_m * pattern.row_pitch))
    x, y = window.size_m
    if x > footprint_m[0] * (1.0 + 1e-9) or y > footprint_m[1] * (1.0 + 1e-9):
        most = min(
            footprint_m[0] / window.columns,
            footprint_m[1] / (window.rows * pattern.row_pitch),
        ) * pattern.longer_side  # fmt: skip
        raise InfeasibleError(
            f"images of {footprint_m[0]:.4g} x {footprint_m[1]:.4g} m are too small for an "
            f"area: a point must be in the photos from all {pattern.samples} sites around "
            f"it, and these sites extend over {x:.4g} x {y:.4g} m",
            f"give --max-aperture {math.floor(most * 100.0) / 100.0:g}, which may require "
            "a lower target, or use a camera with a wider field of view",
        )
    return window


def _check_size(shape: Any, cell_m: tuple[float, float], samples: int, max_sites: int) -> None:
    """Refuse an area that needs too many sites.

    The number of sites is estimated from lengths and areas, before any site is computed.
    """
    x_pitch, y_pitch = cell_m
    least = shape.area / (x_pitch * y_pitch)
    for part in shapely.get_parts(shape):
        x_low, y_low, x_high, y_high = shapely.bounds(part)
        least = max(least, (x_high - x_low) / x_pitch, (y_high - y_low) / y_pitch)
    # The Minkowski sum of two sets A and B of lattice points has at least |A| + |B| - 1 points.
    _refuse_more(math.ceil(least * (1.0 - 1e-9)) + samples - 1, max_sites, "at least ")


def _refuse_more(sites: int, max_sites: int, about: str) -> None:
    if sites > min(max_sites, MOST_SITES):
        bound = (
            f"{max_sites} that --max-sites allows"
            if max_sites <= MOST_SITES
            else f"{MOST_SITES} that one plan may have"
        )
        raise RequestError(
            f"the area needs {about}{sites} sites, more than the {bound}",
            f"give --max-sites {sites}, a smaller area, or --clear FILE for parts of the "
            "area without canopy"
            if sites <= MOST_SITES
            else f"a plan has at most {MOST_SITES} sites: divide the area, or fly higher",
        )


def _allowed(wanted: Whole, at_sites: CellLattice, zones: NoFlyZones) -> tuple[Whole, int, int]:
    """The sites that may be flown, the number of sites in zones, and the number of sites enclosed
    by zones.
    """
    if not zones:
        return wanted, 0, 0
    points = at_sites.middles(wanted)
    outside = ~zones.inside(points)
    sites = wanted[outside]
    if len(sites) == 0:
        raise InfeasibleError(
            f"all {len(wanted)} sites lie in no-fly zones",
            "give a smaller --buffer, or another area",
        )
    places = zones.enclosures(points[outside])
    names, counts = np.unique(places, return_counts=True)
    kept = sites[places == names[np.argmax(counts)]]
    return kept, len(wanted) - len(sites), len(sites) - len(kept)


def routed(points: Points, zones: NoFlyZones) -> tuple[Points, list[bool]]:
    """The points of the path through given points and around zones, and a mask of the points at
    which a photo is taken.
    """
    if not zones:
        return points, [True] * len(points)
    way: list[Points] = [points[:1]]
    photo = [True]
    crossing = np.flatnonzero(zones.cross(points[:-1], points[1:]))
    done = 1
    for leg in crossing.tolist():
        turns = zones.around(points[leg], points[leg + 1])
        # There is a path, because enclosed sites have been dropped before.
        assert turns is not None
        way += [points[done : leg + 1], np.array(turns).reshape(-1, 2)]
        photo += [True] * (leg + 1 - done) + [False] * len(turns)
        done = leg + 1
    way.append(points[done:])
    photo += [True] * (len(points) - done)
    return np.concatenate(way), photo


def _covered(
    sites: Whole,
    shapes: tuple[Any, Any],
    cells: tuple[CellRuns, CellRuns],
    window: RequiredGrid,
    lattices: tuple[CellLattice, CellLattice],
    image: tuple[int, int],
) -> tuple[float, int]:
    """Share of the area that the sites cover, and smallest number of sites around any point below
    canopy.
    """
    canopy, clear = shapes
    stride = lattices[0].stride
    placements = cells[0].numbers()
    count = site_counts(sites, placements, window, stride)
    lost = [
        (canopy, lattices[0], runs_of(placements[count < window.samples])),
        (clear, lattices[1], cells[1].without(seen_cells(runs_of(sites), image, stride))),
    ]
    missing = math.fsum(
        float(shapely.area(shapely.intersection(shape, lattice.boxes(unseen))).sum())
        for shape, lattice, unseen in lost
        if len(unseen.start)
    )
    whole = float(canopy.area + clear.area)
    return max(1.0 - missing / whole, 0.0), int(count.min())


def _losses(survey: Survey, samples: int) -> list[Message]:
    """Warnings about ground that is not covered because of no-fly zones."""
    if survey.covered_share == 1.0:
        return []
    lost = (1.0 - survey.covered_share) * survey.area_m2
    fewest = "" if survey.fewest_looks is None else f" (the worst place from {survey.fewest_looks})"
    enclosed = (
        f" and no-fly zones enclose {survey.sites_enclosed} further sites"
        if survey.sites_enclosed
        else ""
    )
    return [
        Message(
            "coverage_lost",
            f"{_area(lost)} of {_area(survey.area_m2)} m² ({100 * lost / survey.area_m2:.3g} "
            f"%) are seen from fewer than {samples} sites{fewest}, because "
            f"{survey.sites_in_no_fly} sites are in no-fly zones{enclosed}",
        )
    ]


def _area(area_m2: float) -> str:
    """Square metres as text without an exponent."""
    return f"{area_m2:,.0f}" if area_m2 >= 10.0 else f"{area_m2:.2g}"
