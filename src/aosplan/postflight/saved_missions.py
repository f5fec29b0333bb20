"""Missions from a saved plan or a mission file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aosplan.mission.format import Format
    from aosplan.mission.mission import Mission

MISSION_ENDINGS = (".waypoints", ".plan", ".kmz", ".mavlink", ".csv")
"""Extensions of mission files.  A ``.csv`` file is one of Litchi, or it has latitudes and
longitudes.
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
        If the file is neither of these, or if it is a mission file and one of the formats is for
        autopilots.
    """
    if not path.lower().endswith(MISSION_ENDINGS):
        from aosplan.planning.saved_plan import read_missions

        return read_missions(path)
    from aosplan.postflight.mission_file import read_mission_file

    flown = [form.title for form in chosen if form.flown_by]
    if flown:
        raise RequestError(
            f"'{path}' is a mission file, and only its sites are read: {flown[0]} needs speeds "
            "and the camera too",
            "write .csv, .geojson or .kml, or export the plan.json that the mission is from",
        )
    return (read_mission_file(path),)
