"""Recorded views: positions of photos from any source, converted to the coordinates of a plan."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.errors import RequestError
from aosplan.messages import Message
from aosplan.models.model import Prediction
from aosplan.numerics import heading_axis, turned
from aosplan.postflight.positions_file import (
    ALTITUDES,
    NAMES_M,
    PLACE_NAMES,
    SUFFIXES,
    Place,
    local_m,
    places_of,
    positions_of,
    read_csv,
    read_places,
)
from aosplan.units import number

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from aosplan.planning.result import Plan


class Views(NamedTuple):
    """Photos with their positions (on earth or in metres) and other data of their source.

    `header` and `rows` are the columns of the source. For a folder, `rows` has the names of the
    photos. `unplaced` has the names of photos without a position. For some of these photos,
    `doubtful` has the reason. `paired` has the photos that are left out because another photo of
    the same shot is used.
    """

    path: str
    header: list[str]
    rows: list[list[str]]
    places: list[Place] | None
    positions_m: list[tuple[float, float]]
    altitudes_m: list[float | None]
    is_folder: bool = False
    unplaced: tuple[str, ...] = ()
    doubtful: Mapping[str, str] = {}
    paired: Mapping[str, str] = {}

    def __len__(self) -> int:
        return len(self.rows)

    def name(self, index: int) -> str | None:
        """Name of a photo, if it has one.  Characters that are not Unicode are replaced by question
        marks.
        """
        return _readable(self.rows[index][0]) if self.is_folder else None

    def middle(self, heading_deg: float) -> tuple[float, float]:
        """Latitude and longitude of the centre of a rectangle around all places.  The rectangle is
        parallel to a heading.
        """
        from aosplan.geodesy import to_wgs84

        assert self.places is not None  # This method is called only for views with places.
        first = self.places[0][:2]
        points = along_heading(*local_m(self.places, first, self.path, "the first"), heading_deg)
        x, y = 0.5 * (points.min(axis=0) + points.max(axis=0))
        east, north = turned(x, y, heading_axis(heading_deg))
        (latitude,), (longitude,) = to_wgs84(first, [east], [north])
        return latitude, longitude

    def local_m(self, origin: tuple[float, float] | None) -> tuple[list[float], list[float]]:
        """Positions in metres east and north of an origin.  Positions that are already in metres
        are returned unchanged.
        """
        if self.places is None:
            east, north = zip(*self.positions_m, strict=True)
            return list(east), list(north)
        assert origin is not None  # The caller gives an origin if the views have places.
        return local_m(self.places, origin, self.path, "the plan's origin")

    def messages(self) -> Iterator[Message]:
        """Yield warnings about views that are missing or left out."""
        if self.paired:
            name, other = next(iter(self.paired.items()))
            count = len(self.paired)
            yield Message(
                "paired_photos",
                f"{count} photo{'s' * (count > 1)} taken at the same time as another photo "
                f"{'are' if count > 1 else 'is'} not counted: {_readable(name)} with "
                f"{_readable(other)}{' ...' * (count > 1)}",
            )
        if self.doubtful:
            name, why = next(iter(self.doubtful.items()))
            count = len(self.doubtful)
            yield Message(
                "doubtful_positions",
                f"{count} photo{'s' * (count > 1)} with an ambiguous position "
                f"{'are' if count > 1 else 'is'} not used: {_readable(name)} {why}",
            )
        silent = [name for name in self.unplaced if name not in self.doubtful]
        if silent:
            named = ", ".join(map(_readable, silent[:5]))
            named += " ..." if len(silent) > 5 else ""
            count = len(silent)
            yield Message(
                "photos_without_position",
                f"{count} photo{'s have' if count > 1 else ' has'} no position: {named}",
            )


def read_views(path: str, *, on_earth: bool) -> Views:
    """Read views from a folder of photos, a mission, ``.geojson`` or a CSV.

    Parameters
    ----------
    path
        The folder or file.
    on_earth
        Whether latitudes and longitudes are used if a CSV has both these and positions in metres.

    Raises
    ------
    RequestError
        If there are no positions, or if a position cannot be read.  The message gives its place.
    """
    if os.path.isdir(path):
        from aosplan.postflight.photo_positions import read_photos

        photos = read_photos(path)
        placed = {name: place for name, place in photos.places.items() if place is not None}
        return _views(
            path,
            ["name"],
            [[name] for name in placed],
            list(placed.values()),
            is_folder=True,
            unplaced=tuple(name for name in photos.places if name not in placed),
            doubtful=photos.doubtful,
            paired=photos.paired,
        )
    if os.path.splitext(path)[1].lower() in (*SUFFIXES, ".json"):
        places = read_places(path)
        rows = [["" if value is None else repr(value) for value in place] for place in places]
        return _views(path, [PLACE_NAMES[0][0], PLACE_NAMES[0][1], ALTITUDES[0]], rows, places)
    table = read_csv(path)
    # If the table has neither of the two pairs of columns, this call raises an error that names
    # both pairs.
    table.columns((*PLACE_NAMES, *NAMES_M))
    rows = [row for _, row in table.rows]
    if table.pair(PLACE_NAMES) and (on_earth or not table.pair(NAMES_M)):
        return _views(path, table.header, rows, places_of(table))
    altitudes = [
        number(values[2], f"{where} altitude") if len(values) > 2 else None
        for where, values in table.columns(NAMES_M, ALTITUDES)
    ]
    positions = positions_of(table)
    _check_some(path, positions)
    return Views(path, table.header, rows, None, positions, altitudes)


def _readable(name: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in name)


def _views(
    path: str,
    header: list[str],
    rows: list[list[str]],
    places: list[Place],
    *,
    is_folder: bool = False,
    **photos: Any,
) -> Views:
    _check_some(path, places)
    altitudes = [place.altitude_m for place in places]
    return Views(path, header, rows, places, [], altitudes, is_folder, **photos)


def _check_some(path: str, found: Sequence[object]) -> None:
    if not found:
        raise RequestError(f"'{path}' contains no positions")


def along_heading(east_m: ArrayLike, north_m: ArrayLike, heading_deg: float) -> NDArray[np.float64]:
    """Positions as coordinates along a heading and to its right, shape (N, 2)."""
    east, north = np.asarray(east_m, dtype=np.float64), np.asarray(north_m, dtype=np.float64)
    return np.column_stack(turned(east, north, heading_axis(heading_deg)))


def in_axes(plan: Plan, east_m: ArrayLike, north_m: ArrayLike) -> NDArray[np.float64]:
    """Positions along the axes of a plan's model, shape (N, 2).

    For a measured stand, these axes are east and north.  For uniform and layered scenes, they are
    the axes of the plan.
    """
    if plan.problem is not None and plan.problem.model.heading_deg is not None:
        return np.column_stack([east_m, north_m])
    return along_heading(east_m, north_m, plan.heading_deg)


def predicted(plan: Plan, points_m: NDArray[np.float64]) -> Prediction:
    """Prediction of a plan's model for views at exactly these positions, in the axes of the model."""
    if plan.problem is None:
        return Prediction(0.0, 1.0, 1.0 / len(points_m))
    return plan.problem.model.predict_positions(points_m)
