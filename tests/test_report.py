"""The report: what stands on the page, and how it behaves in a real browser.

The tests of the browser need a Chromium on the path, which Playwright drives; the others read the
page as text.
"""

import json
import re
from html.parser import HTMLParser

import pytest

from aosplan import PlanRequest, plan
from aosplan.report import report_page

AREA = ["--area", "field.geojson"]
VOID = {"meta", "link", "img", "input", "br", "hr"}


class Outline(HTMLParser):
    """Elements of a page in order, and a check that each is closed where it was opened."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.elements, self.open, self.texts = [], [], {}
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        for tag in set(self.open):
            self.texts[tag] = self.texts.get(tag, "") + data

    def of(self, tag):
        return [attributes for name, attributes in self.elements if name == tag]


@pytest.fixture(scope="module")
def default_plan():
    return plan(PlanRequest(altitude=40))


@pytest.fixture(scope="module")
def default_page(default_plan):
    return report_page(default_plan).decode()


def embedded(page, name):
    """A JSON document that stands in a page."""
    return json.loads(
        re.search(rf'<script type="application/json" id="{name}">(.*?)</script>', page)[1]
    )


# The page as text


def test_elements_are_closed_and_ids_are_unique(default_page):
    ids = [
        attributes["id"] for _, attributes in Outline(default_page).elements if "id" in attributes
    ]
    assert len(ids) == len(set(ids)) > 20
