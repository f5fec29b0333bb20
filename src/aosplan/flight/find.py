"""Find a drone by the name of a preset or the path of a file."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from aosplan.flight.drones import DronePreset


def find_drone(name: str) -> DronePreset:
    """A drone from a preset, a file, or another installed distribution (``aosplan.drones``).

    Raises
    ------
    RequestError
        If no preset or file has this name.  The hint lists presets with similar names.
    """
    from aosplan.flight.drones import DRONES

    if name in DRONES:
        return DRONES[name]
    from aosplan.files import is_file_name
    from aosplan.plugins import added_preset

    if is_file_name(name):
        from aosplan.flight.drone_file import read_drone

        return read_drone(name)
    return added_preset("drone", name, DRONES)
