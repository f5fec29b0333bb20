"""What a format of mission files is called, and what it needs."""

from __future__ import annotations

from typing import NamedTuple


class Limits(NamedTuple):
    """What a target takes in one file, from least to most; None: no bound is known.

    Heights are those that the file says; `source` tells where the numbers stand.  `waypoints` counts
    waypoints of the file, or all its commands, as `unit` says.
    """

    target: str = ""
    unit: str = "waypoints"
    waypoints: tuple[int, int | None] = (1, None)
    leg_m: tuple[float, float | None] = (0.0, None)
    speed_mps: tuple[float, float | None] = (0.0, None)
    height_m: tuple[float | None, float | None] = (None, None)
    hold_s: tuple[float, float | None] = (0.0, None)
    source: str = ""


class Format(NamedTuple):
    """What a format is called, which endings it serves, and what it needs.

    `altitudes` says what its altitudes are above; `limits` what a file may hold, by the target
    that reads it, the usual one first; `flown_by` which autopilots fly it, empty for files that
    are not flown; `triggers` how its photos may be taken.  With `asks_drone` it is written only
    for a drone that says that it flies the format.
    """

    name: str
    suffixes: tuple[str, ...]
    title: str
    needs_place: bool
    altitudes: str = "ground"
    limits: tuple[Limits, ...] = (Limits(),)
    flown_by: tuple[str, ...] = ()
    triggers: tuple[str, ...] = ("stop", "distance")
    asks_drone: bool = False

    @property
    def written_as(self) -> str:
        """How an output of this format is named on the command line."""
        return self.suffixes[0] if self.suffixes else f"{self.name}:FILE"
