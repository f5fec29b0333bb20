"""Small files that ask for too much, or hold what no reader expects: one error line, at once.

What each of them once did (minutes, gigabytes, a traceback, words of a library) stands beside it.
"""

import json
import math

import pytest
from support.command_line import check_refusal

PLAN = ["plan", "--altitude", "40"]
AREA = [*PLAN, "--area"]
CAMERA = {
    "name": "core",
    "focal_length_mm": 13.0,
    "sensor_width_mm": 7.68,
    "sensor_height_mm": 6.144,
    "image_width_px": 640,
    "image_height_px": 512,
}
STAND = {
    "name": "stand",
    "occluder_size_m": 0.3,
    "volume_height_m": 10,
    "volume_base_m": 2,
    "density": 0.02,
}


@pytest.fixture
def refused(folder, command):
    """A function that writes a file and runs a command that is to refuse it: its message."""

    def run(name, content, *arguments):
        if not isinstance(content, (str, bytes)):
            content = json.dumps(content)
        (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
        status, out, err = command(*arguments)
        check_refusal(status, out, err)
        assert "unexpected" not in err
        return err

    return run


def star(points):
    """An outline in which each edge crosses nearly all others."""
    step = points // 2 - 1
    while math.gcd(points, step) > 1:
        step -= 1
    turns = [2 * math.pi * step * index / points for index in range(points + 1)]
    ring = [[14.3 + 0.001 * math.cos(turn), 48.3 + 0.001 * math.sin(turn)] for turn in turns]
    ring[-1] = ring[0]
    return ring


@pytest.mark.parametrize("points", [300, 6000])
def test_an_outline_that_crosses_itself_everywhere(refused, points):  # > 60 s; 9 GB
    area = {"type": "Polygon", "coordinates": [star(points)]}
    assert "crosses itself near" in refused("star.geojson", area, *AREA, "star.geojson")


def grid_of_needles(count):
    """Polygons of which each of one half crosses each of the other half."""
    span, width = 0.001, 0.001 / count / 4
    for index in range(count):
        at = span * index / count
        ring = [[at, 0.0], [at + width, 0.0], [at + width, span], [at, span], [at, 0.0]]
        for turned in (False, True):
            yield [[[14.3 + p[turned], 48.3 + p[not turned]] for p in ring]]


def test_polygons_that_cross_each_other_everywhere(refused):  # gigabytes
    area = {"type": "MultiPolygon", "coordinates": list(grid_of_needles(600))}
    assert "cross each other too often" in refused(
        "needles.geojson", area, *AREA, "needles.geojson"
    )


def test_few_polygons_may_cross(folder, command):
    area = {"type": "MultiPolygon", "coordinates": list(grid_of_needles(3))}
    (folder / "few.geojson").write_text(json.dumps(area), encoding="utf-8")
    status, _, err = command(*AREA, "few.geojson", "--samples", 4)
    assert "error" not in err or "cross" not in err, status


DOTS = {
    "quoted": '"a=b"' + ".c" * 25_000 + " = 1",  # 2.4 GB
    "plain": "a" + ".c" * 25_000 + " = 1",
    "blanks": "a" + " .\tc" * 25_000 + " = 1",
    "header": "[a" + ".c" * 25_000 + "]",
    "inline": "x = { a" + ".'c'" * 25_000 + " = 1 }",
}


@pytest.mark.parametrize("kind", DOTS)
def test_a_dotted_key_is_not_followed_to_its_end(refused, kind):
    assert "nested too deeply" in refused("dots.toml", DOTS[kind], "plan", "dots.toml")


def test_a_toml_file_of_tables_alone(refused):  # 1 kB of memory for every 6 bytes
    text = "".join(f"[a{index}]\n" for index in range(200_001))
    assert "more than 200000 names" in refused("tables.toml", text, "plan", "tables.toml")


def test_text_with_dots_is_no_key(folder, command):
    stand = f'title = "{"Some words. Others. " * 100}{"..." * 100}"\n' + "".join(
        f"{name} = {json.dumps(value)}\n" for name, value in STAND.items()
    )
    (folder / "stand.toml").write_text(stand, encoding="utf-8")
    assert command("scene", "stand.toml")[0] == 0


def test_a_name_that_is_given_very_often(refused):  # > 60 s
    names = ", ".join(f'"{index}": 0' for index in [*range(100_000), 99_999])
    assert "'99999' is given twice" in refused("often.json", f"{{{names}}}", "scene", "often.json")


@pytest.mark.parametrize("name", ["\ud800", "a\udfff", "\ude00\ud83d"])
@pytest.mark.parametrize("where", ["value", "name"])
def test_half_a_surrogate_pair_is_no_text(refused, name, where):  # UnicodeEncodeError
    stand = {**STAND, "name": name} if where == "value" else {**STAND, name: 1}
    message = refused("stand.json", stand, "scene", "stand.json", "--json")
    assert "is not Unicode text" in message


def test_a_whole_surrogate_pair_is_text(folder, command):
    (folder / "stand.json").write_text(json.dumps({**STAND, "name": "🌲"}), encoding="ascii")
    status, out, _ = command("scene", "stand.json", "--json")
    assert status == 0
    assert json.loads(out)["name"] == "🌲"


@pytest.mark.parametrize("argument", ["\udcff.toml", "a\udc80b"])
def test_an_argument_that_is_not_unicode(command, argument):
    status, out, err = command(*PLAN, "--scene", argument)
    check_refusal(status, out, err)
    assert "is not Unicode text" in err


@pytest.mark.parametrize("number", ["1e999", "-1e400", "1" + "0" * 400])
@pytest.mark.parametrize("suffix", ["json", "toml"])
def test_a_number_that_no_float_can_hold(refused, number, suffix):
    text = f'{{"name": "a", "x": [0, {number}]}}' if suffix == "json" else f"x = [0, {number}]"
    message = refused(f"a.{suffix}", text, "scene", f"a.{suffix}")
    assert "x.1 is too large a number" in message


@pytest.mark.parametrize("encoding", ["foo", "utf-7", "rot13", "utf-16"])
def test_an_xml_encoding_that_nobody_knows(refused, encoding):  # LookupError
    text = f'<?xml version="1.0" encoding="{encoding}"?><kml/>'
    refused("area.kml", text, *AREA, "area.kml")
