"""Conversion of missions to files: finds a format by its name, and returns the bytes of each file.

A format is a module in `aosplan.mission.formats` with a `FORMAT` and a pure function
``render(mission) -> bytes``, which returns the same bytes for the same mission.
"""

from __future__ import annotations

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

from aosplan.errors import RequestError
from aosplan.mission.limits import check_flown, split_for_limits
from aosplan.plugins import plugin, plugins
from aosplan.units import nearest_hint

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from aosplan.mission.format import Format
    from aosplan.mission.mission import Mission


MODULES = {
    "autel": "autel",
    "csv": "csv",
    "dji-fly": "dji_fly",
    "geojson": "geojson",
    "kml": "kml",
    "kmz": "wpml",
    "litchi": "litchi",
    "parrot": "parrot",
    "plan": "qgc_plan",
    "waypoints": "ardupilot",
}
"""Module names in `aosplan.mission.formats` by format name."""

FORMER = {"qgc_plan": "plan", "wpml": "kmz"}
"""Format names from before version 0.2, which are still accepted."""


GROUP = "aosplan.formats"
"""Group of the entry points with which other distributions add formats. Each entry point is a
module like the modules of the built-in formats.
"""


def formats() -> dict[str, Format]:
    """All formats by name, in alphabetical order."""
    return {name: _module(name).FORMAT for name in MODULES}


def choose_format(path: str, name: str | None = None) -> tuple[Format, str]:
    """The format and path of an output.  The format is given by its name, by ``NAME:PATH``, or by
    the extension of the file.

    Raises
    ------
    RequestError
        If no format with this name or extension is known.
    """
    known = formats()
    name = FORMER.get(name or "", name)
    prefix, colon, rest = path.partition(":")
    prefix = FORMER.get(prefix, prefix)
    if colon and prefix not in known and _may_be_added(prefix):
        known |= _added(prefix)
    if colon and prefix in known:
        if name not in (None, prefix):
            raise RequestError(f"output '{path}' and --format {name} contradict each other")
        name, path = prefix, rest
    if not path:
        raise RequestError("the name of an output file is empty")
    if name is not None:
        known |= {} if name in known else _added(name)
        if name not in known:
            raise RequestError(
                f"unknown format '{name}'", nearest_hint(name, known) or _listing(known)
            )
        return known[name], path
    suffix = os.path.splitext(path)[1].lower()
    for candidate in known.values():
        if suffix in candidate.suffixes:
            return candidate, path
    for added in plugins(GROUP).values() if suffix else ():
        if suffix in added.FORMAT.suffixes:
            return _format_of(added), path
    if path == "-":
        raise RequestError(
            "output '-' (stdout) has no extension", "give --format NAME, or --out NAME:-"
        )
    hint = (
        f"to write a page about the plan, give --report {path}"
        if suffix == ".html"
        else _listing(known)
    )
    raise RequestError(f"output '{path}': no format has the extension '{suffix}'", hint)


def render(mission: Mission, chosen: Format) -> bytes:
    """The bytes of a mission in a format.  This function does not check the limits of the target.

    Raises
    ------
    RequestError
        If the format needs a location and the mission has no location, if the format cannot express
        the flight settings, or if the autopilot of the mission does not fly this format.
    """
    if chosen.needs_place and not mission.has_place:
        raise RequestError(
            f"{chosen.title} needs a location",
            "plan with --origin LAT,LON or --area FILE, or write CSV",
        )
    check_flown(mission, chosen)
    autopilot = mission.settings.autopilot
    if chosen.flown_by and autopilot is not None and autopilot not in chosen.flown_by:
        own = [form for form in formats().values() if autopilot in form.flown_by]
        whose = f"the drone {mission.settings.drone}" if mission.settings.drone else autopilot
        raise RequestError(
            f"the format {chosen.title} cannot be used for {whose}",
            f"write {' or '.join(f'{form.title} ({form.written_as})' for form in own)}"
            if own
            else "aosplan has no mission format for this autopilot; write KML, GeoJSON or CSV",
        )
    write: Callable[[Mission], bytes] = _module(chosen.name).render
    return write(mission)


def mission_files(missions: Iterable[Mission], chosen: Format, path: str) -> dict[str, bytes]:
    """Contents of the files of some missions, by path.  There is one file, or there are several
    numbered files.

    ``grid.plan`` becomes ``grid-1.plan``, ``grid-2.plan`` and so on if there are several missions,
    or if a mission is too large for one file.

    Raises
    ------
    RequestError
        If a mission exceeds a limit even after splitting, or if several files would be written to
        stdout.
    """
    pieces = [
        piece
        for mission in missions
        for piece in (
            split_for_limits(mission, chosen, size_of(chosen))
            if mission.has_place and chosen.flown_by
            else [mission]
        )
    ]
    if len(pieces) == 1:
        return {path: render(pieces[0], chosen)}
    if path == "-":
        raise RequestError(
            f"the mission needs {len(pieces)} {chosen.title} files, but only one file can be "
            "written to stdout",
            "give a file name, to which numbers are added",
        )
    stem, suffix = os.path.splitext(path)
    return {
        f"{stem}-{number}{suffix}": render(piece, chosen) for number, piece in enumerate(pieces, 1)
    }


def size_of(chosen: Format) -> Callable[[Mission], int]:
    """Function that counts the items whose number the format limits: points of the path, or
    commands of the file.
    """
    from aosplan.mission.flown_path import path_size

    count: Callable[[Mission], int] = getattr(_module(chosen.name), "size", path_size)
    return count


def notes(missions: Sequence[Mission], chosen: Format) -> list[str]:
    """Assumptions that a format makes about the missions of a plan, one sentence each."""
    write_notes: Callable[[Sequence[Mission]], list[str]] | None = getattr(
        _module(chosen.name), "notes", None
    )
    found = write_notes(missions) if write_notes else []
    drone, flown = missions[0].settings.drone, missions[0].settings.mission_formats
    if chosen.flown_by and flown is not None and chosen.name not in flown:
        known = f"; it flies {' and '.join(flown)}" if flown else ""
        found.insert(0, f"it is not known whether the drone {drone} flies this format{known}")
    return [f"{chosen.title}: {note}" for note in found]


def _module(name: str) -> Any:
    if name not in MODULES:
        return plugin(GROUP, name)
    return import_module(f"aosplan.mission.formats.{MODULES[name]}")


def _may_be_added(prefix: str) -> bool:
    """Whether the text before a colon can be a format name. It may instead be a drive or a part of
    a path.
    """
    return len(prefix) > 1 and prefix.replace("-", "").isalnum()


def _added(name: str) -> dict[str, Format]:
    """The format that another distribution adds under this name; None if there is no such
    format.
    """
    module = plugin(GROUP, name)
    return {} if module is None else {name: _format_of(module)}


def _format_of(module: Any) -> Format:
    form: Format = module.FORMAT
    return form


def _listing(known: dict[str, Format]) -> str:
    endings = ", ".join(
        f"{f.name} ({' '.join(f.suffixes) or f'{f.name}:FILE'})" for f in known.values()
    )
    return f"known formats: {endings}"
