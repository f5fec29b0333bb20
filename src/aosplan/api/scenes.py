"""Scenes that are read once and used for many plans: `read_scene`."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

from aosplan.api.summarized import Summarized, columns_of, warnings_text
from aosplan.planning.loaded_scene import LoadedScene, load_scene
from aosplan.planning.request import request_from
from aosplan.units import percent

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from matplotlib.axes import Axes


@dataclass(frozen=True, repr=False)
class Stand(Summarized, LoadedScene):
    """A scene.  It can be passed to `aosplan.plan` as the argument `scene`.

    It has the attributes of `aosplan.planning.loaded_scene.LoadedScene`: `scene` (a `UniformScene`
    or `LayeredScene`), `volume` (the voxels of a point cloud) and `warnings`.
    """

    options: Mapping[str, Any] = field(default_factory=dict)
    """The options with which the scene was read, including its name."""

    def document(self) -> dict[str, Any]:
        """Occluder statistics as plain values, which ``aosplan scene --json`` prints."""
        from aosplan.scenes.summary import statistics_document

        return statistics_document(self.scene, self.warnings, self.volume, self._correlogram())

    def columns(self) -> dict[str, list[Any]]:
        """The layers as columns: bottom and top [m], density, size of the occluders [m]."""
        return columns_of([layer._asdict() for layer in self.scene.slices()])

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> None:
        """Write a scene file that can be read quickly: ``.toml``, or ``.npz`` with the voxels.

        Raises
        ------
        RequestError
            If the extension is neither ``.toml`` nor ``.npz``, if the file exists and `force` is
            false, or if the extension is ``.npz`` and the scene has no voxels.
        """
        from aosplan.files import write_all
        from aosplan.planning.saved_scene import scene_bytes

        target = os.fspath(path)
        write_all({target: scene_bytes(self, self._correlogram(), target)}, force=force)

    def summary(self) -> tuple[str, dict[str, str]]:
        """The result as text: a headline and named values."""
        scene = self.scene
        bottom = min((slab.bottom_m for slab in scene.slabs()), default=0.0)
        facts = {
            "Hidden": f"{percent(scene.integrated_density)} of the ground, seen from straight above",
            "Heights": f"{bottom:.3g} to {scene.canopy_top_m:.3g} m above ground",
        }
        if self.volume is not None:
            x, y = self.volume.size_m
            facts["Voxels"] = f"{x:.4g} x {y:.4g} m, {self.volume.voxel_m:g} m a voxel"
        return f"{scene.title or scene.name} ({scene.kind})", facts | warnings_text(self.warnings)

    def plot(self, ax: Axes | None = None, *, kind: str = "density") -> Any:
        """Draw the scene with Matplotlib.

        Parameters
        ----------
        ax
            Axes to draw on; a new figure by default.
        kind
            ``density``, ``baseline-curve`` or ``correlogram``.  The kinds ``density`` and
            ``correlogram`` have two panels and always make a new figure.

        Returns
        -------
        ax
            The axes; an array of them for figures with several panels.
        """
        from aosplan.show.figures.axes import plotted
        from aosplan.show.figures.draw import KINDS
        from aosplan.show.figures.sources import shown_of_scene
        from aosplan.units import one_of

        kinds = [name for name, each in KINDS.items() if each.source == "scene"]
        chosen = KINDS[one_of(kinds)(kind, "kind")]
        return plotted(chosen, shown_of_scene(chosen, self), ax)

    def _correlogram(self) -> Any:
        if self.correlogram is not None or self.volume is None:
            return self.correlogram
        from aosplan.scenes.correlogram import correlogram

        return correlogram(self.volume)


def read_scene(
    path: str | os.PathLike[str],
    *more: str | os.PathLike[str],
    voxel: float | None = None,
    ground: str | None = None,
    min_height: float | None = None,
    crop: str | os.PathLike[str] | None = None,
    units: str | None = None,
    opacity: str | None = None,
    leaf_size: float | None = None,
    trajectory: str | os.PathLike[str] | None = None,
    crown_base: float | None = None,
    occluder_size: float | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Stand:
    """Read a scene: a point cloud, a canopy height raster, a scene file or a preset.

    Parameters
    ----------
    path
        A file, a folder of point clouds, a pattern such as ``tiles/*.laz``, or the name of a preset.
    *more
        More point clouds of the same stand.
    voxel, ground, min_height, crop, units, opacity, leaf_size, trajectory, crown_base, occluder_size
        The options of ``aosplan scene``, with underscores instead of hyphens.  Lengths are in
        metres.
    progress
        Function that is called with the number of points read and the total.

    Raises
    ------
    RequestError
        If the file or preset does not exist, or cannot be read.

    Examples
    --------
    >>> import aosplan
    >>> stand = aosplan.read_scene("paper-forest")
    >>> round(stand.scene.integrated_density, 3)
    0.567
    >>> aosplan.plan(altitude=40, scene=stand).solution.pattern.samples
    50
    """
    given = {
        "voxel": voxel,
        "ground": ground,
        "min_height": min_height,
        "crop": None if crop is None else os.fspath(crop),
        "units": units,
        "opacity": opacity,
        "leaf_size": leaf_size,
        "trajectory": None if trajectory is None else os.fspath(trajectory),
        "crown_base": crown_base,
        "occluder_size": occluder_size,
    }
    options = {name: value for name, value in given.items() if value is not None}
    options["scene"] = os.fspath(path)
    # A request needs an altitude. The scene does not depend on the altitude.
    found = load_scene(
        request_from(options | {"altitude": 1.0}),
        progress=progress,
        also=[os.fspath(each) for each in more],
    )
    return Stand(
        **{each.name: getattr(found, each.name) for each in fields(found)}, options=options
    )
