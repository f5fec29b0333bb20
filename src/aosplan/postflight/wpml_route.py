"""Reading of the sites of a WPML route (``.kmz``) for DJI Pilot 2, DJI Fly or Autel Enterprise."""

from __future__ import annotations

from typing import Any
from xml.parsers import expat

from aosplan.areas.boundary_file import DEEPEST, archive_member
from aosplan.errors import RequestError
from aosplan.files import read_bytes
from aosplan.units import number

MEMBER = "waylines.wpml"
"""Name of the document that the drone flies.  The application displays the other document."""

SHOOTING = {"takePhoto", "orientedShoot", "accurateShoot"}
"""Actions that take a photo."""


def read_route(path: str) -> list[tuple[str, Any, Any, Any, int, float | None]]:
    """Read the waypoints and photos of a route in order.

    For each waypoint, the result has six values: place in the file, latitude, longitude, height,
    number of photos at the waypoint, and distance between photos from this waypoint on (0: no more
    photos; None: the distance does not change). Photos by distance are taken from the first
    waypoint of an action group to the last.

    Raises
    ------
    RequestError
        If the file is not such an archive.  The message describes the fault.
    """
    content = read_bytes(path)
    if content[:2] != b"PK":
        raise RequestError(f"'{path}' is not a KMZ archive")
    reader = _Reader(path)
    reader.read(archive_member(content, path, _waylines))
    return [
        (
            f"'{path}', waypoint {index}:",
            *site,
            reader.shots.get(index, 0),
            reader.switches.get(index),
        )
        for index, site in enumerate(reader.sites)
    ]


def _waylines(names: list[str], path: str) -> str:
    found = [name for name in names if name.replace("\\", "/").rpartition("/")[2] == MEMBER]
    if len(found) != 1:
        raise RequestError(
            f"'{path}' contains {len(found) or 'no'} {MEMBER}, so it is not a single WPML route",
            "if the file describes an area, give it as --area",
        )
    return found[0]


class _Reader:
    """Collects sites and photos while expat parses the document."""

    def __init__(self, path: str) -> None:
        self.path = path
        self.depth = 0
        self.texts: dict[str, str] = {}
        self.text: list[str] = []
        self.functions: list[str] = []
        self.sites: list[tuple[str, str, str | None]] = []
        self.shots: dict[int, int] = {}
        self.switches: dict[int, float] = {}

    def read(self, content: bytes) -> None:
        parser = expat.ParserCreate()
        parser.buffer_text = True
        parser.StartDoctypeDeclHandler = self._doctype
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self.text.append
        try:
            parser.Parse(content, True)
        # Python raises these errors for unknown encodings.
        except (expat.ExpatError, LookupError, ValueError) as error:
            raise RequestError(f"'{self.path}': {MEMBER} is not valid XML: {error}") from None

    def _doctype(self, *_: Any) -> None:
        raise RequestError(
            f"'{self.path}': {MEMBER} has a document type (<!DOCTYPE …>), which is not accepted"
        )

    def _start(self, name: str, _attributes: dict[str, str]) -> None:
        self.depth += 1
        if self.depth > DEEPEST:
            raise RequestError(f"'{self.path}' is nested too deeply to be read")
        tag = name.rpartition(":")[2]
        if tag == "Placemark":
            self.texts = {}
        elif tag == "actionGroup":
            self.functions = []
            self.texts.pop("actionTriggerParam", None)
        self.text.clear()

    def _end(self, name: str) -> None:
        self.depth -= 1
        tag, text = name.rpartition(":")[2], "".join(self.text).strip()
        if tag == "actionActuatorFunc":
            self.functions.append(text)
        elif tag == "actionGroup":
            self._group()
        elif tag == "Placemark":
            self._site()
        else:
            self.texts[tag] = text
        self.text.clear()

    def _group(self) -> None:
        if SHOOTING & set(self.functions):
            first, last = (
                int(number(self.texts.get(name, ""), f"'{self.path}', {name}"))
                for name in ("actionGroupStartIndex", "actionGroupEndIndex")
            )
            self.shots[first] = 1
            if self.texts.get("actionTriggerType") == "multipleDistance":
                spacing = number(
                    self.texts.get("actionTriggerParam", ""), f"'{self.path}', actionTriggerParam"
                )
                if spacing <= 0.0:
                    raise RequestError(f"'{self.path}': photos every {spacing:g} m")
                self.switches[first] = spacing
                self.switches.setdefault(last, 0.0)
            else:
                # If a group has another trigger, such as time, it is assumed that one photo is
                # taken at each of its waypoints.
                self.shots |= dict.fromkeys(range(max(first, 0), min(last, 65_535) + 1), 1)

    def _site(self) -> None:
        pair = self.texts.get("coordinates", "").split(",")
        if len(pair) < 2:
            raise RequestError(f"'{self.path}': waypoint {len(self.sites)} has no coordinates")
        self.sites.append((pair[1], pair[0], self.texts.get("executeHeight")))
