"""Numbers of drones and cameras in DJI's files.

Source: DJI Cloud API documentation, 1.14 and as of March 2026, product support (type and sub_type of aircraft, type of
cameras), as DJI WPML refers to it.
"""

from __future__ import annotations

from typing import NamedTuple


class Drone(NamedTuple):
    """droneEnumValue and droneSubEnumValue, and the name of the built-in camera."""

    number: int
    variant: int
    payload: str | None


DRONES = {
    "dji-m300": Drone(60, 0, None),
    "dji-m350": Drone(89, 0, None),
    "dji-m400": Drone(103, 0, None),
    "dji-m30": Drone(67, 0, "dji-m30"),
    "dji-m30t": Drone(67, 1, "dji-m30t"),
    "dji-m3e": Drone(77, 0, "dji-m3e"),
    "dji-m3t": Drone(77, 1, "dji-m3t"),
    "dji-m3m": Drone(77, 2, "dji-m3m"),
    "dji-m3d": Drone(91, 0, "dji-m3d"),
    "dji-m3td": Drone(91, 1, "dji-m3td"),
    "dji-m4e": Drone(99, 0, "dji-m4e"),
    "dji-m4t": Drone(99, 1, "dji-m4t"),
    "dji-m4d": Drone(100, 0, "dji-m4d"),
    "dji-m4td": Drone(100, 1, "dji-m4td"),
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
