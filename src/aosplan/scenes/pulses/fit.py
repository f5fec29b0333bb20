"""Fit of a volume of opaque and empty cells to the pulses of a point cloud. This module executes
all steps in order.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.errors import RequestError
from aosplan.scenes.opacity import Opacity, is_sparse
from aosplan.scenes.pulses import attenuation, clean, grouping, realise, sensor_track, trace
from aosplan.scenes.voxels import FACE, HalfStand

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from aosplan.scenes.files.las import PointFile
    from aosplan.scenes.pulses.grouping import Pulses
    from aosplan.scenes.pulses.returns import Returns
    from aosplan.scenes.pulses.trajectory import Trajectory

    Floats = NDArray[np.float64]

MOST_RETURNS = 5_000_000
"""Largest number of returns whose pulses are all traced.  If there are more returns, only a random
share of the pulses is traced.
"""

MOST_VOXELS = 100_000_000
FEWEST_PULSES = 300
FEWEST_A_M2 = 0.3
LEAST_COMPLETE = 0.5
FEWEST_THROUGH = 500
"""Smallest number of pulses that cross the whole canopy within the plot. If there are fewer such
pulses, other pulses are also used to find the scale.
"""

LEAST_COSINE = 0.2
"""Smallest cosine of the zenith angle of a used pulse.  More oblique pulses are not representative
of views from above.
"""

WIDEST_M = 0.5
"""Largest distance of a first return from the line between the last return and the sensor."""

FOLDS = 4
"""Number of parts into which the pulses are divided.  Each part is predicted from the other
parts.
"""

FOLD_SEED = 1
HALF_SEEDS = 2, 3
"""Random seeds for the cells of the two halves of the pulses. Each half consists of alternate
parts.
"""

DENSE_PER_M = np.float32(2.0)
"""Attenuation of dense foliage [1/m]. One metre of it transmits a seventh of the light."""

ENERGIES = ("first", "weighted", "last")


class UnsoundPulsesError(Exception):
    """The opacity cannot be found from the pulses.  The message gives the reason."""


class PulseVolume(NamedTuple):
    """Result of the fit of pulses.

    Attributes
    ----------
    occupied
        Opaque cells, shape (slices, rows, columns).
    bounds
        Opaque cells for two extreme assumptions: the first return of each pulse has all its energy,
        or the last return has all of it.
    cell_m
        Edge of a cell.
    opacity
        The method by which the opacity was found.
    halves
        Opaque cells from each random half of the pulses; None if they were not requested.
    """

    occupied: NDArray[np.bool_]
    bounds: tuple[NDArray[np.bool_], NDArray[np.bool_]]
    cell_m: float
    opacity: Opacity
    halves: tuple[HalfStand, HalfStand] | None = None


class Beams(NamedTuple):
    """Usable pulses, with their directions and energies.

    Attributes
    ----------
    returns, pulses
        The returns, and the pulses that they form.
    energy
        Shape (n,): energy of each return.
    low
        Shape (n,): whether a return is below the cut. Such a return is treated as ground.
    to_sensor
        Shape (3, P): unit vectors from the last return of each pulse to the sensor.
    kind
        Energies of the returns: ``intensity`` or ``equal``.
    """

    returns: Returns
    pulses: Pulses
    energy: Floats
    low: NDArray[np.bool_]
    to_sensor: Floats
    kind: str

    def take(self, which: NDArray[np.bool_]) -> Beams:
        """Some of the pulses, by index or mask."""
        return self._replace(pulses=self.pulses.take(which), to_sensor=self.to_sensor[:, which])

    def gaps(self) -> dict[str, Floats]:
        """Share of each pulse's energy that reaches the ground, for each of `ENERGIES`, shape (P,)."""
        reached = grouping.sums_of(self.pulses, self.energy * self.low)
        whole = grouping.sums_of(self.pulses, self.energy)
        return {
            "first": self.low[self.pulses.first].astype(np.float64),
            "weighted": reached / whole,
            "last": self.low[self.pulses.last].astype(np.float64),
        }

    @property
    def zenith_deg(self) -> Floats:
        """Zenith angle of each pulse."""
        angles: Floats = np.degrees(np.arccos(np.clip(self.to_sensor[2], -1.0, 1.0)))
        return angles


class AttenuationField(NamedTuple):
    """Attenuation of a stand.

    Attributes
    ----------
    rate
        λ [1/m], shape (slices, rows, columns), before scaling.
    contrast
        Exponent of the optical depths of columns, which `rate` contains.
    scales
        Scale factors of λ, for each of `ENERGIES`.
    gaps
        Share of the energy that reaches the ground, for each of `ENERGIES`.
    strengths
        Strengths of the shrinkages.
    sampled
        Share of the voxels between cut and top that pulses crossed.
    halves
        λ from each half of the pulses, before scaling.
    passed
        Voxels through which at least one pulse of either half has passed.
    """

    rate: NDArray[np.float32]
    contrast: float
    scales: dict[str, float]
    gaps: dict[str, float]
    strengths: attenuation.Strengths
    sampled: float
    halves: tuple[NDArray[np.float32], NDArray[np.float32]]
    passed: NDArray[np.bool_]


def volume_from_pulses(
    files: Sequence[PointFile],
    grid: trace.VoxelGrid,
    origin_m: Floats,
    *,
    leaf_m: float | None = None,
    trajectory: Trajectory | None = None,
    points: int = 0,
    halves: bool = False,
) -> PulseVolume:
    """Fit the attenuation of a stand to its pulses, and draw opaque cells from it.

    Parameters
    ----------
    files
        Point clouds of the stand.
    grid
        Voxels above the ground. The number of slices in it is ignored, because it is determined
        from the pulses.
    origin_m
        Shape (3,): the corner of the plot, which is the origin of the grid.
    leaf_m
        Edge of the cells; None for the default, which is larger on large plots.
    trajectory
        Positions of the sensor, if they are known.
    points
        Number of returns of the plot.  If it is large, only a share of the pulses is traced.
    halves
        Whether opaque cells are also drawn for each half of the pulses, with separate seeds.

    Raises
    ------
    UnsoundPulsesError
        If the pulses cannot be used.
    """
    share = min(MOST_RETURNS / max(points, 1), 1.0)
    sparse = is_sparse(points, grid.size_m[0] * grid.size_m[1])
    beams, grid = sound_beams(files, grid, origin_m, trajectory, share, sparse=sparse)
    if math.prod(grid.shape) > MOST_VOXELS:
        raise UnsoundPulsesError(
            f"the stand has more than the {MOST_VOXELS} voxels for which pulses can be fitted"
        )
    field = fitted_field(beams, grid)
    size_m = grid.size_m
    if leaf_m is not None and leaf_m > min(size_m):
        raise RequestError(
            f"--leaf-size {leaf_m:g} m is larger than the plot, {size_m[0]:.4g} x {size_m[1]:.4g} m"
        )
    leaf_m = leaf_m or realise.leaf_size_for(size_m, grid.slices, grid.voxel_m)
    middle, dense, thin = realise.realised(
        field.rate,
        grid.voxel_m,
        grid.cut_m,
        leaf_m,
        size_m,
        [field.scales[name] for name in ("weighted", "first", "last")],
    )
    zenith = beams.zenith_deg
    opacity = Opacity(
        "pulses",
        gap_first=field.gaps["first"],
        gap_weighted=field.gaps["weighted"],
        gap_last=field.gaps["last"],
        energy=beams.kind,
        zenith_deg=(float(np.quantile(zenith, 0.01)), float(np.quantile(zenith, 0.99))),
        sampled_share=field.sampled,
        pulses=len(beams.pulses),
        lines=int(np.unique(beams.returns.line[beams.pulses.first]).size),
        voxel_m=grid.voxel_m,
        leaf_size_m=leaf_m,
        scale=field.scales["weighted"],
        scale_first=field.scales["first"],
        scale_last=field.scales["last"],
        shrinkage=field.strengths.voxel,
        seed=realise.SEED,
    )
    scale = [field.scales["weighted"]]
    stands = [
        HalfStand(
            *(
                realise.realised(each, grid.voxel_m, grid.cut_m, leaf_m, size_m, scale, seed)[0]
                for each in (rate, np.where(field.passed, rate, np.maximum(rate, DENSE_PER_M)))
            )
        )
        for rate, seed in zip(field.halves if halves else (), HALF_SEEDS, strict=False)
    ]
    return PulseVolume(
        middle, (dense, thin), leaf_m, opacity, (stands[0], stands[1]) if halves else None
    )


def sound_beams(
    files: Sequence[PointFile],
    grid: trace.VoxelGrid,
    origin_m: Floats,
    trajectory: Trajectory | None = None,
    share: float = 1.0,
    *,
    sparse: bool = False,
) -> tuple[Beams, trace.VoxelGrid]:
    """Read the usable pulses of the plot. Returns are cleaned and grouped, the directions of pulses
    are found, and pulses are selected.

    In a sparse cloud, most voxels in the crowns contain no point by chance. Voxels with points
    would therefore show far too little canopy. The pulses are therefore also used if only their
    first returns are present, and they are treated as vertical if their directions cannot be found.

    Raises
    ------
    UnsoundPulsesError
        If too few pulses remain.
    """
    from aosplan.scenes.pulses.returns import read_returns

    only_first = not any(file.later_returns for file in files)
    if only_first and not sparse:
        raise UnsoundPulsesError("every point is the only return of its pulse")
    returns, timed = read_returns(files, origin_m, grid.size_m, share)
    if only_first:
        single = np.ones_like(returns.number)
        returns = returns._replace(number=single, total=single)
    if returns.number.size == 0:
        raise UnsoundPulsesError("the plot has no returns")
    returns = clean.split_lines(clean.without_duplicates(returns), timed=timed)
    if trajectory is not None and not timed:
        raise RequestError(
            "a trajectory is given, but the points have no GPS times", "leave out --trajectory"
        )
    low = grid.heights_m(returns.xyz_m) < grid.cut_m
    returns = returns.take(clean.lines_with_ground(returns, low))
    if returns.number.size == 0:
        raise UnsoundPulsesError("no flight line has last returns near the ground")
    returns, pulses, complete = grouping.grouped(returns, timed=timed)
    if complete < LEAST_COMPLETE:
        raise UnsoundPulsesError(
            f"only {complete:.0%} of the pulses are complete, whether they are grouped by "
            "their order in the file or by time"
        )
    to_sensor, sound, worst_deg = directions(returns, pulses, trajectory, origin_m)
    if sparse and trajectory is None and not sound.any():
        to_sensor[:], sound[:] = [[0.0], [0.0], [1.0]], True
    if not sound.any():
        if trajectory is not None:
            raise RequestError(
                "the trajectory does not cover the GPS times of the point cloud",
                "the times of both files must be of the same kind (adjusted GPS seconds, or "
                "seconds of the week)",
            )
        raise UnsoundPulsesError(
            "no flight line has enough pulses with several returns to compute the position "
            "of the sensor"
            if worst_deg is None
            else "the pulses do not come from a single moving sensor (the lines miss it by "
            f"{worst_deg:.2g}°)"
        )
    heights = grid.heights_m(returns.xyz_m)
    low = heights < grid.cut_m
    equal = grouping.equal_energies(returns)
    measured = grouping.intensity_energies(returns, pulses, low)
    beams = Beams(
        returns,
        pulses,
        equal if measured is None else measured,
        low,
        to_sensor,
        "equal" if measured is None else "intensity",
    )
    foot = trace.points_at_height(returns.xyz_m[:, pulses.last], to_sensor, grid, 0.0)
    beams = beams.take(sound & grid.inside(foot))
    area_m2 = grid.size_m[0] * grid.size_m[1]
    least = max(FEWEST_PULSES, FEWEST_A_M2 * area_m2 * share)
    if len(beams.pulses) < least:
        raise UnsoundPulsesError(
            f"only {len(beams.pulses)} complete pulses reach the ground of the plot, but at least "
            f"{least:.0f} are needed"
        )
    inside = grid.inside(returns.xyz_m)
    top_m = float(heights[inside].max(initial=grid.cut_m))
    return beams, grid._replace(slices=int(top_m / grid.voxel_m + FACE) + 1)


def directions(
    returns: Returns, pulses: Pulses, trajectory: Trajectory | None, origin_m: Floats
) -> tuple[Floats, NDArray[np.bool_], float | None]:
    """Unit vectors from the last returns to the sensor, and whether each vector is reliable.

    Returns
    -------
    tuple
        Vectors of shape (3, P); a mask of the reliable vectors, shape (P,); and the largest
        residual [deg] of the flight lines that were rejected because of their residual.
    """
    at_m = returns.xyz_m[:, pulses.last]
    to_sensor = np.zeros_like(at_m)
    to_sensor[2] = 1.0
    sound = np.zeros(len(pulses), dtype=np.bool_)
    worst: float | None = None
    time_s = returns.time_s[pulses.last]
    if trajectory is not None:
        sound = trajectory.covers(time_s)
        if sound.any():
            away = trajectory.at(time_s) - origin_m[:, np.newaxis] - at_m
            to_sensor = away / np.sqrt((away * away).sum(axis=0))
    else:
        line = returns.line[pulses.first]
        for number in np.unique(line):
            of = np.flatnonzero(line == number)
            found = sensor_track.fitted(returns, pulses.take(of))
            if found is None:
                continue
            if found.residual_deg > sensor_track.LARGEST_RESIDUAL_DEG:
                worst = max(worst or 0.0, found.residual_deg)
                continue
            away = found.at(time_s[of]) - at_m[:, of]
            to_sensor[:, of] = away / np.sqrt((away * away).sum(axis=0))
            sound[of] = True
    sound &= to_sensor[2] > LEAST_COSINE
    # If the first return is not on the line to the sensor, the returns belong to different pulses.
    lever = returns.xyz_m[:, pulses.first] - at_m
    along = (lever * to_sensor).sum(axis=0)
    aside = np.sqrt(np.maximum((lever * lever).sum(axis=0) - along * along, 0.0))
    sound &= (aside <= WIDEST_M) & (along >= 0.0)
    return to_sensor, sound, worst


def fitted_field(beams: Beams, grid: trace.VoxelGrid) -> AttenuationField:
    """The attenuation of each voxel, the scale factor from cross-fitting, and the gap fractions.

    Raises
    ------
    UnsoundPulsesError
        If no energy reaches the ground, or all of it does.
    """
    fold = np.random.Generator(np.random.PCG64(FOLD_SEED)).integers(0, FOLDS, len(beams.pulses))
    parts = [_sums(beams.take(fold == k), grid) for k in range(FOLDS)]
    both = attenuation.total(parts)
    sums = attenuation.total(parts[::2]), attenuation.total(parts[1::2])
    strengths = attenuation.best_strengths(sums, grid.voxel_m)
    first, second = (attenuation.attenuation(half, strengths, grid.voxel_m) for half in sums)
    del sums
    through = through_canopy(beams, grid)
    depths = np.zeros((2, len(beams.pulses)))
    for k, part in enumerate(parts):
        others = attenuation.VoxelSums(*(each - own for each, own in zip(both, part, strict=True)))
        # Because of rounding, a difference of sums may be negative.
        for each in others:
            np.maximum(each, 0.0, out=each)
        rate = attenuation.attenuation(others, strengths, grid.voxel_m)
        other = attenuation.contrasted(rate, attenuation.OTHER_CONTRAST, grid.voxel_m)
        held_out = through & (fold == k)
        depths[:, held_out] = optical_depths((rate, other), beams.take(held_out), grid)
    passed = {name: each[through] for name, each in beams.gaps().items()}
    gaps = {name: float(each.mean()) for name, each in passed.items()}
    if not 0.0 < gaps["weighted"] < 1.0:
        raise UnsoundPulsesError(
            "no pulse reaches the ground"
            if gaps["weighted"] == 0.0
            else "the canopy does not intercept any pulse"
        )
    depths = depths[:, through]
    contrast = attenuation.best_contrast(depths, passed["weighted"])
    of_pulses = attenuation.depths_at(contrast, depths)
    scales = {name: attenuation.scale_for(of_pulses, gap) for name, gap in gaps.items()}
    lowest = int(grid.cut_m / grid.voxel_m + FACE)
    whole, first, second = (
        attenuation.contrasted(rate, contrast, grid.voxel_m)
        for rate in (attenuation.attenuation(both, strengths, grid.voxel_m), first, second)
    )
    return AttenuationField(
        whole,
        contrast,
        scales,
        gaps,
        strengths,
        float((both.path_m[lowest:] > 0.0).mean()) if lowest < grid.slices else 1.0,
        (first, second),
        both.path_m > 0.0,
    )


def through_canopy(beams: Beams, grid: trace.VoxelGrid) -> NDArray[np.bool_]:
    """Mask of the pulses that cross the whole canopy within the plot and whose returns are all
    present.

    Only these pulses are used, because the canopy outside the plot is unknown. If they are too few,
    the mask has all pulses whose returns are all present.
    """
    whole = beams.returns.number[beams.pulses.first] == 1
    last = beams.returns.xyz_m[:, beams.pulses.last]
    top = grid.slices * grid.voxel_m
    entry = trace.points_at_height(last, beams.to_sensor, grid, top)
    through: NDArray[np.bool_] = whole & grid.inside(entry)
    return through if np.count_nonzero(through) >= FEWEST_THROUGH else whole


def _sums(beams: Beams, grid: trace.VoxelGrid) -> attenuation.VoxelSums:
    """Intercepted energy and weighted path length of each voxel."""
    shape = grid.shape
    returns = beams.returns
    intercepted, path_m = (np.zeros(int(np.prod(shape)), dtype=np.float32) for _ in range(2))
    paths = trace.paths_to_hits(returns, beams.pulses, beams.energy, beams.to_sensor, grid)
    for part in trace.lengths_in_voxels(paths, grid):
        weighted = part.length_m * paths.weight[part.piece]
        np.add.at(path_m, part.cell, weighted.astype(np.float32))
    members = grouping.members_of(beams.pulses)
    hits = returns.xyz_m[:, members]
    cell = grid.cells(hits[0], hits[1], grid.heights_m(hits))
    hit = cell >= 0
    np.add.at(intercepted, cell[hit], beams.energy[members[hit]].astype(np.float32))
    return attenuation.VoxelSums(intercepted.reshape(shape), path_m.reshape(shape))


def optical_depths(
    rates: Sequence[NDArray[np.float32]], beams: Beams, grid: trace.VoxelGrid
) -> Floats:
    """Optical depths along the whole line of each pulse, down to the cut.  They are computed for
    several fields of λ, and have the shape (rates, P).
    """
    paths = trace.paths_to_ground(beams.returns, beams.pulses, beams.to_sensor, grid)
    depths = np.zeros((len(rates), len(beams.pulses)))
    for part in trace.lengths_in_voxels(paths, grid):
        owner = paths.owner[part.piece]
        for rate, depth in zip(rates, depths, strict=True):
            np.add.at(depth, owner, rate.ravel()[part.cell] * part.length_m)
    return depths
