"""Statistics of a scene as plain values, and the conversion of scenes to files."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from aosplan import __version__
from aosplan.camera.disparity import Slab, baseline_curve
from aosplan.messages import SCHEMA
from aosplan.scenes.scene import UniformScene

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aosplan.messages import Message
    from aosplan.scenes.correlogram import Correlogram
    from aosplan.scenes.scene import Scene
    from aosplan.scenes.voxels import VoxelVolume


def statistics_document(
    scene: Scene,
    warnings: Sequence[Message] = (),
    volume: VoxelVolume | None = None,
    correlogram: Correlogram | None = None,
) -> dict[str, Any]:
    """Occluder statistics of a scene, which ``scene --json`` prints.

    Parameters
    ----------
    scene
        Uniform or layered.  A uniform scene is listed in slices that are one occluder thick.
    warnings
        Warnings of the reader.
    volume
        The voxels of the scene, if there are any.
    correlogram
        The correlogram of the scene, if there is one.
    """
    layers = scene.slices()
    document: dict[str, Any] = {
        "schema": SCHEMA,
        "version": __version__,
        "name": scene.name,
        "title": scene.title,
        "kind": scene.kind,
        "source": scene.source,
        "assumed": scene.assumed,
        "layers": [layer._asdict() for layer in layers],
        "integrated_density": scene.integrated_density,
        "mean_density": _mean_density(scene),
        "canopy_top_m": scene.canopy_top_m,
        "baseline_curve": [list(knot) for knot in baseline_curve(_fine_slabs(scene))],
        "warnings": [warning._asdict() for warning in warnings],
    }
    if volume is not None:
        document |= {
            "voxel_m": volume.slice_height_m,
            "min_height_m": volume.min_height_m,
            "ground": volume.ground,
            "points": volume.points,
            "points_per_m2": volume.points_per_m2,
            "plot_m": list(volume.size_m),
        }
        if volume.opacity is not None:
            document["opacity"] = volume.opacity.to_document()
    if correlogram is not None:
        from aosplan.scenes.files.correlogram_table import correlogram_table, density_by_angle

        document["edges"] = correlogram.edges
        table = correlogram_table(correlogram)
        document["density_by_angle"] = density_by_angle(correlogram)
        document["density_by_offset"] = table.pop("density_by_offset")
        del table["density"]  # This value is already in the document, as the density of the scene.
        document["correlogram"] = table
    return document


def _fine_slabs(scene: Scene) -> tuple[Slab, ...]:
    """The slabs of the coverage rule.  A uniform volume is cut into slabs that are one occluder
    thick.
    """
    if not isinstance(scene, UniformScene):
        return scene.slabs()
    return tuple(
        Slab(layer.bottom_m, layer.top_m, layer.occluder_size_m, 1.0) for layer in scene.slices()
    )


def _mean_density(scene: Scene) -> float:
    """Mean density of the slices from the lowest occluder to the highest, weighted by thickness."""
    layers = scene.slices()
    if not layers:
        return 0.0
    filled = sum(layer.density * (layer.top_m - layer.bottom_m) for layer in layers)
    return filled / (layers[-1].top_m - layers[0].bottom_m)
