"""The built documentation in a real browser.  The tests are skipped if it is not built or if there
is no browser.

Built as `.ci/run` does:  sphinx-build -W -n -b html docs docs/_build/html
"""

from pathlib import Path

import pytest
from support.browsers import DESK, PHONE
from support.paths import ROOT

axe = pytest.importorskip("axe_playwright_python.sync_playwright")

BUILT = ROOT / "docs" / "_build" / "html"
PAGES = sorted(path for path in BUILT.rglob("*.html") if "_downloads" not in path.parts)

pytestmark = pytest.mark.skipif(not PAGES, reason="the documentation is not built")

LAYOUTS = {
    "light": {**DESK, "color_scheme": "light"},
    "dark": {**DESK, "color_scheme": "dark"},
    "phone": {**PHONE, "color_scheme": "light"},
}


@pytest.fixture(params=LAYOUTS)
def opened(request, chromium):
    """A page in one of the layouts, and a list of its requests and errors."""
    context = chromium.new_context(offline=True, **LAYOUTS[request.param])
    page, faults = context.new_page(), []
    page.on("console", lambda message: faults.append(message.text))
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("requestfailed", lambda call: faults.append(call.url))
    page.on(
        "request", lambda call: call.url.startswith(("file:", "data:")) or faults.append(call.url)
    )
    yield page, faults
    context.close()


def test_documentation_pages_load_no_external_files_and_fit_their_width(opened):
    page, faults = opened
    for path in PAGES:
        page.goto(path.as_uri())
        over = page.evaluate(
            "document.documentElement.scrollWidth - document.documentElement.clientWidth"
        )
        assert over == 0, path
        assert page.evaluate("[...document.images].every(i => i.complete && i.naturalWidth)"), path
        assert faults == [], path


@pytest.mark.parametrize("opened", ["light"], indirect=True)  # every layout has the same links
def test_every_link_has_a_target(opened):
    page, _ = opened
    anchors = {}
    links = []
    for path in PAGES:
        page.goto(path.as_uri())
        anchors[path.as_uri()] = set(
            page.evaluate("[...document.querySelectorAll('[id]')].map(e => e.id)")
        )
        links += [
            (path.name, link) for link in page.evaluate("[...document.links].map(a => a.href)")
        ]
    assert len(links) > 1000
    for name, link in links:
        target, _, anchor = link.partition("#")
        if target.startswith("file:"):
            known = anchors.get(target)
            assert known is not None or Path(target.removeprefix("file://")).is_file(), (name, link)
            assert not anchor or known is None or anchor in known, (name, link)


def test_axe_reports_no_serious_accessibility_problems(opened):
    page, _ = opened
    for path in PAGES:
        page.goto(path.as_uri())
        found = axe.Axe().run(page).response["violations"]
        serious = {each["id"]: each["nodes"][0]["html"][:200] for each in found
                   if each["impact"] in ("serious", "critical")}  # fmt: skip
        assert serious == {}, path
