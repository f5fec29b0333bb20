"""Missions from a saved plan or a mission file."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from aosplan.errors import RequestError
from aosplan.mission.mission import Mission, Waypoints
from aosplan.postflight.positions_file import local_m, read_places

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aosplan.mission.format import Format

MISSION_ENDINGS = (".waypoints", ".plan", ".kmz", ".mavlink", ".csv")
"""Extensions of mission files. A ``.csv`` file is a mission of Litchi, or a table with latitudes
and longitudes.
"""


def read_saved_missions(path: str, chosen: Sequence[Format]) -> tuple[Mission, ...]:
    """Read the missions of a saved plan, or the sites of a mission file.

    Sites of a mission file can only be converted to formats that are not for autopilots.

    Parameters
    ----------
    path
        Output of ``aosplan plan --json``, or a mission file (`MISSION_ENDINGS`).
    chosen
        The formats to write.

    Raises
    ------
    RequestError
        If the file is neither a saved plan nor a mission file, or if it is a mission file and one
        of the formats is for autopilots.
    """
    if not path.lower().endswith(MISSION_ENDINGS):
        from aosplan.planning.saved_plan import read_missions

        return read_missions(path)
    flown = [form.title for form in chosen if form.flown_by]
    if flown:
        raise RequestError(
            f"'{path}' is a mission file, of which only the sites are read, but {flown[0]} "
            "also needs speeds and the camera",
            "write .csv, .geojson or .kml, or export the plan.json from which the mission "
            "was written",
        )
    return (read_mission_file(path),)


def read_mission_file(path: str) -> Mission:
    """Read the sites of a mission file at which a photo is taken, in flight order.

    East and north are relative to the first site. Heights are taken from the file. Speeds, holds
    and other settings of the flight are not read.

    Raises
    ------
    RequestError
        If the file cannot be read, or if a site has no height.
    """
    places = read_places(path)
    east, north = local_m(places, places[0][:2], path, "the first")
    heights = [place.altitude_m for place in places]
    known = [height for height in heights if height is not None]
    if len(known) < len(heights):
        raise RequestError(f"'{path}': site {heights.index(None)} has no height")
    ways = Waypoints(
        east, north, known, [each.latitude for each in places], [each.longitude for each in places]
    )
    return Mission(ways, {"source": os.path.basename(path)})
