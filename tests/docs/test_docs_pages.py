"""The built documentation in a real browser.  The tests are skipped if it is not built or if there
is no browser.

Built as `.ci/run` does:  sphinx-build -W -n -b html docs docs/_build/html
"""

from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import urljoin

import pytest
from support.browsers import DESK, PHONE, serious_faults
from support.paths import ROOT

BUILT = ROOT / "docs" / "_build" / "html"
PAGES = sorted(path for path in BUILT.rglob("*.html") if "_downloads" not in path.parts)

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(not PAGES, reason="the documentation is not built"),
]


@pytest.fixture(scope="module")
def windows(chromium):
    """A wide and a narrow window, each with a list of its errors and of its requests to other
    hosts.
    """

    def window(settings):
        page, faults = chromium.new_context(offline=True, **settings).new_page(), []
        page.on("console", lambda message: faults.append(message.text))
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("requestfailed", lambda call: faults.append(call.url))
        page.on(
            "request",
            lambda call: call.url.startswith(("file:", "data:")) or faults.append(call.url),
        )
        return page, faults

    return window(DESK), window(PHONE)


def assert_complete(page, faults):
    """Check that a page loads nothing from elsewhere, fits its width, and shows its pictures."""
    over = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
    assert page.evaluate(over) == 0
    assert page.evaluate("[...document.images].every(i => i.complete && i.naturalWidth)")
    assert faults == []


@pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(BUILT)))
def test_a_page_is_complete_and_accessible_in_every_layout(windows, path):
    (desk, desk_faults), (phone, phone_faults) = windows
    desk_faults.clear()
    phone_faults.clear()
    desk.emulate_media(color_scheme="light")
    desk.goto(path.as_uri())
    assert_complete(desk, desk_faults)
    assert serious_faults(desk) == {}
    # Dark pages differ from light pages only in colours and pictures. Narrow pages differ from wide
    # pages in everything but colours.
    desk.emulate_media(color_scheme="dark")
    assert_complete(desk, desk_faults)
    assert serious_faults(desk, only=["color-contrast"]) == {}
    phone.goto(path.as_uri())
    assert_complete(phone, phone_faults)
    without = [] if path.name == "index.html" else ["color-contrast"]
    assert serious_faults(phone, without=without) == {}


class Links(HTMLParser):
    """The links of a page, and the anchors in the page to which links can point."""

    def __init__(self, path):
        super().__init__()
        self.links, self.anchors, self.page = [], set(), path.as_uri()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        if "id" in attributes:
            self.anchors.add(attributes["id"])
        if tag in ("a", "area") and "href" in attributes:
            self.links.append(urljoin(self.page, attributes["href"]))


def test_links_lead_somewhere():
    parsed = {path.as_uri(): Links(path) for path in PAGES}
    links = [(name, link) for name, page in parsed.items() for link in page.links]
    assert len(links) > 1000
    for name, link in links:
        target, _, anchor = link.partition("#")
        if target.startswith("file:"):
            known = parsed.get(target)
            assert known or Path(target.removeprefix("file://")).is_file(), (name, link)
            assert not anchor or not known or anchor in known.anchors, (name, link)
