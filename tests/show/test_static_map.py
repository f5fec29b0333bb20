"""The report in a browser without scripts: tests of the static map and of the table."""

import re
from itertools import pairwise

import pytest
from support.browsers import DESK, PHONE

from aosplan import PlanRequest, plan
from aosplan.show.figures.grid import grid_of
from aosplan.show.page.page import report_page
from aosplan.show.page.static_map import MOST_ROWS, MOST_SITES, WIDTH, static_map_of

PLANS = {
    "default": {"altitude": 40, "heading": 30},
    "lanes": {
        "altitude": 40,
        "vhat": 0.9,
        "origin": (48.3358, 14.3261),
        "grid": "lanes",
        "trigger": "distance",
        "takeoff": (48.3355, 14.3255),
    },
    "line": {"altitude": 40, "vhat": 0.9, "grid": "line", "line_length": 200.0},
    "single": {"altitude": 40, "samples": 1, "vhat": 0.0},
    "large": {"altitude": 40, "vhat": 0.1, "samples": 1500, "baseline": 2.8, "heading": 200},
}


def planned(name):
    return plan(PlanRequest(**PLANS[name]))


def still_map(found):
    return static_map_of(found, grid_of(found, found.layout.area))


def places(path):
    """The points of an outline or of dots."""
    return [tuple(map(float, pair)) for pair in re.findall(r"([-\d.]+) ([-\d.]+)", path)]


def metres_a_pixel(still):
    length, unit = still.bar[1].split()
    return float(length) * {"m": 1.0, "km": 1000.0}[unit] / still.bar[0]


@pytest.mark.parametrize("name", PLANS)
def test_the_map_shows_every_site_to_scale(name):
    found = planned(name)
    ways, still = found.waypoints, still_map(found)
    taken = [row for row in ways if row.photo]
    turns = [row for row in ways if not row.photo]
    unit = metres_a_pixel(still)
    x0, y0 = still.first
    way, sites = map("".join, zip(*still.flights, strict=True))
    for rows, path in ((taken, sites), (turns, still.turns), (list(ways), way)):
        drawn = places(path)
        assert len(drawn) == len(rows)
        for (x, y), row in zip(drawn, rows, strict=True):
            # The length of the bar and both its ends are rounded to a tenth of a pixel.
            near = {"abs": 0.2 * unit, "rel": 0.1 / still.bar[0]}
            assert unit * (x - x0) == pytest.approx(row.east_m - ways.east_m[0], **near)
            assert unit * (y0 - y) == pytest.approx(row.north_m - ways.north_m[0], **near)
            assert 0.0 < x < WIDTH
            assert 0.0 < y < still.height
    assert still.last == places(still.flights[-1][0])[-1]
    for _, outline in still.shapes:
        assert all(0.0 <= x <= WIDTH and 0.0 <= y <= still.height for x, y in places(outline))


def test_the_footprint_has_its_size_and_the_takeoff_its_place():
    found = planned("lanes")
    still = still_map(found)
    unit = metres_a_pixel(still)
    corners = places(dict(still.shapes)["footprint"])
    sides = {round(unit * abs(complex(*a) - complex(*b)), 1) for a, b in pairwise(corners)}
    assert sides == {round(side, 1) for side in found.camera.footprint_m(40.0)}
    x, y = still.takeoff
    assert x < still.first[0]  # The take-off point is in the south-west.
    assert y > still.first[1]


def test_an_area_has_its_parts(tmp_path):
    root = tmp_path / "area.geojson"
    root.write_text(
        '{"type": "Polygon", "coordinates": [[[14.0, 48.0], [14.0004, 48.0], [14.0004, 48.0003],'
        " [14.0, 48.0003], [14.0, 48.0]]]}"
    )
    found = plan(PlanRequest(altitude=40, vhat=0.5, area=str(root)))
    still = still_map(found)
    assert [name for name, _ in still.shapes] == ["area", "footprint"]
    outline = places(dict(still.shapes)["area"])
    west, east = min(x for x, _ in outline), max(x for x, _ in outline)
    # 0.0004 degrees of longitude at 48 degrees north, on the ellipsoid
    assert metres_a_pixel(still) * (east - west) == pytest.approx(29.84, abs=0.15)


def test_the_table_has_every_waypoint():
    found = planned("lanes")
    still = still_map(found)
    assert still.columns == list(found.waypoints.columns())
    assert "photo" in still.columns
    for row, cells in zip(found.waypoints, still.rows, strict=True):
        shown = dict(zip(still.columns, cells, strict=True))
        assert shown["east_m"] == f"{row.east_m:.2f}"
        assert shown["longitude"] == f"{row.longitude:.7f}"
        assert shown["photo"] == ("yes" if row.photo else "no")


def test_large_plans_have_only_a_map_and_larger_ones_a_note():
    assert len(planned("large").waypoints) > MOST_ROWS
    assert still_map(planned("large")).rows == []
    request = PlanRequest(altitude=40, vhat=0.1, samples=MOST_SITES + 1, baseline=2.8)
    found = plan(request)
    assert still_map(found) is None
    assert b"no map of more than 5,000 waypoints" in report_page(found, seed=None)


@pytest.fixture(params=[DESK, PHONE], ids=["desk", "phone"])
def unscripted(request, chromium):
    context = chromium.new_context(offline=True, java_script_enabled=False, **request.param)
    yield context.new_page()
    context.close()


@pytest.mark.parametrize("name", ["default", "lanes", "large"])
def test_without_scripts_the_page_shows_its_static_content(unscripted, tmp_path, name):
    page, found = unscripted, planned(name)
    path = tmp_path / "plan.html"
    path.write_bytes(report_page(found, seed=None))
    page.goto(path.as_uri())
    picture = page.locator("svg.still")
    assert picture.is_visible()
    size = picture.bounding_box()
    assert size["x"] >= 0.0
    assert size["x"] + size["width"] <= page.viewport_size["width"]
    for part in page.locator("[data-script]").all():
        assert part.is_hidden()
    assert page.locator("button:visible, canvas:visible, input:visible").count() == 0
    rows = page.locator("noscript tbody tr")
    assert rows.count() == (len(found.waypoints) if name != "large" else 0)
    if name != "large":
        page.locator("noscript summary").click()
        assert rows.first.is_visible()


def test_a_malicious_name_is_shown_as_text_without_scripts(unscripted, tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(
        "name = '</desc></noscript><b id=broken>x</b>'\ndensity = 0.01\noccluder_size_m = 0.2\n"
        "volume_base_m = 2.0\nvolume_height_m = 15.0\n"
    )
    found = plan(PlanRequest(altitude=40, vhat=0.8, scene=str(scene)))
    path = tmp_path / "plan.html"
    path.write_bytes(report_page(found, seed=None))
    unscripted.goto(path.as_uri())
    assert unscripted.locator("#broken").count() == 0
    assert "<b id=broken>" in unscripted.locator("#still-desc").text_content()
