"""`--help` and `--version`."""

import json
import re
import shlex
import shutil
from importlib import import_module
from itertools import pairwise

import pytest
from support.clouds import stand, write_cloud
from support.geotagged import photo
from support.recorded import photo as photographed
from support.recorded import sites, write_recording

import aosplan
from aosplan import PlanRequest, plan
from aosplan.cli.app import COMMANDS, run
from aosplan.cli.options import SHORT_HELP
from aosplan.planning.options import OPTIONS


def test_help_lists_every_command(command):
    status, out, err = command("--help")
    assert (status, err) == (0, "")
    assert all(re.search(rf"^  {name} ", out, re.MULTILINE) for name in COMMANDS)
    assert command() == (status, out, err)


def test_summaries_in_the_list_of_commands_are_not_cut(command):
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
    assert len(examples) in {2, 3}
    assert all(example.startswith(f"aosplan {name}") for example in examples)
    assert max(len(line.replace("\u0302", "")) for line in out.splitlines()) <= 80


@pytest.fixture(scope="module")
def things(tmp_path_factory):
    """A folder with all files that the examples name."""
    folder = tmp_path_factory.mktemp("things")
    for name, seed in (("stand", 0), ("north", 1), ("south", 2)):
        write_cloud(folder / f"{name}.laz", *stand(seed))
    request = PlanRequest(altitude=40, vhat=0.9, origin="48,14")
    planned = plan(request)
    (folder / "plan.json").write_text(json.dumps(planned.document()))
    (folder / "request.toml").write_text('altitude = 40\nvhat = 0.9\norigin = "48,14"\n')
    (folder / "campaign.toml").write_text("[sweep]\naltitude = [40, 50]\nvhat = [0.8, 0.9]\n")
    planned.write(str(folder / "flown.csv"))
    planned.write(str(folder / "grid.kmz"))
    many = plan(PlanRequest(altitude=40, samples=60, origin="48,14"))
    many.write(str(folder / "views.csv"))
    (folder / "photos").mkdir()
    for waypoint in list(planned.waypoints)[3:]:  # The first three waypoints have no photo.
        place = waypoint.latitude, waypoint.longitude
        photo(folder / "photos" / f"{waypoint.index}.jpg", *place)
    for index in range(30):
        photo(folder / "photos" / f"more{index}.jpg", 48.0 + 1e-5 * index, 14.0)
    views = list(sites())
    shown = [photographed(*view) for view in views]
    write_recording(folder, views, shown, camera=False)
    assert run(["scene", str(folder / "stand.laz"), "--save", str(folder / "stand.npz")]) == 0
    return folder


EXAMPLES = [
    (name, example)
    for name in COMMANDS
    for example in examples_of(f"Examples:\n{import_module(f'aosplan.cli.{name}').COMMAND.epilog}")
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "example"), EXAMPLES, ids=[text for _, text in EXAMPLES])
def test_examples_run(folder, things, command, name, example):
    if "--scheduler" in example:
        pytest.skip("needs a cluster")
    assert example.startswith(f"aosplan {name}")
    shutil.copytree(things, folder, dirs_exist_ok=True)
    arguments = shlex.split(example.partition(" > ")[0])[1:]
    outputs = [
        folder / value.rpartition(":")[2]
        for flag, value in pairwise(arguments)
        if flag in {"--out", "--save", "--picture"}
    ]
    for path in outputs:
        path.unlink(missing_ok=True)
    quick = ["--precision", "0.2"] if name == "simulate" else []
    status, printed, err = command(*arguments, *quick)
    assert status == 0, err
    assert printed
    assert all(path.stat().st_size > 0 for path in outputs)


def test_help_of_plan_names_every_option_once(command):
    _, out, _ = command("plan", "--help-all")
    for option in OPTIONS:
        assert len(re.findall(rf"^  {option.flag} ", out, re.MULTILINE)) == 1


def test_short_help_of_plan_fits_on_two_screens_and_says_how_to_see_the_rest(command):
    _, short, _ = command("plan", "--help")
    _, whole, _ = command("plan", "--help-all")
    assert len(short.splitlines()) < 80 < len(whole.splitlines())
    shown = [option for option in OPTIONS if re.search(rf"^  {option.flag} ", short, re.MULTILINE)]
    assert {option.name for option in shown} == SHORT_HELP
    assert f"with {len(OPTIONS) - len(SHORT_HELP)} more options of a plan" in " ".join(
        short.split()
    )
    assert set(short.split()) <= set(whole.split())


@pytest.mark.parametrize("name", ["review", "thin", "plot"])
def test_commands_for_saved_plans_show_only_their_own_options(command, name):
    _, short, _ = command(name, "--help")
    flags = {option.flag for option in OPTIONS}
    own = set(re.findall(r"^  (--[\w-]+)", short, re.MULTILINE))
    assert not own & (flags - {"--samples"})
    assert "--out" in own
    assert ("--samples" in own) == (name == "thin")
    _, whole, _ = command(name, "--help-all")
    assert "--scene" in whole


def test_version(command):
    assert command("--version") == (0, f"aosplan {aosplan.__version__}\n", "")


@pytest.mark.parametrize("line", ["-h", "help", "--help"])
def test_help_is_shown_for_common_help_arguments(command, line):
    assert command(line) == command("--help")
    assert command(*reversed([line, "plan"]))[0] in {0, 2}
    assert command("help", "plan") == command("plan", "-h") == command("plan", "--help")


@pytest.mark.parametrize(
    ("line", "hint"),
    [
        ("plna", "plan"),
        ("plan --altitud 40", "--altitude"),
        ("plan --vhatt=0.9", "--vhat"),
        ("--verison", "--version"),
        ("help plna", "plan"),
    ],
)
def test_misspelt_commands_and_options_get_the_nearest_name(command, line, hint):
    status, out, err = command(*line.split())
    assert (status, out) == (2, "")
    assert hint in err.splitlines()[1]
