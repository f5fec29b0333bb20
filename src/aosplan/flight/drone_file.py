"""Drone files: speeds, limits and camera in TOML or JSON."""

from __future__ import annotations

import os
from typing import Annotated, Literal

from pydantic import Field

from aosplan.files import located, read_table
from aosplan.flight.drones import DronePreset
from aosplan.validation import Document, Finite, Words, checked

Above = Annotated[Finite, Field(gt=0)]


class DroneDocument(Document):
    """A drone file.  Its names are the fields of `DronePreset`."""

    title: str
    speed_mps: Above
    acceleration_mps2: Above
    climb_mps: Above
    airspeed_mps: Above
    endurance_min: Above | None = None
    most_waypoints: Annotated[int, Field(ge=2)] | None = None
    camera: str | None = None
    photo_interval_s: Above | None = None
    mission_formats: Words = ()
    source: str = ""
    assumed: str = ""
    autopilot: Literal["px4", "ardupilot", "dji", "autel", "parrot"]


def read_drone(path: str) -> DronePreset:
    """Read a drone from a TOML or JSON file.

    Raises
    ------
    RequestError
        If the file is not valid.  The message names the file and the place in it.
    """
    values = checked(DroneDocument, read_table(path), path).model_dump()
    if values["camera"] is not None:
        values["camera"] = located(values["camera"], os.path.dirname(path))
    return DronePreset(**values)
