"""What all tests share: helpers on the path, no deadlines, an empty folder, commands, a browser."""

import gc
import json
import os
import shutil
import sys
from pathlib import Path

import pytest
import tomli_w
from hypothesis import settings

# Tests say `from reference import exact`, whatever folder pytest is started in.
sys.path.insert(0, str(Path(__file__).parent))

# No test reads what another run, or the user, has left in the cache, nor anyone's defaults.
os.environ["AOSPLAN_CACHE"] = "0"
os.environ["AOSPLAN_DEFAULTS"] = "none"

# Time is measured by benchmarks, never by tests.
# In CI the examples are the same every time; on a desk they are new ones.
settings.register_profile(
    "aosplan",
    parent=settings.get_profile("default"),
    deadline=None,
    # Each run on a desk draws others, so that many runs see more than one long one.
    max_examples=25,
    derandomize=bool(os.environ.get("CI")),
)
# Other versions of the dependencies: what is true of the numbers has been tested before.
settings.register_profile("few", parent=settings.get_profile("aosplan"), max_examples=5)
settings.load_profile("aosplan")


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport():
    """Report a failure without collecting garbage meanwhile.

    What is collected may print a traceback of its own (as a forgotten task of asyncio does), which
    ends CPython 3.11 in a SystemError while it parses the source of the test that failed.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark what needs a browser, before tests are chosen by their marks."""
    for item in items:
        if "chromium" in getattr(item, "fixturenames", ()):
            item.add_marker("browser")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder that is the current one: no test leaves anything elsewhere."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def command(capsys):
    """A function that runs a command line: its status, stdout and stderr."""
    from aosplan.cli.app import run

    def execute(*arguments):
        status = run([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        return status, out, err

    return execute


@pytest.fixture
def campaign(tmp_path):
    """A file with the sweep that tests run."""
    from support.campaigns import CAMPAIGN

    path = tmp_path / "campaign.toml"
    path.write_text(CAMPAIGN, encoding="utf-8")
    return path


@pytest.fixture
def small_blocks(monkeypatch):
    """Sweeps in blocks of so few scenarios that there are several."""
    from aosplan.sweeps import scenarios

    monkeypatch.setattr(scenarios, "ROWS_A_BLOCK", 30)


@pytest.fixture(params=["toml", "json"])
def written(request, tmp_path):
    """A function that writes a table as TOML or JSON and gives the path."""

    def write(table):
        path = tmp_path / f"file.{request.param}"
        text = tomli_w.dumps(table) if request.param == "toml" else json.dumps(table)
        path.write_text(text, encoding="utf-8")
        return str(path)

    return write


# For a module: while Playwright runs, its thread has an event loop that others would meet.
@pytest.fixture(scope="module")
def chromium():
    """A headless Chromium that Playwright drives."""
    playwright = pytest.importorskip("playwright.sync_api")
    names = ("chromium", "chromium-browser", "google-chrome", "chrome")
    path = next(filter(None, map(shutil.which, names)), None)
    if path is None:
        pytest.skip("no Chromium on the path")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield browser
        browser.close()
