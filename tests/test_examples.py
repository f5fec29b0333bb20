"""The examples and the README's code run, and print what the README says."""

import contextlib
import io
import re
import runpy
from pathlib import Path

import pytest

from aosplan.cli.app import run

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "examples"


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)


@pytest.mark.parametrize("script", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.name)
def test_example_scripts_run(script, capsys):
    runpy.run_path(str(script), run_name="__main__")
    assert capsys.readouterr().out.count("\n") > 3


@pytest.mark.parametrize(
    "arguments",
    [
        [str(EXAMPLES / "request.toml")],
        ["--altitude", "40", "--scene", str(EXAMPLES / "stand.toml")],
        ["--altitude", "40", "--camera", str(EXAMPLES / "camera.toml")],
    ],
    ids=["request", "scene", "camera"],
)
def test_example_files_plan(arguments):
    assert run(["plan", *arguments, "--quiet"]) == 0


def test_the_readme_shows_what_its_first_command_prints(capsys):
    assert run(["plan", "--altitude", "40", "--vhat", "0.98"]) == 0
    assert blocks("text")[0].strip() == capsys.readouterr().out.strip()


def test_the_first_block_of_the_readme_has_two_commands():
    first = re.search(r"```sh\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)[1]
    lines = first.strip().splitlines()
    assert len(lines) == 2
    assert "aosplan plan --altitude 40 --vhat 0.98" in lines[0]
    assert "pytest" in lines[1]


def test_the_python_of_the_readme_prints_what_its_comments_say(tmp_path, monkeypatch):
    (code,) = blocks("python")
    monkeypatch.chdir(tmp_path)
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(code, "README.md", "exec"), {})
    assert printed.getvalue().split() == " ".join(re.findall(r"# (.*)", code)).split()
    assert (tmp_path / "grid.csv").exists()
