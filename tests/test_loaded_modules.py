"""Tests of the modules that each command loads in a new interpreter."""

import json
import subprocess
import sys
from functools import cache

import pytest

HEAVY = {"numpy", "scipy", "pyproj", "shapely", "laspy", "matplotlib", "pydantic", "rasterio"}
RICH = {"rich"}

SERVER = """
import json, os, sys
for line in sys.stdin:
    if os.fork() == 0:
        before = set(sys.modules)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        exec(json.loads(line))
        print(json.dumps(sorted(set(sys.modules) - before)), file=sys.stderr, flush=True)
        os._exit(0)
    status = os.wait()[1]
    if status:
        print(json.dumps(f"status {status}"), file=sys.stderr, flush=True)
"""
"""Program of an interpreter that reads lines of code and executes each line in a fork of itself."""


@pytest.fixture(scope="module")
def loaded():
    """A function that returns the modules that a new interpreter loads to execute some code."""
    process = subprocess.Popen(
        [sys.executable, "-c", SERVER],
        stdin=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )

    @cache
    def after(code):
        process.stdin.write(json.dumps(code) + "\n")
        process.stdin.flush()
        lines = []
        while not (lines and lines[-1].startswith(("[", '"status'))):
            lines.append(process.stderr.readline())
            assert lines[-1], "".join(lines)
        found = json.loads(lines[-1])
        assert isinstance(found, list), "".join(lines)
        return frozenset(found)

    yield after
    process.stdin.close()
    process.wait(timeout=60)
    process.stderr.close()


@pytest.fixture
def packages(loaded):
    return lambda code: {name.partition(".")[0] for name in loaded(code)}


def command(*arguments, status=0):
    return f"from aosplan.cli.app import run\nassert run({list(arguments)!r}) == {status}"


def test_import_aosplan_loads_no_submodules(loaded):
    slow = {"typing", "dataclasses", "importlib.metadata", "inspect", "re", "argparse", "json"}
    found = loaded("import aosplan")
    assert not found & (HEAVY | RICH | slow | {"typer", "click"})
    assert {name for name in found if name.startswith("aosplan")} == {"aosplan"}
    assert loaded("import aosplan; aosplan.__version__") == found


@pytest.mark.parametrize(
    "arguments",
    [
        ("plan", "--altitude", "40", "--json"),
        ("plan", "--altitude", "40", "--vhat", "0.95", "--max-aperture", "15", "--json"),
        ("plan", "--altitude", "40", "--vhat", "0.8", "--grid", "lanes", "--out", "csv:-"),
        ("plan", "--altitude=40", "--vhat=0.9", "--grid=line", "--line-length=300", "--json"),
        ("plan", "--altitude", "40", "--quiet"),
        ("visibility", "--density", "0.5", "--samples", "50", "--dhat", "1", "--json"),
        ("cameras", "--json"),
        ("drones", "--json"),
        ("scenes", "--json"),
        ("formats", "--json"),
        ("scene", "paper-forest", "--json"),
        *((name, "--help") for name in ("plan", "simulate", "visibility", "scene", "schema")),
    ],
    ids=" ".join,
)
def test_data_and_help_load_neither_heavy_modules_nor_rich(arguments, packages):
    assert not packages(command(*arguments)) & (HEAVY | RICH)


def test_a_plain_plan_loads_only_the_chapters_it_needs(loaded):
    line = ("plan", "--altitude", "40", "--vhat", "0.98", "--defaults", "none", "--json")
    found = {name for name in loaded(command(*line)) if name.startswith("aosplan.")}
    assert not {
        name
        for name in found
        if name.split(".")[1] in {"areas", "simulation", "postflight", "sweeps"}
        or name.endswith("_schema")
        or name.startswith(("aosplan.mission.formats", "aosplan.scenes.files", "aosplan.show.page"))
    }
    assert len(found) < 67, "each module costs every plan about a hundredth"


def test_a_plan_of_saved_voxels_loads_no_scipy(tmp_path, packages):
    from support.forests import STANDS, clumped_forest

    from aosplan.scenes.correlogram import correlogram
    from aosplan.scenes.files.voxel_file import VoxelStand, stand_npz

    stand = VoxelStand.of(clumped_forest(STANDS["spruce"]))
    place = tmp_path / "stand.npz"
    place.write_bytes(stand_npz(stand._replace(correlogram=correlogram(stand.volume))))
    line = ("plan", "--altitude", "50", "--vhat", "0.8", "--defaults", "none", "--json")
    found = packages(command(*line, "--scene", str(place)))
    assert "numpy" in found
    assert not found & (HEAVY - {"numpy"})


@pytest.mark.parametrize(
    "arguments",
    [("plan", "--altitude", "40"), ("scenes",), ("cameras",), ("scene", "paper-forest")],
    ids=" ".join,
)
def test_tables_load_rich_but_nothing_heavy(arguments, packages):
    found = packages(command(*arguments))
    assert found >= RICH
    assert not found & HEAVY


@pytest.mark.parametrize("arguments", [("--help",), ("--version",), ()], ids=" ".join)
def test_plain_help_loads_typer_and_no_command(arguments, loaded, packages):
    assert "typer" in packages(command(*arguments))
    assert not packages(command(*arguments)) & (HEAVY | RICH)
    found = {name for name in loaded(command(*arguments)) if name.startswith("aosplan.")}
    assert found == {
        "aosplan.cli",
        "aosplan.cli.app",
        "aosplan.cli.typer_classes",
        "aosplan.errors",
    }


def test_commands_load_only_the_classes_of_typer(loaded):
    found = loaded(command("plan", "--altitude", "40", "--json"))
    assert "typer.core" in found
    assert "typer.main" not in found


def test_other_code_gets_the_whole_typer_after_a_command(loaded):
    use = "import typer; typer.core.TyperGroup; typer.Typer(); from typer import colors"
    assert "typer.main" in loaded(f"{command('cameras', '--json')}\n{use}")


def test_a_place_loads_pyproj_and_nothing_else_that_is_heavy(packages):
    found = packages(command("plan", "--altitude", "40", "--origin", "48,14", "--json"))
    assert "pyproj" in found
    assert not found & (HEAVY - {"pyproj"})


def test_small_missions_are_written_without_numpy(tmp_path, packages):
    from aosplan.mission.export import formats

    line = ["plan", "--altitude", "40", "--origin", "48,14", "--quiet"]
    asking = {
        "autel": "autel-evo-max-4t",
        "dji-fly": "dji-mini-4-pro",
        "parrot": "parrot-anafi-usa",
    }
    for name in sorted(set(formats()) - set(asking)):
        line += ["--out", f"{name}:{tmp_path / name}"]
    lines = [line] + [
        # With a narrow camera, the footprint would limit the plan, and NumPy would be needed.
        [*line[:6], "--vhat", "0.9", "--drone", drone, "--out", f"{name}:{tmp_path / name}"]
        for name, drone in asking.items()
    ]
    for each in lines:
        assert not packages(command(*each)) & ((HEAVY | RICH) - {"pyproj"})


def test_a_request_file_loads_pydantic_and_nothing_else_that_is_heavy(tmp_path, packages):
    (tmp_path / "r.toml").write_text("altitude = 40\n")
    found = packages(command("plan", str(tmp_path / "r.toml"), "--json"))
    assert "pydantic" in found
    assert not found & (HEAVY - {"pydantic"})


def test_a_scene_file_loads_nothing_heavy(tmp_path, packages):
    place, text = tmp_path / "s.toml", 'name = "s"\ndensity = 0.01\noccluder_size_m = 0.2\n'
    place.write_text(text + "volume_base_m = 2.0\nvolume_height_m = 9\n")
    line = ("plan", "--altitude", "40", "--scene", str(place), "--json")
    assert not packages(command(*line)) & HEAVY


def test_an_error_loads_nothing_heavy(packages):
    assert not packages(command("plan", "--altitude", "10", status=2)) & (HEAVY | RICH)


def test_equations_of_scalars_need_no_numpy(packages):
    code = "import aosplan\nassert aosplan.visibility(0.5, 7, 8, 1.0) > 0.7"
    assert "numpy" not in packages(code)
