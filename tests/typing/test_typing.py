"""Type checkers accept the calls of users, and reject wrong ones."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import aosplan

USAGE = Path(__file__).with_name("usage.py")
CHECKERS = {
    "mypy": ["--strict", "--config-file="],
    "pyright": [],
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CHECKERS)
def test_usage_passes_the_type_checkers(name, tmp_path):
    pytest.importorskip(name)
    page = tmp_path / "usage.py"
    text = USAGE.read_text("utf-8")
    page.write_text("# pyright: strict, reportUnnecessaryTypeIgnoreComment=true\n" + text, "utf-8")
    matplotlib = pytest.importorskip("matplotlib")
    sources = [str(Path(package.__file__).parents[1]) for package in (aosplan, matplotlib)]
    settings = {"extraPaths": sources}
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(settings))
    line = [sys.executable, "-m", name, *CHECKERS[name], str(page)]
    found = subprocess.run(line, check=False, capture_output=True, text=True, cwd=tmp_path)
    assert found.returncode == 0, found.stdout + found.stderr
