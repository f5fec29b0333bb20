"""Plain grids that are compared with guided positions. They are above the same place and take at
most the same time.

The grids are lanes, single lines, squares and trimmed grids along the heading, on the lattice of the
candidates and around the middle of the target area, with photos at stops or while flying.  Their
rows, columns and spacings are chosen with the same half of the pulses as the guided positions.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.errors import AosplanError
from aosplan.flight.kinematics import path_of
from aosplan.flight.track import FlightPoints
from aosplan.grid.patterns import Pattern, pattern_for
from aosplan.planning.guided_result import PlainFlight
from aosplan.planning.options import DEFAULTS
from aosplan.planning.route import speed_bounds
from aosplan.planning.sites import Layout, route_of
from aosplan.planning.within_result import PHOTO_INTERVAL_S

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from aosplan.models.place import PlaceModel
    from aosplan.planning.guided_candidates import Candidates
    from aosplan.planning.resolve import PlanInputs
    from aosplan.planning.route import FlightInputs
    from aosplan.planning.target_area import TargetArea

    Floats = NDArray[np.float64]

MOST_ROWS = 6
"""Largest number of lanes."""

MOST_STEPS = 8
"""Largest spacing of a grid, in steps of the lattice."""

MOST_SAMPLES = 100
TRIES = 20
"""Largest number of grids of a kind whose flight time is computed. The grids are tried in order of
decreasing visibility until one fits into the time.
"""


class _Grid(NamedTuple):
    """A grid on the lattice, and its spacing along the heading in steps."""

    kind: str
    pattern: Pattern
    along: int


def plain_flights(
    inputs: PlanInputs,
    area: TargetArea,
    candidates: Candidates,
    joint: Floats,
    longest_s: float,
    model: PlaceModel,
    dense: PlaceModel,
) -> tuple[PlainFlight, ...]:
    """Find the best grid of each kind within a given time. The grids are ordered by visibility, the
    highest first.

    Parameters
    ----------
    inputs
        The inputs of the plan.
    area
        The target area.
    candidates
        The lattice of positions.
    joint
        J of all pairs of candidates, from the half of the pulses with which positions are chosen.
    longest_s
        Longest allowed time from take-off to landing.
    model, dense
        Model from the other half of the pulses, and model with dense foliage wherever no pulse has
        passed.
    """
    low, high = area.bounds_m(inputs.heading_deg)
    middle = 0.5 * (low + high) / candidates.step_m
    grids = [
        (1.0 - float(joint[np.ix_(sites, sites)].mean()), grid, sites)
        for grid, sites in _grids(candidates, middle)
    ]
    found = []
    for trigger in ("stop", "distance"):
        flown = inputs._replace(flight=_triggered(inputs, trigger))
        for kind in dict.fromkeys(grid.kind for _, grid, _ in grids):
            chosen = _best(
                flown,
                area.origin,
                candidates,
                [each for each in grids if each[1].kind == kind],
                longest_s,
            )
            if chosen is not None:
                grid, sites, time_s = chosen
                points, along_m = candidates.points_m[sites], grid.along * candidates.step_m
                found.append(
                    PlainFlight(
                        kind,
                        trigger,
                        grid.pattern,
                        (along_m, along_m * grid.pattern.row_pitch),
                        time_s,
                        model.predict_positions(points),
                        dense.predict_positions(points).expected,
                        model.unseen_share(points),
                    )
                )
    return tuple(sorted(found, key=lambda each: -each.prediction.expected))


def _triggered(inputs: PlanInputs, trigger: str) -> FlightInputs:
    """Settings of the flight for photos at stops or while flying."""
    flight = inputs.flight
    if trigger == flight.trigger:
        return flight
    blur = DEFAULTS["max_blur"], DEFAULTS["exposure_time"]
    return flight._replace(
        trigger=trigger,
        photo_interval_s=flight.photo_interval_s or PHOTO_INTERVAL_S,
        speed_bounds=speed_bounds(flight.drone, blur, inputs.camera.gsd_m(inputs.altitude_m)),
    )


def _grids(candidates: Candidates, middle: Floats) -> Iterator[tuple[_Grid, NDArray[np.intp]]]:
    """Yield all grids around the middle of the target area, with the indices of their sites in
    flight order.
    """
    low = candidates.places.min(axis=0)
    columns, rows = (np.ptp(candidates.places, axis=0) + 1).tolist()
    index = np.full((rows, columns), -1, dtype=np.intp)
    x, y = (candidates.places - low).T
    index[y, x] = np.arange(len(x))

    x_middle, y_middle = (middle - low).tolist()
    for grid in _on_lattice(rows, columns):
        pattern = grid.pattern
        across = round(grid.along * pattern.row_pitch)
        x_first = round(x_middle - 0.5 * grid.along * (pattern.columns - 1))
        y_first = round(y_middle - 0.5 * across * (pattern.rows - 1))
        x_last = x_first + grid.along * (pattern.columns - 1)
        y_last = y_first + across * (pattern.rows - 1)
        if min(x_first, y_first) < 0 or x_last >= columns or y_last >= rows:
            continue
        row, column = np.array(list(pattern.sites())).T
        sites = index[y_first + across * row, x_first + grid.along * column]
        if (sites >= 0).all():
            yield grid, sites


def _on_lattice(rows: int, columns: int) -> Iterator[_Grid]:
    """Grids that fit into a number of rows and columns of the lattice."""
    steps = range(1, MOST_STEPS + 1)
    for across, count, step in itertools.product(steps, range(1, MOST_ROWS + 1), steps):
        if (count == 1 and across > 1) or across * (count - 1) >= rows:
            continue
        most = min(MOST_SAMPLES // count, (columns - 1) // step + 1)
        kind = "line" if count == 1 else "lanes"
        for number in range(2, most + 1):
            if (number, step) != (count, across):  # Squares have their own kind.
                yield _Grid(kind, Pattern(count, number, across / step), step)
    for kind, samples in itertools.product(("square", "trimmed"), range(2, MOST_SAMPLES + 1)):
        pattern = pattern_for(kind, samples)
        assert isinstance(pattern, Pattern)  # Only spirals have another type.
        if pattern.samples == samples and (kind == "square" or pattern.removed):
            yield from (_Grid(kind, pattern, step) for step in steps)


def _best(
    inputs: PlanInputs,
    origin: tuple[float, float],
    candidates: Candidates,
    grids: list[tuple[float, _Grid, NDArray[np.intp]]],
    longest_s: float,
) -> tuple[_Grid, NDArray[np.intp], float] | None:
    """Find the grid with the highest visibility whose flights take at most `longest_s`; None if no
    grid does.
    """
    timing = inputs.flight.timing(inputs.heading_deg)

    def path_s(grid: _Grid) -> float:
        return path_of(grid.pattern, timing).time_s(grid.along * candidates.step_m, timing)

    # The paths from the take-off point and back to it take about the same time for all grids of a
    # kind.
    ways_s, tried = 0.0, 0
    for _, grid, sites in sorted(grids, key=lambda each: -each[0]):
        if path_s(grid) + ways_s > longest_s:
            continue
        tried += 1
        if tried > TRIES:
            return None
        east, north = candidates.points_m[sites].T.tolist()
        layout = Layout(FlightPoints(east, north, [True] * len(east)), origin)
        try:
            time_s = route_of(inputs, layout, grid.along * candidates.step_m).total_time_s
        except AosplanError:  # a line that needs too long a run-in, or a battery that is too small
            continue
        if time_s <= longest_s * (1.0 + 1e-9):
            return grid, sites, time_s
        ways_s = 0.9 * (time_s - path_s(grid))
    return None
