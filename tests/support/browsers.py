"""Sizes of screens for tests of pages, as settings of Playwright."""

PHONE = {"viewport": {"width": 360, "height": 740}, "has_touch": True}
DESK = {"viewport": {"width": 1200, "height": 900}}
