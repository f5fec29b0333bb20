"""Formats: one file each, found by looking into this folder.

A format is a module here with a `FORMAT` and a ``render(mission) -> bytes``, a pure function
that gives the same bytes for the same mission.  Adding a file adds a format.
"""

from __future__ import annotations

import os
import pkgutil
from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

from aosplan.errors import RequestError
from aosplan.quantities import nearest_hint

if TYPE_CHECKING:
    from collections.abc import Callable

    from aosplan.mission import Mission


class Format(NamedTuple):
    """What a format is called, which endings it serves, and what it needs."""

    name: str
    suffixes: tuple[str, ...]
    title: str
    needs_place: bool


def formats() -> dict[str, Format]:
    """All formats by name, in alphabetical order."""
    found = (
        import_module(f"{__name__}.{module.name}").FORMAT
        for module in pkgutil.iter_modules(__path__)
    )
    return {known.name: known for known in sorted(found)}


def choose(path: str, name: str | None = None) -> tuple[Format, str]:
    """The format and path of an output: by name, by ``NAME:PATH``, or by the path's ending.

    Raises
    ------
    RequestError
        Where no format of that name or ending is known.
    """
    known = formats()
    prefix, colon, rest = path.partition(":")
    if colon and prefix in known:
        if name not in (None, prefix):
            raise RequestError(f"output '{path}' and --format {name} contradict each other")
        name, path = prefix, rest
    if not path:
        raise RequestError("output '' is not a file name")
    if name is not None:
        if name not in known:
            raise RequestError(
                f"unknown format '{name}'", nearest_hint(name, known) or _listing(known)
            )
        return known[name], path
    suffix = os.path.splitext(path)[1].lower()
    for candidate in known.values():
        if suffix in candidate.suffixes:
            return candidate, path
    if path == "-":
        raise RequestError("output '-' (stdout) has no ending", "give its --format, or NAME:-")
    raise RequestError(f"output '{path}': no format ends in '{suffix}'", _listing(known))


def render(mission: Mission, chosen: Format) -> bytes:
    """The bytes of a mission in a format.

    Raises
    ------
    RequestError
        Where the format needs a place and the mission has none.
    """
    if chosen.needs_place and not mission.has_place:
        raise RequestError(
            f"{chosen.title} needs a place on earth", "give --origin LAT,LON, or write CSV"
        )
    write: Callable[[Mission], bytes] = import_module(f"{__name__}.{chosen.name}").render
    return write(mission)


def _listing(known: dict[str, Format]) -> str:
    endings = ", ".join(f"{f.name} ({' '.join(f.suffixes)})" for f in known.values())
    return f"known formats: {endings}"
