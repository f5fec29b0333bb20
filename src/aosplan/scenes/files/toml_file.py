"""Scene files in TOML and JSON.

A quick check decides whether a table is valid.  A valid table is converted to a scene directly.
For an invalid table, pydantic produces the error message (`aosplan.scenes.files.scene_schema`).  It
is imported only then, because the import takes as long as a whole plan.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import RequestError
from aosplan.files import read_table
from aosplan.scenes.scene import Layer, LayeredScene, Scene, UniformScene

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from aosplan.scenes.correlogram import Correlogram

    Table = Mapping[str, Any]

WORDS = ("name", "title", "source", "assumed")
UNIFORM = ("density", "occluder_size_m", "volume_base_m", "volume_height_m")
STEMS = ("stems_per_hectare", "crown_diameter_m", "leaf_area_index")
NUMBERS = (*UNIFORM, *STEMS, "integrated_density", "voxel_m")
TABLES = ("layers", "correlogram", "density_by_offset")


class SceneFile(NamedTuple):
    """Content of a scene file: a scene, and the table of a correlogram if the file has one."""

    scene: Scene
    table: dict[str, Any] | None
    path: str

    def correlogram(self) -> Correlogram | None:
        """The correlogram. Its table is checked only here, because models without a correlogram
        should not spend time on the check.
        """
        if self.table is None:
            return None
        from aosplan.scenes.files.correlogram_table import correlogram_from

        return correlogram_from(self.table, self.path)


def read_scene_file(path: str) -> SceneFile:
    """Read a scene from a TOML or JSON file.

    Raises
    ------
    RequestError
        If the file is not a scene.
    """
    table: Table = read_table(path)
    if not is_sound(table):
        from aosplan.scenes.files.scene_schema import SceneDocument
        from aosplan.validation import checked

        table = checked(SceneDocument, table, path).model_dump(exclude_none=True)
    return SceneFile(_scene(table, path), _correlogram(table), path)


def is_sound(table: Table) -> bool:
    """Whether the names and types in a table are certainly those of a valid scene file."""
    layers, correlogram = table.get("layers", []), table.get("correlogram", _NONE)
    return (
        isinstance(table.get("name"), str)
        and table.keys() <= {*WORDS, *NUMBERS, *TABLES}
        and all(isinstance(table.get(word, ""), str) for word in WORDS)
        and all(_is_number(table.get(name, 0)) for name in NUMBERS)
        and isinstance(layers, list)
        and all(isinstance(layer, dict) and layer.keys() == _LAYER for layer in layers)
        and all(_is_number(number) for layer in layers for number in layer.values())
        and isinstance(correlogram, dict)
        and correlogram.keys() - {"interior"} == _NONE.keys()
        and _are_interiors(correlogram.get("interior", []))
        and _are_numbers(correlogram["lags"])
        and _are_numbers(correlogram["directions_deg"])
        and _are_rows(correlogram["rho"])
        and _is_number(correlogram["reach"])
        and _are_rows(table.get("density_by_offset", []))
    )


_LAYER = set(Layer._fields)
_NONE: dict[str, Any] = {"lags": [], "directions_deg": [], "rho": [], "reach": 0}


def _is_number(value: Any) -> bool:
    # The types are compared exactly, because bool is a subclass of int. An int has to be checked,
    # because it may be too large for a float.
    return (type(value) is float and math.isfinite(value)) or (
        type(value) is int and abs(value) < 2**53
    )


def _are_numbers(values: Any) -> bool:
    return isinstance(values, list) and all(_is_number(value) for value in values)


def _are_rows(rows: Any) -> bool:
    return isinstance(rows, list) and all(_are_numbers(row) for row in rows)


def _are_interiors(tables: Any) -> bool:
    return isinstance(tables, list) and all(
        isinstance(table, dict)
        and table.keys() == {"density", "rho", "density_by_offset"}
        and _is_number(table["density"])
        and _are_rows(table["rho"])
        and _are_rows(table["density_by_offset"])
        for table in tables
    )


def _scene(table: Table, path: str) -> Scene:
    words = {word: table.get(word, "") for word in WORDS}
    numbers = {name: float(table[name]) for name in NUMBERS if name in table}
    if "layers" in table:
        _check_alone(table, path, "layers", (*STEMS, *UNIFORM))
        return LayeredScene(
            layers=tuple(
                Layer(**{name: float(number) for name, number in layer.items()})
                for layer in table["layers"]
            ),
            measured_density=numbers.get("integrated_density"),
            voxel_m=numbers.get("voxel_m"),
            **words,
        )
    if any(name in table for name in STEMS):
        _check_alone(table, path, "stems and crowns", ("density", "integrated_density"))
        needed = _picked(numbers, path, (*STEMS, "volume_base_m", "volume_height_m"))
        from aosplan.scenes.inventory import inventory_scene

        size = numbers.get("occluder_size_m")
        scene = inventory_scene(words["name"], occluder_size_m=size, **needed)
        return replace(scene, **{word: text for word, text in words.items() if text})
    needed = _picked(numbers, path, ("occluder_size_m", "volume_base_m", "volume_height_m"))
    if "density" not in numbers and "integrated_density" not in numbers:
        raise _lacking(path, "density")
    return UniformScene(
        density=numbers.get("density"),
        given_integrated_density=numbers.get("integrated_density"),
        **needed,
        **words,
    )


def _correlogram(table: Table) -> dict[str, Any] | None:
    """The table of a correlogram, with densities that are elsewhere in the document added to it."""
    if "correlogram" not in table:
        return None
    beside = {"density": "integrated_density", "density_by_offset": "density_by_offset"}
    found = {name: table[there] for name, there in beside.items() if there in table}
    return {**table["correlogram"], **found}


def _check_alone(table: Table, path: str, kind: str, others: Iterable[str]) -> None:
    both = [name for name in others if name in table]
    if both:
        raise RequestError(
            f"scene file '{path}' has {kind} and {' and '.join(both)}",
            "a scene is uniform, layered or an inventory; give the values of only one of these",
        )


def _picked(numbers: dict[str, float], path: str, names: Iterable[str]) -> dict[str, Any]:
    missing = [name for name in names if name not in numbers]
    if missing:
        raise _lacking(path, ", ".join(missing))
    return {name: numbers[name] for name in names}


def _lacking(path: str, what: str) -> RequestError:
    return RequestError(
        f"scene file '{path}' lacks {what}",
        "a uniform scene has density, occluder_size_m, volume_base_m and volume_height_m; a "
        f"layered scene has [[layers]]; an inventory has {', '.join(STEMS)}, volume_base_m and "
        "volume_height_m",
    )


def scene_toml(scene: Scene, correlogram: Correlogram | None = None) -> bytes:
    """A scene with its statistics as a TOML file.  Plans can be made from this file without the
    cloud.

    Parameters
    ----------
    scene
        Uniform or layered.
    correlogram
        The correlogram of the scene, if there is one.  The measured model uses it.
    """
    import tomli_w

    table: dict[str, Any] = {"name": scene.name}
    for word in ("title", "source", "assumed"):
        if getattr(scene, word):
            table[word] = getattr(scene, word)
    if isinstance(scene, UniformScene):
        density = scene.density
        table |= (
            {"density": density}
            if density is not None
            else {"integrated_density": scene.integrated_density}
        )
        table |= {
            "occluder_size_m": scene.occluder_size_m,
            "volume_base_m": scene.volume_base_m,
            "volume_height_m": scene.volume_height_m,
        }
        return tomli_w.dumps(table).encode()
    if scene.measured_density is not None:
        table["integrated_density"] = scene.measured_density
    if scene.voxel_m is not None:
        table["voxel_m"] = scene.voxel_m
    head = tomli_w.dumps(table)
    layers = tomli_w.dumps({"layers": [layer._asdict() for layer in scene.layers]})
    if correlogram is None:
        return f"{head}\n{layers}".encode()
    from aosplan.scenes.files.correlogram_table import correlogram_table

    tables = correlogram_table(correlogram)

    def rows(name: str, of: Mapping[str, Any] = tables) -> str:
        return f"{name} = [\n" + "".join(f"    {row},\n" for row in of[name]) + "]\n"

    interior = "".join(
        f"\n[[correlogram.interior]]\ndensity = {each['density']}\n"
        f"{rows('density_by_offset', each)}{rows('rho', each)}"
        for each in tables["interior"]
    )

    return (
        f"{head}\n# One line per direction, one entry per lag (camera offset divided by "
        f"altitude).\n{rows('density_by_offset')}\n{layers}\n[correlogram]\n"
        f"directions_deg = {tables['directions_deg']}\nlags = {tables['lags']}\n"
        f"reach = {tables['reach']}\n{rows('rho')}{interior}"
    ).encode()
