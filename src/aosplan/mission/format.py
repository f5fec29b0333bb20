"""Description of a format of mission files: its name, its limits and what it requires."""

from __future__ import annotations

from typing import NamedTuple


class Limits(NamedTuple):
    """Smallest and largest values that a target accepts in one file; None if a bound is not known.

    The limits of heights apply to the heights in the file. `source` names the publication of the
    numbers. `waypoints` is the largest number of waypoints or of commands in a file. `unit` says
    which of the two is counted.
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
    """A format: its name and extensions, and what it requires.

    - `altitudes`: the possible references of the altitudes
    - `limits`: limits of a file for each target that reads it, the usual target first
    - `flown_by`: autopilots that fly this format; empty if the files are not for autopilots
    - `triggers`: the possible ways to trigger photos
    - `asks_drone`: whether the format is written only for a drone that is known to fly it
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
        """How an output of this format is written on the command line."""
        return self.suffixes[0] if self.suffixes else f"{self.name}:FILE"
