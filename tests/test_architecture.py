"""Rules about imports, public names, and the form of source files."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

import aosplan

SOURCE = Path(aosplan.__file__).parent
FILES = sorted(SOURCE.rglob("*.py"))

# Chapters and their order

CHAPTERS = (
    ("camera", "mission"),
    ("grid",),
    ("scenes", "flight"),
    ("models", "areas"),
    ("solver",),
    ("planning",),
    ("maps",),
    ("simulation", "postflight"),
    ("sweeps",),
    ("show",),
    ("cli", "api"),
)
"""Chapters, line by line.  A chapter may import from chapters in the lines above its line, but not
from chapters in its own line or in lines below.
"""

ROOT = (
    "crs",
    "errors",
    "files",
    "geodesy",
    "messages",
    "numerics",
    "plugins",
    "units",
    "validation",
    "xml_text",
)
"""Modules directly below ``aosplan``.  All chapters may import them, and they import no chapter."""

FACES = ("aosplan", "aosplan.__main__")
"""The modules with the public names and with the entry of the program.  They are not part of the
order.
"""


def module_name(path):
    parts = ("aosplan", *path.relative_to(SOURCE).with_suffix("").parts)
    return ".".join(part for part in parts if part != "__init__")


@cache
def tree_of(path):
    return ast.parse(path.read_text(encoding="utf-8"))


MODULES = {module_name(path): path for path in FILES}


@cache
def imports_of(path):
    """Modules that a file imports, with the numbers of the lines.  Imports in functions and for
    type checkers are included.
    """
    found = []
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.Import):
            found += [(alias.name, node.lineno) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{path}:{node.lineno}: imports of the project are absolute"
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                found.append((inner if inner in MODULES else node.module, node.lineno))
    return tuple(found)


def chapter_of(module):
    """The chapter of a module, or ``root`` for a module directly below ``aosplan``."""
    first = module.split(".")[1]
    return first if (SOURCE / first).is_dir() else "root"


def inner_imports():
    """Every import of one module of the project by another module."""
    for module, path in MODULES.items():
        if module not in FACES:
            for imported, line in imports_of(path):
                if imported in MODULES and imported not in FACES:
                    yield module, imported, f"{path.relative_to(SOURCE)}:{line} imports {imported}"


def test_imports_keep_the_order_of_the_chapters():
    rank = {"root": -1} | {name: i for i, line in enumerate(CHAPTERS) for name in line}
    wrong = [
        place
        for module, imported, place in inner_imports()
        if (chapter := chapter_of(module)) != (other := chapter_of(imported))
        and rank[other] >= rank[chapter]
    ]
    assert wrong == []


def test_no_modules_import_each_other_in_a_circle():
    imported_by = {}
    for module, imported, _ in inner_imports():
        if module != imported:
            imported_by.setdefault(module, set()).add(imported)
    left = dict.fromkeys(MODULES)
    while free := [name for name in left if not imported_by.get(name, set()) & left.keys()]:
        for name in free:
            del left[name]
    assert list(left) == []


def test_the_package_contains_only_the_chapters_and_the_root_modules():
    modules = {path.stem for path in SOURCE.glob("*.py")} - {"__init__", "__main__"}
    assert modules == set(ROOT)
    folders = {path.name for path in SOURCE.iterdir() if (path / "__init__.py").exists()}
    assert folders == {name for line in CHAPTERS for name in line}


def test_no_package_or_root_module_has_the_name_of_a_public_function():
    # If a submodule is imported, its package gets an attribute with the name of the submodule.
    names = {module.split(".")[1] for module in MODULES if module not in FACES}
    assert not names & {*aosplan.__all__}


def test_simulators_do_not_import_the_models():
    # Only `compare` and `compare_search` import both models and simulations.
    simulators = {m for m in MODULES if m.startswith("aosplan.simulation")}
    reached, waiting = (
        set(),
        simulators
        - {
            "aosplan.simulation.compare",
            "aosplan.simulation.compare_search",
        },
    )
    assert len(waiting) >= 7
    while waiting:
        module = waiting.pop()
        reached.add(module)
        waiting |= (
            {to for to, _ in imports_of(MODULES[module]) if to in MODULES} - reached - {*FACES}
        )
    assert not {m for m in reached if m.startswith(("aosplan.models", "aosplan.solver"))}


def test_only_the_command_line_imports_typer():
    for module, path in MODULES.items():
        found = {name.partition(".")[0] for name, _ in imports_of(path)}
        if not module.startswith(("aosplan.cli", "aosplan.show.text")):
            assert not found & {"typer", "rich", "click"}, path


# Public names


def test_the_public_names_are_pinned():
    assert sorted(aosplan.__all__) == [
        "AosplanError",
        "Camera",
        "InfeasibleError",
        "Integral",
        "Layer",
        "LayeredScene",
        "PaperFigure",
        "Plan",
        "PlanRequest",
        "RequestError",
        "Review",
        "Simulation",
        "Stand",
        "Sweep",
        "Thinning",
        "Tradeoff",
        "UniformScene",
        "__version__",
        "aperture",
        "export",
        "integrate",
        "integrated_density",
        "lattice_shortfall",
        "layered_shortfall",
        "layered_visibility",
        "mean_squared_error",
        "normalized_visibility",
        "paper_figure",
        "plan",
        "positions_shortfall",
        "read_scene",
        "required_samples",
        "review",
        "simulate",
        "slice_density",
        "sweep",
        "thin",
        "tradeoff",
        "transparency",
        "visibility",
        "visibility_limits",
        "visibility_shortfall",
    ]


def test_only_public_names_are_resolved_on_use():
    for name in aosplan.__all__:
        assert getattr(aosplan, name) is not None
    assert set(dir(aosplan)) == set(aosplan.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'nonsense'"):
        _ = aosplan.nonsense


def test_type_checkers_see_the_names_that_programs_see():
    for node in ast.walk(tree_of(SOURCE / "__init__.py")):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            seen = {alias.asname for part in node.body for alias in part.names}
            break
    assert seen == set(aosplan.__all__) - {"__version__"}


def test_the_package_has_a_py_typed_marker():
    assert (SOURCE / "py.typed").exists()


# Source files

TABLES = ("camera/presets.py", "flight/drones.py", "planning/options.py", "scenes/presets.py")
"""Files with tables of data.  Their length is not limited."""


def test_no_file_is_longer_than_500_lines():
    lengths = {
        path.relative_to(SOURCE).as_posix(): len(path.read_text(encoding="utf-8").splitlines())
        for path in FILES
    }
    assert {name: n for name, n in lengths.items() if n > 500 and name not in TABLES} == {}


def public_definitions(path):
    """Public functions, classes and methods of a file, by name."""

    def walk(node, prefix):
        for child in ast.iter_child_nodes(node):
            if not isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
                continue
            if child.name.startswith("_"):
                continue
            if "overload" in map(ast.unparse, child.decorator_list):
                continue  # The function after the overloads has the docstring.
            yield f"{prefix}{child.name}", child
            if isinstance(child, ast.ClassDef):
                yield from walk(child, f"{prefix}{child.name}.")

    yield from walk(tree_of(path), "")


def private_names_taken(path):
    """Private names of other modules that a file imports, uses or replaces, with the numbers of the
    lines.
    """
    if not re.search(r"(?<!\w)_[A-Za-z]", path.read_text(encoding="utf-8")):
        return
    tree, modules = tree_of(path), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("aosplan"):
            for alias in node.names:
                if alias.name.startswith("_") and not alias.name.startswith("__"):
                    yield alias.name, node.lineno
                if f"{node.module}.{alias.name}" in MODULES:
                    modules.add(alias.asname or alias.name)
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            of, name = node.value.id, node.attr
        elif (
            isinstance(node, ast.Call) and len(node.args) > 1 and isinstance(node.args[0], ast.Name)
        ):
            of, name = node.args[0].id, getattr(node.args[1], "value", "")
        else:
            continue
        if of in modules and str(name).startswith("_") and not str(name).startswith("__"):
            yield name, node.lineno


def test_no_test_uses_private_names_of_a_module():
    tests = sorted(Path(__file__).parent.rglob("*.py"))
    taken = [
        f"{path.name}:{line} {name}" for path in tests for name, line in private_names_taken(path)
    ]
    assert len(tests) > 80
    assert taken == []


@cache
def defined_in(module):
    """Names at the top level of a module, by definition, import or assignment."""
    names = set()
    for node in ast.walk(tree_of(MODULES[module])):
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            names.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            names |= {alias.asname or alias.name for alias in node.names}
    return names


def names_missed(path):
    """Names that a script uses from modules of the project, although they do not exist there."""
    tree, modules = tree_of(path), {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("aosplan"):
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                if inner in MODULES:
                    modules[alias.asname or alias.name] = inner
                elif node.module not in MODULES or (
                    node.module != "aosplan" and alias.name not in defined_in(node.module)
                ):
                    yield inner, node.lineno
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Attribute)
            and isinstance(node.value, ast.Name)
            and node.value.id in modules
            and not node.attr.startswith("__")
            and node.attr not in defined_in(modules[node.value.id])
        ):
            yield f"{modules[node.value.id]}.{node.attr}", node.lineno


@pytest.mark.parametrize("folder", ["benchmarks", "docs", "examples"])
def test_names_that_scripts_import_exist(folder):
    # Most scripts take too long for tests. Therefore only the names that they use are checked.
    scripts = sorted((Path(__file__).parents[1] / folder).rglob("*.py"))
    missed = [f"{path.name}:{line} {name}" for path in scripts for name, line in names_missed(path)]
    assert len(scripts) > 5
    assert missed == []


def test_every_module_and_everything_public_has_a_docstring():
    bare = [module for module, path in MODULES.items() if not ast.get_docstring(tree_of(path))]
    bare += [
        f"{module}.{name}"
        for module, path in MODULES.items()
        for name, node in public_definitions(path)
        if not ast.get_docstring(node)
    ]
    assert bare == []


def test_no_file_points_outside_the_project():
    outside = ("../shared", f"{Path(__file__).parents[2]}/", "/tmp/", "/home/")
    for path in FILES:
        text = path.read_text(encoding="utf-8")
        assert not [place for place in outside if place in text], path
