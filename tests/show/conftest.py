"""Reports of plans, and a browser in which they are opened from files.

All requests except that for the page are refused and counted.  Any message on the console is a
failure.
"""

from contextlib import contextmanager

import pytest
from support.browsers import DESK
from support.report_pages import PLANS

from aosplan import PlanRequest, plan
from aosplan.show.page.page import report_page


@pytest.fixture(scope="session")
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
