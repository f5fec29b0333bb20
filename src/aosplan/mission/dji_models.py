"""The numbers that identify drones and cameras in DJI's files.

Source: the product support page of the DJI Cloud API documentation, version 1.14 and as of March
2026.  The DJI WPML documentation refers to this page.  There, the numbers of aircraft are in the
columns type and sub_type, and the numbers of cameras are in the column type.
"""

from __future__ import annotations

from typing import NamedTuple

from aosplan.errors import RequestError


class DjiDrone(NamedTuple):
    """A drone: its droneEnumValue and droneSubEnumValue, and the name of its built-in camera."""

    number: int
    variant: int
    payload: str | None


DRONES = {
    "dji-m300": DjiDrone(60, 0, None),
    "dji-m350": DjiDrone(89, 0, None),
    "dji-m400": DjiDrone(103, 0, None),
    "dji-m30": DjiDrone(67, 0, "dji-m30"),
    "dji-m30t": DjiDrone(67, 1, "dji-m30t"),
    "dji-m3e": DjiDrone(77, 0, "dji-m3e"),
    "dji-m3t": DjiDrone(77, 1, "dji-m3t"),
    "dji-m3m": DjiDrone(77, 2, "dji-m3m"),
    "dji-m3d": DjiDrone(91, 0, "dji-m3d"),
    "dji-m3td": DjiDrone(91, 1, "dji-m3td"),
    "dji-m4e": DjiDrone(99, 0, "dji-m4e"),
    "dji-m4t": DjiDrone(99, 1, "dji-m4t"),
    "dji-m4d": DjiDrone(100, 0, "dji-m4d"),
    "dji-m4td": DjiDrone(100, 1, "dji-m4td"),
}
"""Drones that fly DJI WPML missions."""

PAYLOADS = {
    "dji-h20": 42,
    "dji-h20t": 43,
    "dji-h20n": 61,
    "dji-h30": 82,
    "dji-h30t": 83,
    "dji-m30": 52,
    "dji-m30t": 53,
    "dji-m3e": 66,
    "dji-m3t": 67,
    "dji-m3m": 68,
    "dji-m3d": 80,
    "dji-m3td": 81,
    "dji-m4e": 88,
    "dji-m4t": 89,
    "dji-m4d": 98,
    "dji-m4td": 99,
}
"""payloadEnumValue of cameras, by name."""


def check_carried(drone: str, payload: str) -> None:
    """Refuse a payload that a drone cannot carry.

    Raises
    ------
    RequestError
        If the drone has another built-in camera, if the payload is built into another drone, or if
        the drone is not a DJI drone that carries payloads.
    """
    known = DRONES.get(drone)
    own = None if known is None else known.payload
    if known is None or (payload != own and (own is not None or payload in DRONES)):
        raise RequestError(
            f"the drone {drone} does not carry {payload}",
            "leave --payload out, or give another --drone"
            if known is None or own is not None
            else "give another --payload",
        )
