"""Properties in which Windows and macOS differ from this system, simulated on this system."""

import errno
import os
import sys
from pathlib import Path

import pytest

from aosplan.errors import SurroundingsError
from aosplan.files import text_of, write_all
from aosplan.sweeps.parquet_folder import is_folder
from aosplan.sweeps.run import MOST_WINDOWS_WORKERS, workers_of

ROOT = Path(__file__).parents[1]


def test_a_final_slash_marks_a_folder_result_on_windows_too(monkeypatch):
    assert is_folder("results.parquet/")
    monkeypatch.setattr(os, "sep", "\\")
    assert is_folder("C:/sweeps/results.parquet/")
    assert is_folder("C:\\sweeps\\results.parquet\\")
    assert not is_folder("C:\\sweeps\\results.parquet")


def test_windows_has_at_most_61_workers(monkeypatch):
    assert workers_of(100) == 100
    monkeypatch.setattr(sys, "platform", "win32")
    assert workers_of(100) == MOST_WINDOWS_WORKERS == 61
    assert workers_of(8) == 8


def test_a_file_open_in_a_spreadsheet_is_named_with_a_remedy(tmp_path, monkeypatch):
    def refuse(*_names):
        error = PermissionError(errno.EACCES, "The process cannot access the file")
        error.winerror = 32
        raise error

    table = tmp_path / "grid.csv"
    table.write_text("kept")
    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(SurroundingsError) as found:
        write_all({str(table): b"new"}, force=True)
    assert "cannot write" in found.value.message
    assert found.value.hint == f"close the program that has '{table}' open"
    assert table.read_text() == "kept"
    assert os.listdir(tmp_path) == ["grid.csv"]


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_requests_have_any_newline_and_the_encodings_of_powershell(tmp_path, newline, encoding):
    from aosplan.planning.request_file import read_request

    text = newline.join(["altitude = 40", 'vhat = "98%"', ""])
    assert text_of(text.encode(encoding), "x") == text
    if newline == "\r":
        return  # TOML does not allow this line break.
    path = tmp_path / "request.toml"
    path.write_bytes(text.encode(encoding))
    assert read_request(str(path)) == {"altitude": 40, "vhat": "98%"}


def test_the_hosted_workflow_covers_every_system_and_python():
    yaml = pytest.importorskip("yaml")
    workflow = yaml.safe_load((ROOT / ".github/workflows/test.yml").read_text("utf-8"))
    matrix = workflow["jobs"]["quick"]["strategy"]["matrix"]
    assert {system.partition("-")[0] for system in matrix["system"]} == {
        "ubuntu",
        "windows",
        "macos",
    }
    assert matrix["python"] == ["3.11", "3.12", "3.13", "3.14"]
    steps = [step.get("run", "") for step in workflow["jobs"]["quick"]["steps"]]
    assert any("pytest" in step for step in steps)


def test_the_conda_recipe_lists_what_the_package_needs():
    import re
    import tomllib

    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    text = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    run = text.partition("  run:\n")[2].partition("\n\n")[0]
    listed = [line.strip(" -").replace(" ", "") for line in run.splitlines()]
    needed = [f"python{project['requires-python']}", *project["dependencies"]]
    assert listed == [re.sub(r"\s", "", each) for each in needed]
