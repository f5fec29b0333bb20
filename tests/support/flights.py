"""Missions at any place on earth for tests of formats, with functions that write and read files.

The readers follow the rules of the formats and share no code with the writers.
"""

import csv
import io
import json
import zipfile
from xml.etree import ElementTree as ET

from hypothesis import strategies as st

from aosplan.grid.patterns import local_sites, pattern_for
from aosplan.mission.export import formats, render
from aosplan.mission.mission import FlightSettings, Mission, Waypoints, placed

KML = "{http://www.opengis.net/kml/2.2}"
WPML = "{http://www.dji.com/wpmz/1.0.2}"
AUTEL = "{http://www.autel.com/wpmz/1.0.0}"

SUMMARY = {"scene": {"name": "stand"}, "camera": {"name": "dji-m3t-thermal"}}


def grid(samples=12, *, origin=(48.3358, 14.3261), baseline_m=3.0, heading_deg=30.0, **values):
    """A mission over a grid.  Further arguments are flight settings or columns of its waypoints."""
    altitude_m = values.pop("altitude_m", 40.0)
    kind = values.pop("kind", "trimmed")
    columns = {name: values.pop(name) for name in ("ground_m", "photo") if name in values}
    east, north = local_sites(pattern_for(kind, samples), baseline_m, heading_deg)
    plain = Waypoints(east, north, [altitude_m] * len(east))
    ways = Waypoints(**placed(plain, origin).columns(), **columns)
    settings = FlightSettings(spacing_m=baseline_m, yaw_deg=heading_deg % 360.0)
    return Mission(ways, SUMMARY, settings._replace(**values))


places = st.one_of(
    st.tuples(st.floats(-90, 90), st.floats(-180, 180)),
    st.tuples(st.sampled_from([90.0, -90.0, 89.99999, 0.0]), st.floats(-180, 180)),
    st.tuples(st.floats(-90, 90), st.sampled_from([180.0, -180.0, 179.99999, -179.99999])),
)

missions = st.builds(
    grid,
    st.integers(2, 130),
    origin=places,
    baseline_m=st.floats(0.6, 60.0),
    heading_deg=st.floats(-360.0, 720.0),
    altitude_m=st.floats(10.0, 450.0),
    kind=st.sampled_from(["trimmed", "lanes", "line"]),
    trigger=st.sampled_from(["stop", "distance"]),
    autopilot=st.none(),
)


FLYERS = {
    "autel": "autel-evo-max-4t",
    "dji-fly": "dji-mini-4-pro",
    "parrot": "parrot-anafi-thermal",
}
"""A drone for each format that needs one.  All of these drones stop for photos."""


def flown_in(mission, name):
    """The mission for a drone that supports the format."""
    if name not in FLYERS:
        return mission
    autopilot = name.removeprefix("dji-fly") or "dji"
    own = {"drone": FLYERS[name], "mission_formats": (name,), "trigger": "stop"}
    own["autopilot"] = autopilot
    return mission._replace(settings=mission.settings._replace(**own))


def commands_of(text, version=110):
    """Lines of a `.waypoints` file, split into fields at tabs in the same way as by
    QGroundControl.
    """
    first, *lines = text.removesuffix("\n").split("\n")
    assert first == f"QGC WPL {version}"
    return [[float(field) for field in line.split("\t")] for line in lines]


def _csv(content):
    rows = csv.DictReader(io.StringIO(content.decode(), newline=""))
    return [(r["latitude"], r["longitude"], r["altitude_m"]) for r in rows]


def _litchi(content):
    rows = csv.DictReader(io.StringIO(content.decode(), newline=""))
    return [(r["latitude"], r["longitude"], r["altitude(m)"]) for r in rows]


def _geojson(content):
    points = [f for f in json.loads(content)["features"] if f["geometry"]["type"] == "Point"]
    return [(y, x, z) for x, y, z in (point["geometry"]["coordinates"] for point in points)]


def _kml(content):
    points = ET.fromstring(content).iter(f"{KML}Point")
    texts = [point.find(f"{KML}coordinates").text.split(",") for point in points]
    return [(y, x, z) for x, y, z in texts]


def _waypoints(content):
    return [tuple(c[8:11]) for c in commands_of(content.decode())[1:] if c[3] == 16]


def _plan(content):
    items = json.loads(content)["mission"]["items"]
    return [tuple(item["params"][4:]) for item in items if item["command"] == 16]


def _parrot(content):
    return [tuple(c[8:11]) for c in commands_of(content.decode(), 120) if c[3] == 16]


def documents_of(content):
    """The two documents of a WPML file, parsed."""
    archive = zipfile.ZipFile(io.BytesIO(content))
    assert archive.namelist() == ["wpmz/template.kml", "wpmz/waylines.wpml"]
    return {name[5:]: ET.fromstring(archive.read(name)) for name in archive.namelist()}


def _wpml(content):
    found = []
    for document, height in (("template.kml", "height"), ("waylines.wpml", "executeHeight")):
        places_ = []
        for mark in documents_of(content)[document].iter(f"{KML}Placemark"):
            x, y = mark.find(f"{KML}Point/{KML}coordinates").text.split(",")
            places_.append((y, x, mark.find(WPML + height).text))
        found.append(places_)
    assert found[0] == found[1]
    return found[0]


def _autel(content):
    members = documents_of(content)
    places_ = [
        (*_texts_of(mark, AUTEL, "coordinates")[0].split(",")[::-1], height)
        for mark in members["waylines.wpml"].iter(f"{KML}Placemark")
        for height in _texts_of(mark, AUTEL, "executeHeight")
    ]
    shown = _texts_of(members["template.kml"], AUTEL, "height")
    assert shown == [height for *_, height in places_]
    return places_


def _fly(content):
    members = documents_of(content)
    assert not list(members["template.kml"].iter(f"{KML}Placemark"))
    return [
        (*_texts_of(mark, WPML, "coordinates")[0].split(",")[::-1], height)
        for mark in members["waylines.wpml"].iter(f"{KML}Placemark")
        for height in _texts_of(mark, WPML, "executeHeight")
    ]


def _texts_of(element, namespace, name):
    space = KML if name == "coordinates" else namespace
    return [found.text for found in element.iter(space + name)]


READERS = {
    "autel": _autel,
    "csv": _csv,
    "dji-fly": _fly,
    "geojson": _geojson,
    "kml": _kml,
    "litchi": _litchi,
    "parrot": _parrot,
    "plan": _plan,
    "waypoints": _waypoints,
    "kmz": _wpml,
}


def positions_of(name, contents):
    """Latitude, longitude and altitude of each site in the files of a mission, in their order."""
    return [
        tuple(float(value) for value in place)
        for content in contents
        for place in READERS[name](content)
    ]


def written(mission, name):
    return render(flown_in(mission, name), formats()[name])


def plan_of(mission):
    return json.loads(written(mission, "plan"))


def texts(element, name):
    return [found.text for found in element.iter(WPML + name)]


def pairs(count):
    """A mission of many lines with two photos each.  Such a mission needs the largest number of
    commands.
    """
    east = [3.0 * (index % 2) for index in range(count)]
    north = [3.0 * (index // 2) for index in range(count)]
    where = ([1e-5 * value for value in north], [1e-5 * value for value in east])
    return grid()._replace(waypoints=Waypoints(east, north, [40.0] * count, *where))
