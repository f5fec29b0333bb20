"""The map of a report in a real browser: its scale, its sites, and how it is moved.

The tests are skipped without a browser.
"""

from io import BytesIO

import numpy as np
import pytest
from PIL import Image
from support.browsers import PHONE
from support.report_pages import colour, ink, overflow, pixel, scale, settled

playwright = pytest.importorskip("playwright.sync_api")


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
        settled(page)
        # If the page has just been scrolled, the wheel scrolls the page further, and does not
        # change the scale of the map.
        page.evaluate("scrolled = -Infinity")
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


# Large plans


# A call of a JavaScript function can have about 125,000 arguments.
@pytest.mark.parametrize("photos", [1, 50, 5_000, 200_000])
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
