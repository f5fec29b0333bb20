"""Figure of the density of occluders by height, and of the share of the ground that they hide from
vertically above.
"""

from __future__ import annotations

import math
from itertools import accumulate
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import RequestError
from aosplan.show.figures.style import entitle, legend_below

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from aosplan.planning.loaded_scene import LoadedScene
    from aosplan.scenes.voxels import VoxelVolume
    from aosplan.show.figures.style import Theme


class DensityFigure(NamedTuple):
    """Densities of layers from bottom to top, and the share of the ground that is hidden by the
    occluders above the bottom of each layer.

    `independent` is this share if the layers are independent. `measured` is this share in the
    voxels, or None without voxels. `hidden_pulses` is the share of the energy of the laser pulses
    that does not reach the ground. Its three values are computed with all energy in the first
    returns, with the estimated energy of each return, and with all energy in the last returns. This
    share is for the angles of the pulses, `pulses_zenith_deg`. It is None if the opacity is not
    from pulses.
    """

    scene: str
    bottom_m: tuple[float, ...]
    top_m: tuple[float, ...]
    density: tuple[float, ...]
    independent: tuple[float, ...]
    measured: tuple[float, ...] | None
    voxel_m: float | None
    hidden_pulses: tuple[float, float, float] | None = None
    pulses_zenith_deg: tuple[float, float] | None = None

    @property
    def title(self) -> str:
        """Title of the figure, in one line."""
        return f"Density by height of {self.scene}"

    def description(self) -> str:
        """Description of the layers as text."""
        densest = max(range(len(self.density)), key=self.density.__getitem__)
        text = (
            f"{self.title}: {len(self.density)} layers from {self.bottom_m[0]:.3g} to "
            f"{self.top_m[-1]:.3g} m. The densest lies at {self.bottom_m[densest]:.3g} to "
            f"{self.top_m[densest]:.3g} m and fills {self.density[densest]:.3g} of its "
            f"plane. Together, the layers hide {self.independent[0]:.3g} of the ground from "
            "above if the layers are independent"
        )
        if self.measured is None:
            return f"{text}."
        text += f", and {self.measured[0]:.3g} as measured, in voxels of {self.voxel_m:g} m."
        if self.hidden_pulses is None:
            return text
        first, weighted, last = self.hidden_pulses
        return (
            f"{text} Of the energy of the laser {_slanted(self)}, {weighted:.3g} does not "
            f"reach the ground ({first:.3g} if all energy were in the first returns, {last:.3g} "
            "if all energy were in the last returns)."
        )

    def document(self) -> dict[str, Any]:
        """The numbers as plain values."""
        return self._asdict()


def density_of(found: LoadedScene) -> DensityFigure:
    """Densities of a scene: of the slices of its voxels if it has voxels, otherwise of its layers.

    Raises
    ------
    RequestError
        If the scene is empty.
    """
    scene, volume = found.scene, found.volume
    if scene.integrated_density == 0.0:
        raise RequestError(f"scene '{scene.name}' is empty: no occluder is above the ground")
    measured = None
    if volume is None:
        rows = [(layer.bottom_m, layer.top_m, layer.density) for layer in scene.slices()]
    else:
        import numpy as np

        size = volume.slice_height_m
        filled = np.flatnonzero(volume.slice_densities)
        low, high = int(filled[0]), int(filled[-1]) + 1
        rows = [
            (k * size, (k + 1) * size, float(volume.slice_densities[k])) for k in range(low, high)
        ]
        hidden = np.zeros(volume.occupied.shape[1:], dtype=np.bool_)
        shares = []
        for k in range(high - 1, low - 1, -1):
            hidden |= volume.occupied[k]
            shares.append(float(hidden.mean()))
        measured = tuple(reversed(shares))
    bottom, top, density = zip(*rows, strict=True)
    clear = accumulate(
        math.log1p(-share) if share < 1.0 else -math.inf for share in reversed(density)
    )
    independent = tuple(reversed([0.0 - math.expm1(log) for log in clear]))
    return DensityFigure(
        scene.title or scene.name,
        bottom,
        top,
        density,
        independent,
        measured,
        None if volume is None else volume.slice_height_m,
        _hidden_pulses(volume),
        None if volume is None or volume.opacity is None else volume.opacity.zenith_deg,
    )


def _hidden_pulses(volume: VoxelVolume | None) -> tuple[float, float, float] | None:
    opacity = None if volume is None else volume.opacity
    if opacity is None or opacity.gap_weighted is None:
        return None
    assert opacity.gap_first is not None  # Either all three values are known, or none is known.
    assert opacity.gap_last is not None
    return 1.0 - opacity.gap_first, 1.0 - opacity.gap_weighted, 1.0 - opacity.gap_last


def _slanted(shown: DensityFigure) -> str:
    # If the opacity is from pulses, the angles of the pulses are known.
    assert shown.pulses_zenith_deg is not None
    low, high = shown.pulses_zenith_deg
    return f"pulses {low:.0f}° to {high:.0f}° off nadir"


def draw(figure: Figure, shown: DensityFigure, theme: Theme) -> None:
    """Draw bars of densities by height, and beside them the hidden share by height."""
    left, right = figure.subplots(1, 2, sharey=True)
    heights = [top - bottom for bottom, top in zip(shown.bottom_m, shown.top_m, strict=True)]
    thin = len(heights) > 40
    left.barh(
        shown.bottom_m,
        shown.density,
        heights,
        align="edge",
        color=theme.data[2],
        edgecolor=theme.data[2] if thin else theme.background,
        linewidth=0.0 if thin else 0.6,
    )
    left.set(
        xlabel="density $D$ of a layer",
        ylabel="height above ground [m]",
        ylim=(0.0, shown.top_m[-1] * 1.04),
    )
    left.set_xlim(0.0, max(shown.density) * 1.06)
    edges = [*shown.bottom_m, shown.top_m[-1]]
    right.plot(
        [*shown.independent, 0.0], edges, "--", color=theme.data[0], label="independent layers"
    )
    if shown.measured is not None:
        right.plot(
            [*shown.measured, 0.0],
            edges,
            "-",
            color=theme.data[1],
            label=f"voxels of {shown.voxel_m:g} m, as measured",
        )
    if shown.hidden_pulses is not None:
        first, weighted, last = shown.hidden_pulses
        right.errorbar(
            [weighted],
            [0.02 * shown.top_m[-1]],
            xerr=[[weighted - last], [first - weighted]],
            fmt="o",
            color=theme.data[2],
            capsize=3.0,
            label=f"{_slanted(shown)}: last returns, weighted, first returns",
        )
    right.set(xlabel="share of the ground that is hidden", xlim=(0.0, 1.0))
    legend_below(figure, right.get_legend_handles_labels()[0])
    entitle(figure, shown.title)
