"""The report in a real browser: a headless Chromium that is controlled by Playwright.

The tests are skipped without a browser.  Pages are opened from files.  All requests except that for
the page are refused and counted.  Any message on the console is a failure.
"""

import json
import re
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from PIL import Image
from support.browsers import DESK, PHONE
from support.paths import AREAS

from aosplan import PlanRequest, plan
from aosplan.show.page.page import report_page

playwright = pytest.importorskip("playwright.sync_api")
axe = pytest.importorskip("axe_playwright_python.sync_playwright")


PLANS = {
    "default": {"altitude": 40},
    "place": {
        "altitude": 40,
        "vhat": 0.9,
        "origin": (48.3358, 14.3261),
        "heading": 30,
        "grid": "lanes",
        "trigger": "distance",
        "drone": "dji-m3t",
        "takeoff": (48.3355, 14.3255),
    },
    "area": {
        "altitude": 40,
        "vhat": 0.8,
        "area": str(AREAS / "field.geojson"),
        "clear": str(AREAS / "meadow.kml"),
        "no_fly": str(AREAS / "mast.geojson"),
        "heading": "auto",
        "flight_time": 30,
    },
    "line": {
        "altitude": 40,
        "vhat": 0.9,
        "grid": "line",
        "line_length": 200.0,
        "sensitivity": True,
    },
    "clear": {"altitude": 40, "integrated_density": 0, "occluder_size": 0.2, "volume_height": 9},
}

HOSTILE = (
    '</script><script>document.title = "broken"</script><img src=x onerror="document.title=\'no\'">'
    "'\"&amp;&{{ 7 * 7 }}{% raw %}\u2028\u2029\u202eright to left: שלום مرحبا "
)
HOSTILE += "<b>" + "W" * (10_000 - len(HOSTILE) - 3)


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """A function that makes a plan and its page, and returns the plan and the path of the page."""
    made = {}
    folder = tmp_path_factory.mktemp("pages")

    def page_of(name, options=None):
        if name not in made:
            planned = plan(PlanRequest(**(options or PLANS[name])))
            path = folder / f"{name}.html"
            path.write_bytes(report_page(planned, seed=1 if name == "default" else None))
            made[name] = planned, path
        return made[name]

    return page_of


@pytest.fixture
def opened(chromium):
    """A context with an open page.  The page must not make other requests or print messages."""

    @contextmanager
    def open_(path, settings=DESK, **more):
        context = chromium.new_context(offline=True, **settings, **more)
        asked, said = [], []

        def route(call):
            asked.append(call.request.url)
            if call.request.url == path.as_uri():
                call.continue_()
            else:
                call.abort()

        context.route("**/*", route)
        page = context.new_page()
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.goto(path.as_uri())
        page.locator("#map[data-painted]").wait_for()
        try:
            yield page
            assert asked == [path.as_uri()]
            assert said == []
        finally:
            context.close()

    return open_


def scale(page):
    return float(page.locator("#map").get_attribute("data-scale"))


def pixel(page, index):
    """Position of a waypoint in pixels of the window.  The map is scrolled into view first."""
    return page.evaluate(
        """(i) => { const map = document.getElementById("map");
                    map.scrollIntoView({ block: "center" });
                    const box = map.getBoundingClientRect();
                    return [box.left + pixelX(east[i]), box.top + pixelY(north[i])]; }""",
        index,
    )


def settled(page):
    """Wait until the map is redrawn."""
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => setTimeout(done, 30)))")


def colour(page, index):
    """Colour of the map at a waypoint: red, green, blue."""
    return page.evaluate(
        """(i) => {
          const map = document.getElementById("map");
          const copy = new OffscreenCanvas(map.width, map.height);
          const pen = copy.getContext("2d");
          pen.drawImage(map, 0, 0);
          const [x, y] = [pixelX(east[i]), pixelY(north[i])].map((at) => Math.round(at * view.ratio));
          return [...pen.getImageData(x, y, 1, 1).data.slice(0, 3)];
        }""",
        index,
    )


def ink(page, name):
    """A colour of the style sheet: red, green, blue, with a tolerance for rounding."""
    text = page.evaluate("(name) => inks()[name]", name)
    return pytest.approx([int(part) for part in re.findall(r"\d+", text)], abs=2)


def overflow(page):
    return page.evaluate("document.documentElement.scrollWidth - window.innerWidth")


@pytest.mark.parametrize("name", PLANS)
def test_a_page_shows_the_numbers_of_its_plan(pages, opened, name):
    planned, path = pages(name)
    document = planned.document()
    with opened(path) as page:
        assert page.evaluate("saved()") == document
        assert page.evaluate("count") == len(document["waypoints"])
        shown = page.locator("data").evaluate_all(
            "(all) => all.map((e) => [e.dataset.of, e.value])"
        )
        assert len(shown) > 15
        for place, value in shown:
            found = document
            for part in place.split("."):
                found = found[int(part) if isinstance(found, list) else part]
            assert json.loads(value) == found
        assert overflow(page) <= 0


def test_the_map_is_drawn_to_scale_and_shows_every_site(pages, opened):
    planned, path = pages("place")
    points = planned.waypoints
    with opened(path) as page:
        (x0, y0), (x9, y9) = pixel(page, 0), pixel(page, 9)
        assert x9 - x0 == pytest.approx(
            scale(page) * (points.east_m[9] - points.east_m[0]), rel=1e-4
        )
        assert y0 - y9 == pytest.approx(
            scale(page) * (points.north_m[9] - points.north_m[0]), rel=1e-4
        )
        assert page.locator("#map").get_attribute("data-sites") == str(len(points))
        inner = [index for index in range(1, len(points) - 1) if points.photo[index]]
        assert len(inner) == planned.solution.pattern.samples == 12
        for index in inner:
            assert colour(page, index) == ink(page, "blue")


def test_hovering_over_a_site_says_which_it_is(pages, opened):
    planned, path = pages("place")
    row = planned.document()["waypoints"][7]
    with opened(path) as page:
        tip = page.locator("#tip")
        assert tip.is_hidden()
        page.mouse.move(*pixel(page, 7))
        text = tip.inner_text()
        assert text.startswith(f"Waypoint 7 of {len(planned.waypoints)}")
        for value in (f"east {row['east_m']:.2f} m", f"north {row['north_m']:.2f} m"):
            assert value in text
        assert f"{row['latitude']:.7f}, {row['longitude']:.7f}" in text
        box = page.locator("#map").bounding_box()
        page.mouse.move(box["x"] + 4, box["y"] + box["height"] - 4)
        assert tip.is_hidden()


def test_tapping_the_map_selects_a_site(pages, opened):
    _, path = pages("default")
    with opened(path, PHONE) as page:
        page.locator("#map").scroll_into_view_if_needed()
        page.touchscreen.tap(*pixel(page, 20))
        assert page.locator("#chosen").input_value() == "20"
        assert page.locator("#readout").inner_text().startswith("Waypoint 20 of 50")


def test_the_wheel_zooms_about_the_pointer(pages, opened):
    _, path = pages("default")
    with opened(path) as page:
        map_ = page.locator("#map")
        widest = map_.get_attribute("data-scale")
        before, place = scale(page), pixel(page, 12)
        pointer = [int(place[0]) - 9, int(place[1]) - 6]
        page.wait_for_timeout(250)  # scrolling continues for a short time
        page.mouse.move(*pointer)
        page.mouse.wheel(0, -240)
        playwright.expect(map_).not_to_have_attribute("data-scale", widest)
        grown = scale(page) / before
        assert grown > 1.5
        wanted = [at + grown * (was - at) for was, at in zip(place, pointer, strict=True)]
        assert pixel(page, 12) == pytest.approx(wanted, abs=0.05)
        page.mouse.wheel(0, 5000)
        playwright.expect(map_).to_have_attribute("data-scale", widest)


def test_two_fingers_zoom(pages, opened):
    _, path = pages("default")
    with opened(path, PHONE) as page:
        before = scale(page)
        page.evaluate(
            """() => {
              const map = document.getElementById("map"), box = map.getBoundingClientRect();
              const send = (type, id, x) => map.dispatchEvent(new PointerEvent(type, { pointerId: id,
                pointerType: "touch", clientX: box.left + x, clientY: box.top + 100, bubbles: true }));
              send("pointerdown", 11, 100); send("pointerdown", 12, 200);
              send("pointermove", 12, 300);
              send("pointerup", 11, 100); send("pointerup", 12, 300);
            }"""
        )
        assert scale(page) == pytest.approx(2.0 * before, rel=0.01)


def test_buttons_and_keys_zoom_and_move(pages, opened):
    _, path = pages("default")
    with opened(path) as page:
        before = scale(page)
        page.get_by_role("button", name="Zoom in").click()
        assert scale(page) == pytest.approx(1.5 * before, rel=1e-4)
        page.get_by_role("button", name="Zoom out").click()
        assert scale(page) == pytest.approx(before, rel=1e-4)
        page.locator("#map").focus()
        page.keyboard.press("+")
        assert scale(page) == pytest.approx(1.5 * before, rel=1e-4)
        x, y = pixel(page, 5)
        page.keyboard.press("ArrowRight")
        assert pixel(page, 5) == pytest.approx((x - 60, y), abs=0.1)
        page.keyboard.press("0")
        assert scale(page) == pytest.approx(before, rel=1e-4)


def test_the_keyboard_alone_reaches_every_waypoint(pages, opened):
    _, path = pages("default")
    with opened(path) as page:
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.className") == "skip"
        for _ in range(12):
            page.keyboard.press("Tab")
            if page.evaluate("document.activeElement.id") == "map":
                break
        assert page.locator("#readout").inner_text().startswith("Waypoint 0 of 50")
        for key, index in (("n", 1), ("n", 2), ("p", 1), ("End", 49), ("n", 49), ("Home", 0)):
            page.keyboard.press(key)
            assert page.locator("#chosen").input_value() == str(index)
        page.locator("#chosen").fill("33")
        page.keyboard.press("Enter")
        assert page.locator("#readout").inner_text().startswith("Waypoint 33 of 50")
        page.locator("#chosen").fill("1e9")
        page.keyboard.press("Enter")
        assert page.locator("#chosen").input_value() == "49"


def test_dragging_moves_the_map(pages, opened):
    _, path = pages("default")
    with opened(path) as page:
        page.get_by_role("button", name="Zoom in").click()
        x, y = pixel(page, 25)
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 50, y + 20, steps=5)
        page.mouse.up()
        assert pixel(page, 25) == pytest.approx((x + 50, y + 20), abs=6)


def test_the_table_shows_all_waypoints_page_by_page(pages, opened):
    planned, path = pages("area")
    rows = planned.document()["waypoints"]
    with opened(path) as page:
        page.locator("#waypoints > summary").click()
        table = page.locator("#rows")
        head = table.locator("thead th").all_inner_texts()
        assert head == list(rows[0])
        cells = table.locator("tbody tr").nth(99).locator("th, td").all_inner_texts()
        assert [json.loads(cell) for cell in cells] == list(rows[99].values())
        page.get_by_role("button", name="Next", exact=True).click()
        assert table.locator("tbody th").first.inner_text() == "100"
        assert table.locator("tbody th").first.get_attribute("scope") == "row"


@pytest.mark.parametrize("name", ["request-toml", "request-json"])
def test_the_request_is_copied(pages, opened, name):
    _, path = pages("default")
    with opened(path, permissions=["clipboard-read", "clipboard-write"]) as page:
        page.locator(f"button[data-of={name}]").click()
        playwright.expect(page.locator("#told")).to_have_text("Copied.")
        copied = page.evaluate("navigator.clipboard.readText()")
        assert copied == page.locator(f"#{name}").text_content()


def test_the_plan_is_saved_as_the_document_it_came_from(pages, opened):
    planned, path = pages("area")
    with opened(path) as page:
        with page.expect_download() as download:
            page.get_by_role("button", name="Save plan.json").click()
        assert download.value.suggested_filename == "plan.json"
        assert json.loads(Path(download.value.path()).read_text()) == planned.document()


def test_light_and_dark_follow_the_system_and_the_button(pages, opened):
    _, path = pages("default")
    paper = "getComputedStyle(document.body).backgroundColor"
    with opened(path, color_scheme="dark") as page:
        dark, blue = page.evaluate(paper), ink(page, "blue")
        assert page.locator("#theme").get_attribute("aria-pressed") == "true"
        page.locator("#theme").click()
        settled(page)
        assert page.evaluate(paper) != dark
        assert ink(page, "blue") != blue
        assert colour(page, 12) == ink(page, "blue")
    with opened(path, color_scheme="light") as page:
        assert page.evaluate(paper) == "rgb(255, 255, 255)"


# Accessibility


@pytest.mark.parametrize("name", ["default", "place", "area"])
def test_axe_reports_no_serious_accessibility_problems(pages, opened, name):
    _, path = pages(name)
    with opened(path) as page:
        for summary in page.locator("summary").all():
            if name != "area":  # A hundred rows would take seconds, and test the same as ten rows.
                summary.click()
        looks = [("light", DESK), ("dark", DESK), ("light", PHONE), ("dark", PHONE)]
        for scheme, settings in looks if name == "default" else looks[::3]:
            page.emulate_media(color_scheme=scheme)
            page.set_viewport_size(settings["viewport"])
            settled(page)
            found = axe.Axe().run(page).response
            assert len(found["passes"]) > 20
            assert [
                (scheme, violation["id"], [node["html"] for node in violation["nodes"]])
                for violation in found["violations"]
                if violation["impact"] in ("serious", "critical")
            ] == []


@pytest.mark.parametrize("name", PLANS)
def test_a_phone_needs_no_sideways_scrolling(pages, opened, name):
    _, path = pages(name)
    with opened(path, PHONE) as page:
        for summary in page.locator("summary").all():
            summary.click()
        assert overflow(page) <= 0


def test_it_prints_on_a4_in_light_colours(pages, opened):
    _, path = pages("default")
    with opened(path, color_scheme="dark") as page:
        content = page.pdf(prefer_css_page_size=True)
        boxes = re.findall(rb"/MediaBox ?\[ ?0 0 ([\d.]+) ([\d.]+) ?\]", content)
        assert 2 <= len(boxes) <= 4
        for width, height in boxes:
            assert float(width) == pytest.approx(595.3, abs=1.0)
            assert float(height) == pytest.approx(841.9, abs=1.0)
        page.emulate_media(media="print")
        assert (
            page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
        )
        assert page.locator("#theme").is_hidden()


def test_paper_gets_the_whole_map_in_light_colours_and_the_screen_its_own_back(pages, opened):
    _, path = pages("default")
    with opened(path, color_scheme="dark") as page:
        widest = scale(page)
        page.get_by_role("button", name="Zoom in").click()
        settled(page)
        zoomed, dark = scale(page), colour(page, 12)
        page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
        assert scale(page) == pytest.approx(widest)
        assert colour(page, 12) == ink(page, "blue") != dark
        page.evaluate("window.dispatchEvent(new Event('afterprint'))")
        settled(page)
        assert scale(page) == pytest.approx(zoomed)
        assert colour(page, 12) == dark


def test_paper_of_another_shape_leaves_the_map_to_scale(pages, opened):
    planned, path = pages("default")
    sites = planned.waypoints
    with opened(path) as page:
        page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
        # The print view is copied, because the script would redraw the map for the screen.
        page.evaluate(
            """() => { const map = document.getElementById("map"), copy = map.cloneNode();
                       copy.getContext("2d").drawImage(map, 0, 0); map.before(copy);
                       map.style = "position: absolute; visibility: hidden; width: 500px"; }"""
        )
        page.emulate_media(media="print")
        page.set_viewport_size({"width": 600, "height": 900})
        picture = np.asarray(
            Image.open(BytesIO(page.locator("#map").first.screenshot())).convert("RGB"), dtype=int
        )
    # Centres of the green mark of the first site and of the red mark of the last site.
    red, green, blue = np.moveaxis(picture, 2, 0)
    first, last = (
        np.mean(np.nonzero(marked), axis=1)
        for marked in (
            (green > red + 50) & (green > blue + 20),
            red > np.maximum(green, blue) + 125,
        )
    )
    drawn = (last[1] - first[1]) / (first[0] - last[0])
    flown = (sites[-1].east_m - sites[0].east_m) / (sites[-1].north_m - sites[0].north_m)
    assert drawn == pytest.approx(flown, rel=0.03)


@pytest.mark.parametrize("settings", [DESK, PHONE], ids=["desk", "phone"])
def test_a_malicious_name_is_shown_as_text_within_the_layout(pages, opened, tmp_path, settings):
    scene = {"name": HOSTILE, "title": HOSTILE, "density": 0.01, "occluder_size_m": 0.2}
    scene |= {"volume_base_m": 2.0, "volume_height_m": 15.0}
    camera = {"name": HOSTILE, "title": HOSTILE, "focal_length_mm": 9.1, "sensor_width_mm": 7.68}
    camera |= {"sensor_height_mm": 6.144, "image_width_px": 640, "image_height_px": 512}
    folder = tmp_path / "<script>'\"&שלום"
    folder.mkdir()
    for name, table in (("scene", scene), ("camera", camera)):
        (folder / f"{name}.toml").write_text(tomli_w.dumps(table))
    options = {"altitude": 40, "vhat": 0.8, "samples": 4, "baseline": 1.0}
    options |= {name: str(folder / f"{name}.toml") for name in ("scene", "camera")}
    planned = plan(PlanRequest(**options))
    path = tmp_path / "hostile.html"
    path.write_bytes(report_page(planned, seed=None))
    with opened(path, settings) as page:
        assert page.title().startswith("4 photos")
        assert page.locator("main script, header script, header img, main b").count() == 0
        assert page.evaluate("saved()") == planned.document()
        assert overflow(page) <= 0
        for summary in page.locator("summary").all():
            summary.click()
        assert overflow(page) <= 0
        # Browsers show U+0000 and single carriage returns differently. They are therefore left out
        # of the text.
        assert page.locator("header bdi").nth(1).text_content() == HOSTILE
        assert page.locator("#request-toml").text_content() == tomli_w.dumps(
            planned.document()["request"]
        )


# Large plans


@pytest.mark.parametrize("photos", [1, 50, 5_000, 500_000])
def test_plans_of_any_size_stay_usable(pages, opened, photos):
    options = {"altitude": 40, "vhat": 0.1, "samples": photos, "baseline": 2.8, "heading": 20}
    _, path = pages(f"{photos} photos", options)
    with opened(path) as page:
        assert page.evaluate("count") == photos
        assert page.locator("#map").get_attribute("data-sites") == str(photos)
        page.locator("#chosen").fill(str(photos // 3))
        page.keyboard.press("Enter")
        # At a large scale the chosen site is still found and drawn.
        page.evaluate(
            "(i) => { zoom(1e4); view.x = east[i]; view.y = north[i]; moved(); }", photos // 3
        )
        settled(page)
        page.mouse.move(*pixel(page, photos // 3))
        assert page.locator("#tip").inner_text().startswith(f"Waypoint {photos // 3} of {photos}")
        assert overflow(page) <= 0
