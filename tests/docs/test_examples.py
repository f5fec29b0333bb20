"""The examples and the code in the README run and print the output in the README."""

import contextlib
import io
import re
import runpy
import sys

import pytest
from support.paths import ROOT

from aosplan.cli.app import run

EXAMPLES = ROOT / "examples"
README = ROOT / "README.md"
sys.path.insert(0, str(ROOT / "docs"))

from extensions import examples  # noqa: E402


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)


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
def test_a_plan_can_be_computed_from_every_example_file(arguments):
    assert run(["plan", *arguments, "--quiet"]) == 0


@pytest.mark.slow
def test_the_commands_of_the_readme_run_and_print_what_it_shows(tmp_path):
    (tmp_path / "examples").symlink_to(EXAMPLES)
    text = README.read_text(encoding="utf-8")
    # The first block creates an environment, installs and plans; only the plan is run here.
    planned = re.sub(r"python3 -m venv .*?&& aosplan plan", "aosplan plan", text, count=1)
    for block, printed in examples.follow(planned, tmp_path):
        assert examples.same(block.body, printed), f"shown:\n{block.body}printed:\n{printed}"
    for name in ("plan.html", "grid.kmz", "grid.csv", "tradeoff.csv", "times.png"):
        assert (tmp_path / name).stat().st_size > 1000


def test_the_first_block_of_the_readme_has_two_commands():
    first = re.search(r"```sh\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)[1]
    lines = first.strip().splitlines()
    assert len(lines) == 2
    assert "aosplan plan --altitude 40 --vhat 0.98" in lines[0]
    assert "pytest" in lines[1]


def test_the_python_code_of_the_readme_prints_its_commented_output(tmp_path, monkeypatch):
    (code,) = blocks("python")
    monkeypatch.chdir(tmp_path)
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(code, "README.md", "exec"), {})
    assert printed.getvalue().split() == " ".join(re.findall(r"# (.*)", code)).split()
    assert (tmp_path / "grid.csv").exists()
