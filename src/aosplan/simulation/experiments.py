"""Experiments: independent samples of a forest, each with the same views.

The index and the seed determine a sample. `counts` and `images` therefore describe the same sample.
All samples of an experiment have the same distribution and are independent.
"""

from __future__ import annotations

import math
from itertools import count
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from aosplan.errors import RequestError
from aosplan.scenes.occlusion import PlotWindow
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
"""Number of pixels along the edge of an occluder in a noise pattern.  Shifts of views may be
fractions of a pixel.
"""

NOISE_CELLS = 40
"""Number of occluders along each side of a noise pattern."""

PATCH_OCCLUDERS = {"telecentric": 50.0, "perspective": 150.0}
"""Largest side of a patch of targets, in occluders.  A patch is at least a few occluders wide."""

FEW_OCCLUDERS = 10.0

PLOT_VOXELS = 1 << 25
"""Approximate limit of the number of voxels of a plot, with three voxels per occluder edge. It also
limits the size of patches.
"""

TARGETS_AN_OCCLUDER = {"telecentric": 6, "perspective": 3}
"""Approximate number of targets per edge of the smallest occluder.  Telecentric rays are rounded to
this lattice.
"""

MOST_VIEWS = 10_000
"""Largest number of views of a simulation."""

MOST_RAYS = 10_000_000_000
"""Largest product of the numbers of views and of targets. A simulation with this product takes
about a minute.  Patches are made smaller if the product would otherwise be larger.
"""

FEWEST_SAMPLES = 16
"""Smallest number of samples. With fewer samples, the standard error is not reliable."""

PICTURE_PX = 300
"""Number of targets along the shorter side of a picture.  Pictures need more targets than counts
do.
"""

STEEPEST = 1.0
"""Largest slope of a ray along each axis.  With this slope, a ray crosses at most one more voxel
per slice.
"""

PLOT_BLOCKS = 4
"""Number of blocks along each side of a real plot.  The variation between blocks gives the standard
error.
"""


def check_views(samples: int | None) -> None:
    """Refuse to simulate more than `MOST_VIEWS` samples."""
    if samples is not None and samples > MOST_VIEWS:
        raise RequestError(
            f"the plan has {samples} samples, but at most {MOST_VIEWS} can be simulated",
            "give a smaller --samples or --max-samples",
        )


class Experiment(Protocol):
    """The methods of an experiment that a comparison uses."""

    @property
    def one_plot(self) -> bool:
        """Whether the samples are the blocks of one plot. Their number is then limited."""

    def samples(self) -> Iterator[Counts]:
        """Yield the counts of one sample after the other: without end, or for all blocks of one
        plot.
        """

    def images(self) -> tuple[Blocked, Blocked]:
        """Number of blocked views at each target of the first sample: among all views, and for the
        middle view alone.
        """


class NoiseExperiment(NamedTuple):
    """Averaged noise patterns.  Positions are x and y in units of occluders, shape (N, 2)."""

    seed: int
    density: float
    positions: Positions
    one_plot: bool = False

    def samples(self) -> Iterator[Counts]:
        """Yield counts of one random pattern after the other."""
        for index in count():
            yield counts_of(self._blocked(index), len(self.positions))

    def images(self) -> tuple[Blocked, Blocked]:
        """Number of blocked views of the first pattern, among all views and for the middle view
        alone.
        """
        return self._blocked(0), self._blocked(0, only=middle_of(self.positions))

    def _blocked(self, index: int, only: int | None = None) -> Blocked:
        side = round(NOISE_PX * NOISE_CELLS)
        shifts = self.positions * NOISE_PX
        rng = generator(self.seed, index)
        return blocked_views(rng, self.density, NOISE_PX, shifts, (side, side), only=only)


class ForestExperiment(NamedTuple):
    """Views over random volumes.

    Attributes
    ----------
    seed
        Random seed of all volumes.
    make
        ``make(rng, size_m)`` returns a periodic volume, with heights above the focal plane.
    positions_m
        Camera positions, x and y from the centre of the pattern, shape (N, 2).
    altitude_m, top_m
        Heights of the cameras and of the highest occluder above the focal plane.
    occluder_size_m
        Size of the smallest occluder.
    view
        ``perspective``: targets are in `area_m`; each volume has one patch of this area.
        ``telecentric``: each target is at the centre of its own aperture.
    area_m
        Size of the target area along x and y; it is centred below the pattern.
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
        """Yield counts of a patch of targets below one random volume after the other."""
        for index in count():
            views, positions = self._sample(index)
            yield views.counts(positions)

    def images(self) -> tuple[Blocked, Blocked]:
        """Number of blocked views of the first patch, among all views and for the middle view
        alone.
        """
        views, positions = self._sample(0, least_px=PICTURE_PX)
        middle = middle_of(self.positions_m)
        return views.blocked_views(positions), views.blocked_views(positions[[middle]])

    def check(self) -> None:
        """Refuse plans that volumes of voxels cannot represent.

        Raises
        ------
        RequestError
            If rays are too oblique for voxels, or if occluders are too small for a volume.
        """
        aside = self.area_m if self.view == "perspective" else (0.0, 0.0)
        steepest = max(
            (np.abs(self.positions_m).max(axis=0) + 0.5 * np.array(aside)) / self.altitude_m
        )
        if steepest > STEEPEST:
            raise RequestError(
                f"rays are up to {math.degrees(math.atan(steepest)):.0f} degrees off nadir, "
                "but only rays up to 45 degrees can be simulated",
                "plan a smaller grid (--max-aperture), or give --forest noise",
            )
        width, depth = (self._plot_m(axis, side) for axis, side in enumerate(self.patch_m))
        if width * depth * self.top_m > MOST_VOXELS * self.occluder_size_m**3:
            raise RequestError(
                f"occluders of {self.occluder_size_m:g} m are too small for a volume of "
                f"{width:.4g} x {depth:.4g} x {self.top_m:.4g} m",
                "plan a smaller grid (--max-aperture), or give --forest noise",
            )

    @property
    def patch_m(self) -> tuple[float, float]:
        """Size of a patch. A patch is the target area, or one of the equal parts into which the
        area is divided.
        """
        return self._patches()[0]

    def _patches(self) -> tuple[tuple[float, float], tuple[int, int]]:
        """Size of a patch, and number of patches in the target area along x and y."""
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
        """Largest distance along x and y between the rays of two views of a target, at the top of
        the canopy.
        """
        x, y = (np.ptp(self.positions_m, axis=0) * (self.top_m / self.altitude_m)).tolist()
        return x, y

    def _sample(self, index: int, least_px: int = 0) -> tuple[VoxelViews, Positions]:
        """Views of a patch, and camera positions relative to the centre of the patch.

        The patch has at least `least_px` targets along each side, unless there would be too many
        targets per voxel.
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
        """Size of the plot along an axis. The periodic plot is so large that neither a single ray
        nor the rays of two views of a patch meet two copies of the same tree.
        """
        reach, rise = self._reach()[axis], self.top_m / self.altitude_m
        if self.view == "telecentric":
            return patch_m + reach + self.occluder_size_m
        slanted = 0.5 * (self.area_m[axis] * rise + reach)
        return max(patch_m, patch_m * (1.0 - rise) + reach, slanted) + self.occluder_size_m


class PlotExperiment(NamedTuple):
    """One real plot with all its targets.  The blocks of the plot are the samples."""

    views: VoxelViews
    positions_m: Positions
    one_plot: bool = True

    def samples(self) -> Iterator[Counts]:
        """Yield counts of the blocks of the plot."""
        for window in blocks(self.views.window, PLOT_BLOCKS, PLOT_BLOCKS):
            yield self.views.within(window).counts(self.positions_m)

    def images(self) -> tuple[Blocked, Blocked]:
        """Numbers of blocked views of each target of the plot: of all views, and of the middle
        view.
        """
        middle = self.positions_m[[middle_of(self.positions_m)]]
        return self.views.blocked_views(self.positions_m), self.views.blocked_views(middle)


def middle_of(positions: Positions) -> int:
    """Index of the position nearest to the centre, or of the first of several equally near
    positions.
    """
    apart = positions - 0.5 * (positions.min(axis=0) + positions.max(axis=0))
    # The distances are rounded. Equal distances are then equal on every machine.
    return int(np.round((apart * apart).sum(axis=1), 9).argmin())


def _middle_window(volume: VoxelVolume, per_voxel: int, size_m: tuple[float, float]) -> PlotWindow:
    """The targets in a rectangle in the middle of a plot."""
    _, rows, columns = volume.occupied.shape
    pitch = volume.voxel_m / per_voxel
    across, along = (
        min(max(math.floor(size / pitch + 0.5), 1), voxels * per_voxel)
        for size, voxels in zip(size_m, (columns, rows), strict=True)
    )
    return PlotWindow(
        (rows * per_voxel - along) // 2, (columns * per_voxel - across) // 2, along, across
    )
