"""The report in a real browser: a headless Chromium that is controlled by Playwright.

The tests are skipped without a browser.
"""

import json
import re
from pathlib import Path

import pytest
import tomli_w
from support.browsers import DESK, PHONE, serious_faults
from support.report_pages import PLANS, overflow, settled

from aosplan import PlanRequest, plan
from aosplan.show.page.page import report_page

playwright = pytest.importorskip("playwright.sync_api")

HOSTILE = (
    '</script><script>document.title = "broken"</script><img src=x onerror="document.title=\'no\'">'
    "'\"&amp;&{{ 7 * 7 }}{% raw %}\u2028\u2029\u202eright to left: שלום مرحبا "
)
HOSTILE += "<b>" + "W" * (10_000 - len(HOSTILE) - 3)


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


# Accessibility


@pytest.mark.parametrize("name", ["default", "place", "area"])
def test_axe_reports_no_serious_accessibility_problems(pages, opened, name):
    _, path = pages(name)
    with opened(path) as page:
        for summary in page.locator("summary").all():
            if name != "area":  # A hundred rows would take seconds, and test the same as ten rows.
                summary.click()
        settled(page)
        assert serious_faults(page) == {}
        # Dark pages differ only in their colours.
        page.emulate_media(color_scheme="dark")
        settled(page)
        assert serious_faults(page, only=["color-contrast"]) == {}
        page.set_viewport_size(PHONE["viewport"])
        settled(page)
        assert serious_faults(page) == {}


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
