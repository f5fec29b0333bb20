"""The page about the architecture: tests of its diagram, and of the files that it names."""

import re
import subprocess
import sys
from graphlib import CycleError
from xml.etree import ElementTree as ET

import pytest
from support.paths import ROOT

SOURCE = ROOT / "src" / "aosplan"
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
sys.path.insert(0, str(ROOT / "docs"))

from extensions import chapters  # noqa: E402

SVG = "{http://www.w3.org/2000/svg}"


def test_the_diagram_has_every_chapter_and_only_downward_arrows():
    picture = ET.fromstring(chapters.svg())
    words = [text.text for text in picture.iter(f"{SVG}text")]
    folders = {path.parent.name for path in SOURCE.glob("*/__init__.py")}
    assert set(words[:-1]) == folders
    assert words[-1] == ", ".join(chapters.root_modules())
    lines = [path.get("d") for path in picture.iter(f"{SVG}path") if path.get("marker-end")]
    assert len(lines) > 10
    for line in lines:
        heights = [float(number) for number in re.findall(r"-?[\d.]+", line)[1::2]]
        assert heights == sorted(heights), line


def test_every_import_between_chapters_leads_to_a_lower_row():
    found = chapters.arrows()
    line = {name: i for i, row in enumerate(chapters.rows(found)) for name in row}
    assert len(found) > 40
    assert [each for each in found if line[each.upper] >= line[each.lower]] == []
    drawn = {(each.upper, each.lower) for each in found if not each.is_implied}
    for each in found:
        assert each.lower in reached(each.upper, drawn), each


def reached(start, pairs):
    """Chapters that can be reached from one chapter along arrows."""
    below = {lower for upper, lower in pairs if upper == start}
    return below.union(*(reached(lower, pairs) for lower in below))


def test_chapters_that_import_each_other_are_not_drawn():
    circle = [
        chapters.Arrow("grid", "camera", 1, False),
        chapters.Arrow("camera", "grid", 1, False),
    ]
    with pytest.raises(CycleError):
        chapters.rows(circle)


def test_every_file_that_the_page_names_exists():
    named = re.findall(r"`([\w/.*]+/[\w*]*(?:\.\w+)?|\w+\.py)`", PAGE)
    assert len(named) > 40
    for name in named:
        assert [*SOURCE.glob(name), *ROOT.glob(name), *SOURCE.rglob(name)], name


ENTERED = """
import sys
from aosplan.cli.app import run
files = set()
def note(frame, event, _):
    if event == "call" and frame.f_code.co_name != "<module>":
        files.add(frame.f_code.co_filename)
sys.setprofile(note)
status = run(sys.argv[1:])
sys.setprofile(None)
print(status, *files, sep="\\n", file=sys.stderr)
"""
"""Run a command, and print its status and the files in which a function was called."""


def test_a_command_calls_functions_in_the_listed_files(tmp_path):
    line = re.search(r"```sh\naosplan (.*)\n```", PAGE)[1]
    trip = re.findall(r"^\| \d+ \| `([\w/.]+)`", PAGE, re.MULTILINE)
    done = subprocess.run(
        [sys.executable, "-c", ENTERED, *line.split()],
        cwd=tmp_path,
        capture_output=True,
        check=True,
    )
    said = done.stderr.decode().splitlines()
    assert (tmp_path / "grid.plan").stat().st_size > 1000
    entered = said[said.index("0") :]
    assert len(trip) > 15
    assert [name for name in trip if str(SOURCE / name) not in entered] == []


def test_every_module_that_a_package_names_exists():
    for path in SOURCE.rglob("__init__.py"):
        for name in re.findall(r"`aosplan\.([\w.]+)`", path.read_text(encoding="utf-8")):
            place = SOURCE / name.replace(".", "/")
            assert place.is_dir() or place.with_suffix(".py").is_file(), (path, name)


def test_a_package_that_lists_its_modules_lists_all():
    for path in SOURCE.rglob("__init__.py"):
        text = path.read_text(encoding="utf-8")
        if text.count("\n- `aosplan.") > 1:
            modules = {each.stem for each in path.parent.glob("*.py")} - {"__init__"}
            named = {name for name in modules if re.search(rf"[`.]{name}`", text)}
            assert {name for name in modules - named if not name.endswith("_schema")} == set(), path
