"""`--help` and `--version`."""

import re
import shlex

import pytest

import aosplan
from aosplan.cli.app import COMMANDS
from aosplan.options import OPTIONS


def test_help_lists_every_command(command):
    status, out, err = command("--help")
    assert (status, err) == (0, "")
    assert all(re.search(rf"^  {name} ", out, re.MULTILINE) for name in COMMANDS)
    assert command() == (status, out, err)


def test_summaries_in_the_list_are_whole(command):
    _, out, _ = command("--help")
    assert "..." not in out.partition("Commands:")[2]


def examples_of(text):
    joined = text.partition("Examples:\n")[2].replace("\\\n", " ")
    return [line.strip() for line in joined.splitlines() if line.strip()]


@pytest.mark.parametrize("name", COMMANDS)
def test_help_of_every_command_has_two_examples(command, name):
    status, out, err = command(name, "--help")
    assert (status, err) == (0, "")
    examples = examples_of(out)
    assert len(examples) == 2
    assert all(example.startswith(f"aosplan {name}") for example in examples)
    assert max(map(len, out.splitlines())) <= 88


@pytest.mark.parametrize("name", COMMANDS)
def test_examples_that_need_no_file_run(folder, command, name):
    _, out, _ = command(name, "--help")
    for example in examples_of(out):
        arguments = shlex.split(example.partition(" > ")[0])[1:]
        if not re.search(r"\.(laz|json|toml)\b", " ".join(arguments)):
            status, printed, err = command(*arguments)
            assert (status, err) == (0, "")
            assert printed


def test_examples_of_export_run(folder, command):
    _, out, _ = command("plan", "--altitude", "40", "--origin", "48,14", "--json")
    (folder / "plan.json").write_text(out)
    _, text, _ = command("export", "--help")
    for example in examples_of(text):
        assert command(*shlex.split(example)[1:])[0] == 0


def test_help_of_plan_names_every_option_once(command):
    _, out, _ = command("plan", "--help")
    for option in OPTIONS:
        assert len(re.findall(rf"^  {option.flag} ", out, re.MULTILINE)) == 1


def test_version(command):
    assert command("--version") == (0, f"aosplan {aosplan.__version__}\n", "")
