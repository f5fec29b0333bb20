"""Finding a drone by preset name or file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.errors import RequestError
from aosplan.files import is_file_name
from aosplan.units import preset_hint

if TYPE_CHECKING:
    from aosplan.flight.drones import DronePreset


def find_drone(name: str) -> DronePreset:
    """A drone from a preset, a file, or another installed distribution (``aosplan.drones``).

    Raises
    ------
    RequestError
        If there is no such drone; the hint lists presets with similar names.
    """
    from aosplan.flight.drones import DRONES, DronePreset

    if name in DRONES:
        return DRONES[name]
    if is_file_name(name):
        from aosplan.flight.drone_file import read_drone

        return read_drone(name)
    from aosplan.plugins import plugin

    added = plugin("aosplan.drones", name)
    if isinstance(added, DronePreset):
        return added
    raise RequestError(
        f"unknown drone '{name}'",
        preset_hint(name, {each: drone.title for each, drone in DRONES.items()})
        or "aosplan drones lists them; a file name ends in .toml",
    )
