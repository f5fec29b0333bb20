"""Reading of mission files as missions."""

from __future__ import annotations

import os

from aosplan.errors import RequestError
from aosplan.mission.mission import Mission, Waypoints
from aosplan.postflight.positions_file import local_m, read_places


def read_mission_file(path: str) -> Mission:
    """Read the sites of a mission file at which a photo is taken, in flight order.

    East and north are relative to the first site, and heights are those of the file.  Speeds, holds
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
