"""Fixtures and settings for all tests: helpers on the path, no deadlines, an empty folder,
commands, and a browser.
"""

import gc
import json
import os
import shutil
import signal
import sys
from pathlib import Path

import pytest
import tomli_w
from _pytest.doctest import DoctestModule
from hypothesis import settings

# Tests import `reference` and `support` by name, from any folder in which pytest is started.
sys.path.insert(0, str(Path(__file__).parent))

# Tests use neither the cache nor the defaults of the user.
os.environ["AOSPLAN_CACHE"] = "0"
os.environ["AOSPLAN_DEFAULTS"] = "none"

# As in the program, OpenBLAS does not start a thread for each processor (`aosplan.__main__`).
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# A shell that starts tests in the background lets them ignore Ctrl-C, and so would the programs that
# the tests start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Tests have no time limits, because benchmarks measure time.  In CI, the examples of Hypothesis are
# the same in every run. Elsewhere, every run has new examples.
settings.register_profile(
    "aosplan",
    parent=settings.get_profile("default"),
    deadline=None,
    # Every run has other examples. Many short runs therefore replace a long run.
    max_examples=15,
    derandomize=bool(os.environ.get("CI")),
)
# This profile is for tests with other versions of dependencies. The numbers have been tested with
# many examples before.
settings.register_profile("few", parent=settings.get_profile("aosplan"), max_examples=5)
settings.load_profile("aosplan")


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport():
    """Disable garbage collection while a failure is reported.

    Objects that are collected may print their own traceback, such as an asyncio task that was not
    awaited.  CPython 3.11 then raises a SystemError while it parses the source of the failed test.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()


@pytest.hookimpl(wrapper=True)
def pytest_collect_file(file_path):
    """Look for doctests only outside this folder, because tests have no doctests."""
    return [each for each in (yield) if not isinstance(each, DoctestModule)]


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark tests that need a browser, before tests are selected by marks."""
    for item in items:
        if "chromium" in getattr(item, "fixturenames", ()):
            item.add_marker("browser")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder as the current one, so that tests leave no files elsewhere."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def command(capsys):
    """A function that runs a command line and returns its status, stdout and stderr."""
    from aosplan.cli.app import run

    def execute(*arguments):
        status = run([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        return status, out, err

    return execute


@pytest.fixture
def campaign(tmp_path):
    """The file of the sweep that several tests use."""
    from support.campaigns import CAMPAIGN

    path = tmp_path / "campaign.toml"
    path.write_text(CAMPAIGN, encoding="utf-8")
    return path


@pytest.fixture
def small_blocks(monkeypatch):
    """Make blocks so small that sweeps have several blocks."""
    from aosplan.sweeps import scenarios

    monkeypatch.setattr(scenarios, "ROWS_A_BLOCK", 30)


@pytest.fixture(params=["toml", "json"])
def written(request, tmp_path):
    """A function that writes a table as TOML or JSON and returns the path."""

    def write(table):
        path = tmp_path / f"file.{request.param}"
        text = tomli_w.dumps(table) if request.param == "toml" else json.dumps(table)
        path.write_text(text, encoding="utf-8")
        return str(path)

    return write


# The browser is used for a whole module, because other tests would find the event loop of
# Playwright's thread.
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
