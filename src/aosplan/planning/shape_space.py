"""The shapes of grids that a request allows.

A shape is described by two shares, one along and one across the heading. A *share* is the spacing
divided by the widest spacing. With the widest spacing, a target is just inside all images of its
grid. See `aosplan.planning.within`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.planning.within_shapes import Shape

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.planning.request import PlanRequest

MOST_ROWS = 16
"""Largest number of rows of a grid that is tried."""

STEP = 0.92
"""Factor between neighbouring shares."""


class ShapeSpace:
    """The shapes that a request allows.

    Parameters
    ----------
    request
        The request.
    altitude_m
        The highest altitude that is allowed, above the focal plane.
    view
        Size of the footprint along and across the heading, divided by the altitude.
    over_area
        Whether the plan covers an area instead of a single place.
    most_samples
        Largest number of photos that see a point.
    """

    def __init__(
        self,
        request: PlanRequest,
        altitude_m: float,
        view: tuple[float, float],
        *,
        over_area: bool,
        most_samples: int,
    ) -> None:
        self.request = request
        self.altitude_m = altitude_m
        self.view = view
        self.over_area = over_area
        self.most_samples = most_samples

    @property
    def rows(self) -> range:
        """Numbers of rows that are allowed."""
        request = self.request
        if request.grid == "line":
            return range(1, 2)
        if isinstance(request.lanes, int):
            return range(request.lanes, request.lanes + 1)
        fewest = 1 if request.grid == "best" else 2
        return range(fewest, min(MOST_ROWS, self.most_samples) + 1)

    def filled(self, shape: Shape) -> tuple[float, float]:
        """The two shares of a shape, along and across the heading."""
        x, y = self._room(shape.rows, shape.columns)
        return shape.along / x, shape.across / y

    def shape(self, rows: int, columns: int, along: float, across: float) -> Shape | None:
        """The shape with given shares; None if its lines would be too close together."""
        x, y = self._room(rows, columns)
        x, y = x * along, y * across
        request = self.request
        if min(x, y) <= 0.0:
            return None
        if request.baseline is not None:
            asked = request.baseline / self.altitude_m
            if asked > x * (1.0 + 1e-9):
                return None
            x = asked
        if rows == 1 and not self.over_area:
            return Shape(rows, columns, x, x)
        x = min(x, y) if request.baseline is None else x
        if isinstance(request.lane_pitch, float):
            if request.baseline is None:
                x = min(x, y / request.lane_pitch)
            if x * request.lane_pitch > y * (1.0 + 1e-9):
                return None
            y = x * request.lane_pitch
        return Shape(rows, columns, x, y) if y >= x else None

    def neighbours(self, shape: Shape) -> Iterator[Shape]:
        """Neighbouring shapes: with one row or column more or less, or with spacings that are one
        step larger or smaller.
        """
        x, y = self.filled(shape)
        steps = (STEP, 1.0, 1.0 / STEP)
        shares = (
            (min(along * x, 1.0), min(across * y, 1.0)) for along in steps for across in steps
        )
        wanted = [(shape.rows, shape.columns, *share) for share in shares]
        wanted += [
            (shape.rows + rows, shape.columns + columns, x, y)
            for rows in (-1, 0, 1)
            for columns in (-1, 0, 1)
        ]
        for rows, columns, *share in dict.fromkeys(wanted):
            asked = self.request.samples
            if rows not in self.rows or columns < 1 or asked not in (None, rows * columns):
                continue
            if rows * columns <= max(self.most_samples, asked or 0):
                found = self.shape(rows, columns, *share)
                if found is not None and found != shape:
                    yield found

    def _room(self, rows: int, columns: int) -> tuple[float, float]:
        """The widest spacings along and across the heading at which a target is inside all
        images.
        """
        (x, y), bound = self.view, self.request.max_aperture
        # For every point to have a complete grid around it, the images have to be one pitch larger
        # than the grid.
        if self.over_area:
            along, across = x / columns, y / rows
        else:
            from aosplan.planning.option_parsers import PERSON, target_m

            side = max(target_m(self.request.find or PERSON)) / self.altitude_m
            along = (x - side) / max(columns - 1, 1)
            across = (y - side) / max(rows - 1, 1)
        if bound is not None:
            along = min(along, bound / self.altitude_m / max(columns - 1, 1))
            across = min(across, bound / self.altitude_m / max(rows - 1, 1))
        return along, across
