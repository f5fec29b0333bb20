"""Experiments: independent samples of a forest, each flown over by the same views.

An experiment answers for its sample `index`, whatever was asked before: `counts` over its targets,
and `images` of the same.  All samples of an experiment are drawn alike, and independently.
"""

from __future__ import annotations

import math
from itertools import count
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from aosplan.errors import RequestError
from aosplan.scenes.occlusion import Window
from aosplan.simulation.forests import MOST_VOXELS, VOXELS_AN_OCCLUDER, generator
from aosplan.simulation.noise_patterns import blocked_views, counts_of
from aosplan.simulation.voxel_views import VoxelViews, blocks

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from aosplan.scenes.occlusion import ViewKind
    from aosplan.scenes.voxels import VoxelVolume
    from aosplan.simulation.moments import Counts

    Positions = NDArray[np.float64]
    Blocked = NDArray[np.int32]

NOISE_PX = 8.0
"""Pixels along the edge of an occluder in a noise pattern; views move by any part of them."""

NOISE_CELLS = 40
"""Occluders along either side of a noise pattern."""

PATCH_OCCLUDERS = {"telecentric": 50.0, "perspective": 150.0}
"""Occluders along either side of a patch of targets at most, and at least a few."""

FEW_OCCLUDERS = 10.0

PLOT_VOXELS = 1 << 25
"""Voxels for which patches are small enough, a third of an occluder each."""

TARGETS_AN_OCCLUDER = {"telecentric": 6, "perspective": 3}
"""Targets along the edge of the smallest occluder, about; telecentric rays are rounded to them."""

MOST_RAYS = 10_000_000_000
"""Views times targets of one experiment: about a minute.  Patches of targets shrink to keep it."""

FEWEST_SAMPLES = 16
"""Samples that every experiment takes: fewer do not tell their own standard error."""

PICTURE_PX = 300
"""Targets along the shorter side of a picture, which wants more of them than counts do."""

STEEPEST = 1.0
"""Largest slope of a ray along either axis: it is to meet one more voxel a slice, not more."""

PLOT_BLOCKS = 4
"""Blocks along either side of a real plot, whose scatter is its standard error."""


class Experiment(Protocol):
    """What a comparison asks of an experiment."""

    @property
    def one_plot(self) -> bool:
        """Whether the samples are the blocks of one plot, and end with it."""

    def samples(self) -> Iterator[Counts]:
        """Counts of one sample after the other; without end, or all blocks of one plot."""

    def images(self) -> tuple[Blocked, Blocked]:
        """Blocked views of the first sample: of all views, and of the middle one alone."""


class NoiseExperiment(NamedTuple):
    """Averaged noise patterns: positions in units of occluders, x and y, shape (N, 2)."""

    seed: int
    density: float
    positions: Positions
    one_plot: bool = False

    def samples(self) -> Iterator[Counts]:
        """One random pattern after the other."""
        for index in count():
            yield counts_of(self._blocked(index), len(self.positions))

    def images(self) -> tuple[Blocked, Blocked]:
        """Blocked views of the first pattern: of all views, and of the middle one alone."""
        return self._blocked(0), self._blocked(0, only=middle_of(self.positions))

    def _blocked(self, index: int, only: int | None = None) -> Blocked:
        side = round(NOISE_PX * NOISE_CELLS)
        shifts = self.positions * NOISE_PX
        rng = generator(self.seed, index)
        return blocked_views(rng, self.density, NOISE_PX, shifts, (side, side), only=only)


class ForestExperiment(NamedTuple):
    """Generated volumes, flown over.

    Attributes
    ----------
    seed
        Of all volumes.
    make
        ``make(rng, size_m)``: a volume that wraps, heights from the focal plane.
    positions_m
        Of the cameras, x and y from the middle of the pattern, shape (N, 2).
    altitude_m, top_m
        Of the cameras and of the highest occluder, above the focal plane.
    occluder_size_m
        Of the smallest occluder.
    view
        ``perspective``: targets are those of `area_m`, a patch of it in each volume.
        ``telecentric``: each target in the middle of its own aperture.
    area_m
        Target area along x and y, its middle below that of the pattern.
    """

    seed: int
    make: Callable[[np.random.Generator, tuple[float, float]], VoxelVolume]
    positions_m: Positions
    altitude_m: float
    top_m: float
    occluder_size_m: float
    view: ViewKind
    area_m: tuple[float, float]
    one_plot: bool = False

    def samples(self) -> Iterator[Counts]:
        """A patch of targets below one random volume after the other."""
        for index in count():
            views, positions = self._sample(index)
            yield views.counts(positions)

    def images(self) -> tuple[Blocked, Blocked]:
        """Blocked views of the first patch: of all views, and of the middle one alone."""
        views, positions = self._sample(0, least_px=PICTURE_PX)
        middle = middle_of(self.positions_m)
        return views.blocked_views(positions), views.blocked_views(positions[[middle]])

    def check(self) -> None:
        """Refuse what volumes of voxels cannot show.

        Raises
        ------
        RequestError
            If rays are more oblique than voxels are, or occluders too small for any volume.
        """
        aside = self.area_m if self.view == "perspective" else (0.0, 0.0)
        steepest = max(
            (np.abs(self.positions_m).max(axis=0) + 0.5 * np.array(aside)) / self.altitude_m
        )
        if steepest > STEEPEST:
            raise RequestError(
                f"rays are up to {math.degrees(math.atan(steepest)):.0f} degrees off nadir, and no "
                "more than 45 are simulated",
                "a smaller aperture, or --forest noise",
            )
        width, depth = (self._plot_m(axis, side) for axis, side in enumerate(self.patch_m))
        if width * depth * self.top_m > MOST_VOXELS * self.occluder_size_m**3:
            raise RequestError(
                f"occluders of {self.occluder_size_m:g} m are too small for a volume of "
                f"{width:.4g} x {depth:.4g} x {self.top_m:.4g} m",
                "a smaller aperture, or --forest noise",
            )

    @property
    def patch_m(self) -> tuple[float, float]:
        """Size of a patch: the target area, or an equal part of it."""
        return self._patches()[0]

    def _patches(self) -> tuple[tuple[float, float], tuple[int, int]]:
        """Size of a patch, and how many make up the target area along x and y."""
        o, rays = self.occluder_size_m, 2 * FEWEST_SAMPLES * len(self.positions_m)
        most = max(math.sqrt(MOST_RAYS / rays), 1.0) * o / TARGETS_AN_OCCLUDER[self.view]
        room = math.sqrt(PLOT_VOXELS / self.top_m * (o / VOXELS_AN_OCCLUDER) ** 3)
        size = max(
            min(PATCH_OCCLUDERS[self.view] * o, room - max(self._reach())), FEW_OCCLUDERS * o
        )
        size = min(size, most)
        if self.view == "telecentric":
            return (size, size), (1, 1)
        number = [math.ceil(side / size) for side in self.area_m]
        return (self.area_m[0] / number[0], self.area_m[1] / number[1]), (number[0], number[1])

    def _reach(self) -> tuple[float, float]:
        """How far apart two views of one target pass the top of the canopy, along x and y."""
        x, y = (np.ptp(self.positions_m, axis=0) * (self.top_m / self.altitude_m)).tolist()
        return x, y

    def _sample(self, index: int, least_px: int = 0) -> tuple[VoxelViews, Positions]:
        """Views of a patch, and the cameras' positions from the patch's middle.

        The patch has at least so many targets along either side, within reason.
        """
        rng = generator(self.seed, index)
        patch, number = self._patches()
        at = [
            (place + 0.5) / parts * side - 0.5 * side
            for place, parts, side in zip(
                rng.integers(number).tolist(), number, self.area_m, strict=True
            )
        ]
        size = [self._plot_m(axis, patch[axis]) for axis in (0, 1)]
        volume = self.make(rng, (size[0], size[1]))
        share = volume.voxel_m / self.occluder_size_m
        per_voxel = min(max(round(TARGETS_AN_OCCLUDER[self.view] * share), 1), 4)
        per_voxel = max(per_voxel, min(math.ceil(least_px * volume.voxel_m / min(patch)), 16))
        views = VoxelViews(
            volume,
            self.altitude_m,
            view=self.view,
            targets_per_voxel=per_voxel,
            window=_middle_window(volume, per_voxel, patch),
        )
        moved = 0.0 if self.view == "telecentric" else np.array(at)
        return views, self.positions_m - moved

    def _plot_m(self, axis: int, patch_m: float) -> float:
        """Size of a plot on which no two views of a patch, nor one ray, meet a tree twice."""
        reach, rise = self._reach()[axis], self.top_m / self.altitude_m
        if self.view == "telecentric":
            return patch_m + reach + self.occluder_size_m
        slanted = 0.5 * (self.area_m[axis] * rise + reach)
        return max(patch_m, patch_m * (1.0 - rise) + reach, slanted) + self.occluder_size_m


class PlotExperiment(NamedTuple):
    """One real plot, all of its targets, its blocks taken for samples."""

    views: VoxelViews
    positions_m: Positions
    one_plot: bool = True

    def samples(self) -> Iterator[Counts]:
        """The blocks of the plot, one after the other."""
        for window in blocks(self.views.window, PLOT_BLOCKS, PLOT_BLOCKS):
            yield self.views.within(window).counts(self.positions_m)

    def images(self) -> tuple[Blocked, Blocked]:
        """Blocked views of the plot: of all views, and of the middle one alone."""
        middle = self.positions_m[[middle_of(self.positions_m)]]
        return self.views.blocked_views(self.positions_m), self.views.blocked_views(middle)


def middle_of(positions: Positions) -> int:
    """The position nearest to the middle of all, the first of several."""
    apart = positions - 0.5 * (positions.min(axis=0) + positions.max(axis=0))
    # Rounded, so that equal distances are equal on every machine.
    return int(np.round((apart * apart).sum(axis=1), 9).argmin())


def _middle_window(volume: VoxelVolume, per_voxel: int, size_m: tuple[float, float]) -> Window:
    """The targets in the middle of a plot, over a size along x and y."""
    _, rows, columns = volume.occupied.shape
    pitch = volume.voxel_m / per_voxel
    across, along = (
        min(max(math.floor(size / pitch + 0.5), 1), voxels * per_voxel)
        for size, voxels in zip(size_m, (columns, rows), strict=True)
    )
    return Window(
        (rows * per_voxel - along) // 2, (columns * per_voxel - across) // 2, along, across
    )
