"""Scene files: TOML or JSON tables that become scenes.

Apart from the other documents, so that a plan from a saved scene pays for nothing else.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from pydantic import Field

from aosplan.checked import Document, Finite, checked
from aosplan.errors import RequestError
from aosplan.files import read_table
from aosplan.scene import Layer, LayeredScene, Scene, UniformScene

if TYPE_CHECKING:
    from collections.abc import Iterable

    from aosplan.models.correlogram import Correlogram

UNIFORM = ("density", "occluder_size_m", "volume_base_m", "volume_height_m")
STEMS = ("stems_per_hectare", "crown_diameter_m", "leaf_area_index")


class LayerDocument(Document):
    """One slice of a scene."""

    bottom_m: Finite
    top_m: Finite
    density: Finite
    occluder_size_m: Finite


class CorrelogramDocument(Document):
    """Correlation of two views by direction and lag (camera offset over altitude)."""

    lags: list[Finite]
    directions_deg: list[Finite]
    rho: list[list[Finite]]
    reach: Finite


class SceneDocument(Document):
    """A scene file: one uniform volume, layers, or the numbers of an inventory.

    What `aosplan scene --json` prints is one too: what follows from the rest is not read.
    """

    name: str
    title: str = ""
    source: str = ""
    assumed: str = ""
    density: Finite | None = None
    integrated_density: Finite | None = None
    occluder_size_m: Finite | None = None
    volume_base_m: Finite | None = None
    volume_height_m: Finite | None = None
    stems_per_hectare: Finite | None = None
    crown_diameter_m: Finite | None = None
    leaf_area_index: Finite | None = None
    voxel_m: Finite | None = None
    layers: list[LayerDocument] | None = None
    correlogram: CorrelogramDocument | None = None
    density_by_offset: list[list[Finite]] | None = None

    # Of the statistics, not read.
    schema_: Any = Field(default=None, alias="schema")
    version: Any = None
    kind: Any = None
    mean_density: Any = None
    canopy_top_m: Any = None
    baseline_curve: Any = None
    density_by_angle: Any = None
    edges: Any = None
    ground: Any = None
    min_height_m: Any = None
    points: Any = None
    points_per_m2: Any = None
    plot_m: Any = None
    warnings: Any = None


class SceneFile(NamedTuple):
    """What a scene file holds: a scene, and a correlogram's table where one was measured."""

    scene: Scene
    table: dict[str, Any] | None
    path: str

    def correlogram(self) -> Correlogram | None:
        """The correlogram, which is checked now: a plan by another model does not pay for it."""
        if self.table is None:
            return None
        from aosplan.correlogram_file import correlogram_from

        return correlogram_from(self.table, self.path)


def read_scene_file(path: str) -> SceneFile:
    """A scene from a TOML or JSON file.

    Raises
    ------
    RequestError
        Where the file is not a scene.
    """
    document = checked(SceneDocument, read_table(path), path)
    return SceneFile(_scene(document, path), _table(document), path)


def _scene(document: SceneDocument, path: str) -> Scene:
    words = {word: getattr(document, word) for word in ("name", "title", "source", "assumed")}
    if document.layers is not None:
        _check_alone(document, path, "layers", (*STEMS, *UNIFORM))
        return LayeredScene(
            layers=tuple(Layer(**layer.model_dump()) for layer in document.layers),
            measured_density=document.integrated_density,
            voxel_m=document.voxel_m,
            **words,
        )
    if any(getattr(document, name) is not None for name in STEMS):
        _check_alone(document, path, "stems and crowns", ("density", "integrated_density"))
        numbers = _numbers(document, path, (*STEMS, "volume_base_m", "volume_height_m"))
        from aosplan.inventory import inventory_scene

        scene = inventory_scene(document.name, occluder_size_m=document.occluder_size_m, **numbers)
        return replace(scene, **{word: text for word, text in words.items() if text})
    numbers = _numbers(document, path, ("occluder_size_m", "volume_base_m", "volume_height_m"))
    if document.density is None and document.integrated_density is None:
        raise _lacking(path, "density")
    return UniformScene(
        density=document.density,
        given_integrated_density=document.integrated_density,
        **numbers,
        **words,
    )


def _table(document: SceneDocument) -> dict[str, Any] | None:
    """A correlogram with the densities that stand beside it."""
    if document.correlogram is None:
        return None
    table = document.correlogram.model_dump() | {
        "density": document.integrated_density,
        "density_by_offset": document.density_by_offset,
    }
    return {name: value for name, value in table.items() if value is not None}


def _check_alone(document: SceneDocument, path: str, kind: str, others: Iterable[str]) -> None:
    both = [name for name in others if getattr(document, name) is not None]
    if both:
        raise RequestError(
            f"scene file '{path}' has {kind} and {' and '.join(both)}",
            "a scene is uniform, layered or an inventory: keep one of them",
        )


def _numbers(document: SceneDocument, path: str, names: Iterable[str]) -> dict[str, Any]:
    numbers = {name: getattr(document, name) for name in names}
    missing = [name for name, number in numbers.items() if number is None]
    if missing:
        raise _lacking(path, ", ".join(missing))
    return numbers


def _lacking(path: str, what: str) -> RequestError:
    return RequestError(
        f"scene file '{path}' lacks {what}",
        "a uniform scene has density, occluder_size_m, volume_base_m and volume_height_m; a "
        f"layered one [[layers]]; an inventory {', '.join(STEMS)}, volume_base_m and "
        "volume_height_m",
    )
