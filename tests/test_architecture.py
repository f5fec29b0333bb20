"""What is loaded when, what may import what, and what every source file looks like."""

import ast
import json
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

import aosplan

SOURCE = Path(aosplan.__file__).parent
FILES = sorted(SOURCE.rglob("*.py"))
HEAVY = {"numpy", "scipy", "pyproj", "shapely", "laspy", "matplotlib", "pydantic", "rasterio"}
RICH = {"rich"}


def module_name(path):
    parts = ("aosplan", *path.relative_to(SOURCE).with_suffix("").parts)
    return ".".join(part for part in parts if part != "__init__")


def tree_of(path):
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def loaded(code):
    """Modules that a fresh interpreter has after running some code, and has not without it."""
    script = (
        "import sys\nbefore = set(sys.modules)\n"
        f"{code}\n"
        "found = sorted(set(sys.modules) - before)\n"
        "import json\nprint(json.dumps(found), file=sys.stderr)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=60
    )
    return set(json.loads(done.stderr.splitlines()[-1]))


def packages(code):
    return {name.partition(".")[0] for name in loaded(code)}


def command(*arguments):
    return f"from aosplan.cli.app import run\nassert run({list(arguments)!r}) == 0"


# What is loaded


def test_import_aosplan_loads_nothing_heavy():
    assert not packages("import aosplan") & (HEAVY | RICH | {"typer", "click"})


def test_import_aosplan_loads_none_of_the_slow_standard_modules():
    slow = {"typing", "dataclasses", "importlib.metadata", "inspect", "re", "argparse", "json"}
    assert not loaded("import aosplan") & slow


def test_import_aosplan_loads_no_module_of_its_own():
    assert {name for name in loaded("import aosplan") if name.startswith("aosplan")} == {"aosplan"}


def test_the_version_costs_no_more_than_the_import():
    assert loaded("import aosplan; aosplan.__version__") == loaded("import aosplan")


@pytest.mark.parametrize(
    "arguments",
    [
        ("plan", "--altitude", "40", "--json"),
        ("plan", "--altitude", "40", "--vhat", "0.95", "--optimize", "time", "--json"),
        ("plan", "--altitude", "40", "--grid", "lanes", "--out", "csv:-"),
        ("plan", "--altitude", "40", "--quiet"),
        ("visibility", "--density", "0.5", "--samples", "50", "--dhat", "1", "--json"),
        ("cameras", "--json"),
        ("drones", "--json"),
        ("scenes", "--json"),
        ("formats", "--json"),
        ("scene", "paper-forest", "--json"),
    ],
    ids=" ".join,
)
def test_data_without_files_loads_neither_heavy_modules_nor_rich(arguments):
    assert not packages(command(*arguments)) & (HEAVY | RICH)


OF_A_PLAIN_PLAN = """
    advice answer batteries camera choose cli cli.app cli.options cli.output cli.plan defaults
    doubts draft errors flight geodesy geometry layout mission models models.elementwise models.equations
    models.sites models.uniform options pattern planning presets presets.cameras presets.scenes
    problem quantities request resolve roots route scene solve spiral summary task track trigger
"""
"""Modules that a plan of presets takes.  Each costs every plan about a hundredth: one more belongs
here only if every plan needs it, and is otherwise imported in the function that does."""


def test_a_plain_plan_loads_only_what_every_plan_needs():
    line = ("plan", "--altitude", "40", "--vhat", "0.98", "--defaults", "none", "--json")
    found = {name for name in loaded(command(*line)) if name.startswith("aosplan.")}
    assert sorted(found) == [f"aosplan.{name}" for name in OF_A_PLAIN_PLAN.split()]


def test_a_plan_of_saved_voxels_loads_no_scipy(tmp_path):
    from forests import STANDS, clumped_forest

    from aosplan.scenes.correlogram import correlogram
    from aosplan.scenes.files.voxel_file import (
        Stand,
        stand_npz,
    )

    stand = Stand.of(clumped_forest(STANDS["spruce"]))
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
def test_tables_load_rich_but_nothing_heavy(arguments):
    found = packages(command(*arguments))
    assert found >= RICH
    assert not found & HEAVY


@pytest.mark.parametrize("arguments", [("--help",), ("--version",), ()], ids=" ".join)
def test_plain_help_loads_nothing_past_typer(arguments):
    found = packages(command(*arguments))
    assert "typer" in found
    assert not found & (HEAVY | RICH)


def test_plain_help_loads_no_command():
    found = loaded(command("--help"))
    assert not {name for name in found if name.startswith("aosplan.")} - {
        "aosplan.cli",
        "aosplan.cli.app",
        "aosplan.errors",
    }


@pytest.mark.parametrize(
    "name", ["plan", "simulate", "visibility", "scene", "export", "cameras", "schema"]
)
def test_help_of_a_command_loads_nothing_past_typer(name):
    assert not packages(command(name, "--help")) & (HEAVY | RICH)


def test_a_place_loads_pyproj_and_nothing_else_that_is_heavy():
    found = packages(command("plan", "--altitude", "40", "--origin", "48,14", "--json"))
    assert "pyproj" in found
    assert not found & (HEAVY - {"pyproj"})


@pytest.mark.parametrize(
    "name", ["csv", "geojson", "kml", "litchi", "qgc_plan", "waypoints", "wpml"]
)
def test_small_missions_are_written_without_numpy(name, tmp_path):
    line = ("plan", "--altitude", "40", "--origin", "48,14", "--quiet")
    found = packages(command(*line, "--out", f"{name}:{tmp_path / 'grid'}"))
    assert not found & ((HEAVY | RICH) - {"pyproj"})


def test_a_line_that_is_flown_on_loads_nothing_heavy():
    line = ("plan", "--altitude", "40", "--grid", "line", "--line-length", "300", "--json")
    assert not packages(command(*line)) & (HEAVY | RICH)


def test_a_request_file_loads_pydantic_and_nothing_else_that_is_heavy(tmp_path):
    (tmp_path / "r.toml").write_text("altitude = 40\n")
    found = packages(command("plan", str(tmp_path / "r.toml"), "--json"))
    assert "pydantic" in found
    assert not found & (HEAVY - {"pydantic"})


def test_a_scene_file_loads_nothing_heavy(tmp_path):
    place, text = tmp_path / "s.toml", 'name = "s"\ndensity = 0.01\noccluder_size_m = 0.2\n'
    place.write_text(text + "volume_base_m = 2.0\nvolume_height_m = 9\n")
    assert (
        not packages(command("plan", "--altitude", "40", "--scene", str(place), "--json")) & HEAVY
    )


def test_an_error_loads_nothing_heavy():
    code = "from aosplan.cli.app import run\nassert run(['plan', '--altitude', '10']) == 2"
    assert not packages(code) & (HEAVY | RICH)


def test_equations_of_scalars_need_no_numpy():
    code = "import aosplan\nassert aosplan.visibility(0.5, 7, 8, 1.0) > 0.7"
    assert "numpy" not in packages(code)


# Public names


def test_the_public_names_are_pinned():
    assert sorted(aosplan.__all__) == [
        "AosplanError",
        "Camera",
        "InfeasibleError",
        "Layer",
        "LayeredScene",
        "Plan",
        "PlanRequest",
        "RequestError",
        "UniformScene",
        "__version__",
        "aperture",
        "integrated_density",
        "lattice_shortfall",
        "layered_shortfall",
        "layered_visibility",
        "mean_squared_error",
        "normalized_visibility",
        "plan",
        "positions_shortfall",
        "required_samples",
        "slice_density",
        "transparency",
        "visibility",
        "visibility_limits",
        "visibility_shortfall",
    ]


CONTRACT = [
    "integrated_density",
    "slice_density",
    "visibility",
    "mean_squared_error",
    "normalized_visibility",
    "visibility_shortfall",
    "visibility_limits",
    "required_samples",
    "aperture",
    "layered_visibility",
    "positions_shortfall",
    "plan",
    "PlanRequest",
    "Plan",
]


@pytest.mark.parametrize("name", CONTRACT)
def test_every_name_of_the_contract_is_public(name):
    assert name in aosplan.__all__
    assert getattr(aosplan, name) is not None


def test_public_names_resolve_on_use_and_nothing_else_does():
    for name in aosplan.__all__:
        assert getattr(aosplan, name) is not None
    assert set(dir(aosplan)) == set(aosplan.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'nonsense'"):
        _ = aosplan.nonsense


def test_public_names_are_themselves_whatever_was_imported_before():
    # A submodule lands in its package under its own name when it is imported.
    modules = [module_name(path) for path in FILES if path.name != "__main__.py"]
    code = (
        "from importlib import import_module\nimport aosplan\n"
        f"for name in {modules!r}:\n    import_module(name)\n"
        "from types import ModuleType\n"
        "print([n for n in aosplan.__all__ if isinstance(getattr(aosplan, n), ModuleType)])\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.stdout == "[]\n", done.stderr


def test_type_checkers_see_the_names_that_programs_see():
    for node in ast.walk(tree_of(SOURCE / "__init__.py")):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            seen = {alias.asname for part in node.body for alias in part.names}
            break
    assert seen == set(aosplan.__all__) - {"__version__"}


def test_the_package_says_that_it_is_typed():
    assert (SOURCE / "py.typed").exists()


# Source files


def imports_of(path):
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parts = module_name(path).split(".")
                keep = len(parts) - node.level + (path.name == "__init__.py")
                base = ".".join([*parts[:keep], *([base] if base else [])])
            yield base
            yield from (f"{base}.{alias.name}" for alias in node.names)


SIMULATORS = [path for path in FILES if "simulate" in path.relative_to(SOURCE).parts]


def test_simulators_know_nothing_of_the_models_they_judge():
    for path in SIMULATORS:
        if path.stem == "compare":  # the one place where theory and experiment meet
            continue
        banned = [
            n
            for n in imports_of(path)
            if n.startswith(("aosplan.models.model", "aosplan.solver.solve_monotone"))
        ]
        assert banned == [], path


def test_simulators_load_no_model_by_way_of_another_module():
    names = [module_name(path) for path in SIMULATORS if path.stem != "compare"]
    assert len(names) >= 7
    found = loaded("\n".join(f"import {name}" for name in names))
    assert not {
        name
        for name in found
        if name.startswith(("aosplan.models.model", "aosplan.solver.solve_monotone"))
    }


LOW = ("errors", "quantities", "camera", "geometry", "roots", "pattern", "spiral", "flight")
LOW = (*LOW, "files")


@pytest.mark.parametrize("name", LOW)
def test_the_ground_floor_imports_nothing_from_above(name):
    allowed = {"aosplan", *(f"aosplan.{low}" for low in LOW), "aosplan.scenes.scene"}
    for imported in imports_of(SOURCE / f"{name}.py"):
        if imported.startswith("aosplan"):
            assert ".".join(imported.split(".")[:2]) in allowed, imported


def test_only_the_command_line_imports_typer_and_rich():
    for path in FILES:
        if "cli" not in path.relative_to(SOURCE).parts:
            found = {name.partition(".")[0] for name in imports_of(path)}
            assert not found & {"typer", "rich", "click"}, path


def test_nothing_but_the_command_line_imports_the_command_line():
    for path in FILES:
        relative = path.relative_to(SOURCE).parts
        if "cli" not in relative and relative != ("__main__.py",):
            assert not [n for n in imports_of(path) if n.startswith("aosplan.cli")], path


def test_imports_of_the_project_are_absolute():
    for path in FILES:
        for node in ast.walk(tree_of(path)):
            assert not (isinstance(node, ast.ImportFrom) and node.level), path


PRESETS = ("camera/presets.py", "flight/drones.py", "scenes/presets.py")
"""Tables of data: as long as what they list."""


@pytest.mark.parametrize("path", FILES, ids=module_name)
def test_no_file_is_longer_than_500_lines(path):
    if path.relative_to(SOURCE).as_posix() in PRESETS:
        pytest.skip("a table of data")
    assert len(path.read_text(encoding="utf-8").splitlines()) < 500


def public_definitions(path):
    """Public functions, classes and methods of a file, by name."""

    def walk(node, prefix):
        for child in ast.iter_child_nodes(node):
            if not isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
                continue
            if child.name.startswith("_"):
                continue
            yield f"{prefix}{child.name}", child
            if isinstance(child, ast.ClassDef):
                yield from walk(child, f"{prefix}{child.name}.")

    yield from walk(tree_of(path), "")


@pytest.mark.parametrize("path", FILES, ids=module_name)
def test_every_public_function_and_class_has_a_docstring(path):
    bare = [name for name, node in public_definitions(path) if not ast.get_docstring(node)]
    assert bare == []


@pytest.mark.parametrize("path", [path for path in FILES if path.stat().st_size], ids=module_name)
def test_every_module_has_a_docstring(path):
    assert ast.get_docstring(tree_of(path))


@pytest.mark.parametrize("path", FILES, ids=module_name)
def test_no_file_points_outside_the_project(path):
    text = path.read_text(encoding="utf-8")
    for place in ("../shared", f"{Path(__file__).parents[2]}/", "/tmp/", "/home/"):
        assert place not in text


@pytest.mark.parametrize("path", FILES, ids=module_name)
def test_every_module_imports_by_itself(path):
    # Cycles show when a module happens to be the first.
    if path.name == "__main__.py":
        pytest.skip("runs the program")
    code = f"import {module_name(path)}"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stderr
