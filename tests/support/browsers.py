"""Sizes of screens for tests of pages, as settings of Playwright, and tests of accessibility."""

import pytest

PHONE = {"viewport": {"width": 360, "height": 740}, "has_touch": True}
DESK = {"viewport": {"width": 1200, "height": 900}}


def serious_faults(page, *, only=(), without=()):
    """Rules of axe-core that a page violates seriously, each with the elements concerned.

    `only` are the rules to test (by default, all rules), and `without` are rules to leave out.
    """
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    # The preload is switched off, because a page from a file may not read its style sheets a second
    # time.
    options = {"resultTypes": ["violations"], "preload": False}
    options["rules"] = {rule: {"enabled": False} for rule in without}
    if only:
        options["runOnly"] = list(only)
    found = axe.Axe().run(page, options=options).response
    assert len(found["passes"]) >= (len(only) or 10)
    return {
        rule["id"]: [node["html"][:200] for node in rule["nodes"]]
        for rule in found["violations"]
        if rule["impact"] in ("serious", "critical")
    }
