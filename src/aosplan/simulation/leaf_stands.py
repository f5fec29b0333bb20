"""Stands of individual leaves, through which rays are cast. They are the reference with which
opacity from pulses is tested.

A stand is a periodic plot over level ground.  It contains round, opaque leaves of random direction.
Leaves form shoots, and shoots form crowns.  Intersections of rays with leaves are computed exactly,
without voxels, attenuation or a model.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

LAYER_M = 0.25
"""Thickness of the layers into which leaves are sorted, so that they are found quickly."""


class LeafStand(NamedTuple):
    """Leaves over a periodic plot.

    Attributes
    ----------
    size_m
        Edge length of the plot.  The plot is periodic along x and y.
    centre_m
        Shape (3, n): centres of the leaves, within the plot.
    normal
        Shape (3, n): unit vectors normal to the leaves.
    radius_m
        Radius of a leaf.
    """

    size_m: float
    centre_m: Floats
    normal: Floats
    radius_m: float

    @property
    def top_m(self) -> float:
        """A height above all leaves."""
        return float(self.centre_m[2].max(initial=0.0)) + self.radius_m

    def first_hits(self, ground_m: Floats, slope: Floats) -> Floats:
        """Height at which rays from above meet the first leaf, shape (n,).  It is 0 for rays that
        meet the ground.

        Parameters
        ----------
        ground_m
            Shape (2, n): points at which the rays meet the ground.
        slope
            Shape (2, n): change of x and y along the rays per metre of height.
        """
        # The cells are so large that every leaf that a ray may meet is at most half a cell away
        # from the ray, measured at the middle of the layer.
        steepest = float(np.abs(slope).max(initial=0.0))
        reach = self.radius_m + steepest * (0.5 * LAYER_M + self.radius_m)
        count = max(int(self.size_m / max(2.0 * reach, 0.1)), 1)
        edge = self.size_m / count
        layers = math.ceil(self.top_m / LAYER_M)
        level = np.minimum((self.centre_m[2] / LAYER_M).astype(np.intp), layers - 1)
        column, row = ((axis / edge).astype(np.intp) % count for axis in self.centre_m[:2])
        key = (level * count + row) * count + column
        order = np.argsort(key, kind="stable")
        starts = np.searchsorted(key[order], np.arange(layers * count * count + 1))
        height = np.zeros(ground_m.shape[1])
        open_rays = np.arange(height.size)
        for k in range(layers - 1, -1, -1):
            middle = (k + 0.5) * LAYER_M
            place = (ground_m[:, open_rays] + slope[:, open_rays] * middle) / edge
            corner = np.floor(place - 0.5).astype(np.intp)
            for down in (0, 1):
                for across in (0, 1):
                    x, y = (corner[0] + across) % count, (corner[1] + down) % count
                    cell = (k * count + y) * count + x
                    ray, leaf = _pairs(open_rays, starts[cell], starts[cell + 1])
                    self._meet(height, ray, order[leaf], ground_m, slope)
            # A leaf in the next lower layer may extend into this layer.
            reached = height[open_rays]
            open_rays = open_rays[(reached == 0.0) | (reached < k * LAYER_M + self.radius_m)]
        return height

    def _meet(
        self,
        height: Floats,
        ray: NDArray[np.intp],
        leaf: NDArray[np.intp],
        ground_m: Floats,
        slope: Floats,
    ) -> None:
        """Update the heights of first hits for pairs of a ray and a leaf."""
        lean, normal, centre = slope[:, ray], self.normal[:, leaf], self.centre_m[:, leaf]
        apart = centre[:2] - ground_m[:, ray] - lean * centre[2]
        # This gives the offset to the nearest periodic copy.
        apart -= self.size_m * np.round(apart / self.size_m)
        # The next lines follow the ray, from the height of the leaf's centre to the plane of the
        # leaf.
        along = normal[0] * lean[0] + normal[1] * lean[1] + normal[2]
        rise = (normal[0] * apart[0] + normal[1] * apart[1]) / np.where(along == 0.0, 1e-30, along)
        x, y = lean[0] * rise - apart[0], lean[1] * rise - apart[1]
        met = x * x + y * y + rise * rise <= self.radius_m**2
        np.maximum.at(height, ray[met], centre[2][met] + rise[met])


def _pairs(
    rays: NDArray[np.intp], starts: NDArray[np.intp], stops: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    lengths = stops - starts
    begin = np.cumsum(lengths) - lengths
    leaf = np.arange(int(lengths.sum())) + np.repeat(starts - begin, lengths)
    return np.repeat(rays, lengths), leaf


def crowned_stand(
    rng: np.random.Generator,
    size_m: float = 10.0,
    *,
    leaf_area_index: float = 1.5,
    crowns: int = 8,
    crown_radius_m: float = 1.8,
    base_m: float = 4.0,
    top_m: float = 12.0,
    leaf_diameter_m: float = 0.08,
    leaves_a_shoot: int = 12,
    shoot_m: float = 0.12,
) -> LeafStand:
    """Leaves in shoots, in ellipsoidal crowns at random places.

    Parameters
    ----------
    rng
        Random generator of the stand.
    size_m
        Edge length of the periodic plot.
    leaf_area_index
        Area of the leaves divided by the area of the plot.
    crowns, crown_radius_m, base_m, top_m
        Number of crowns, their radius, and the heights of their bottom and top.
    leaf_diameter_m
        Diameter of a leaf.
    leaves_a_shoot, shoot_m
        Number of leaves of a shoot, and standard deviation of their positions around its centre.
    """
    leaves = round(leaf_area_index * size_m**2 / (math.pi * leaf_diameter_m**2 / 4.0))
    shoots = max(leaves // leaves_a_shoot, 1)
    direction = rng.standard_normal((3, shoots))
    direction /= np.sqrt((direction**2).sum(axis=0))
    inside = direction * rng.random(shoots) ** (1.0 / 3.0)
    crown = rng.integers(0, crowns, shoots)
    height = rng.uniform(0.6, 1.0, crowns) * (top_m - base_m)
    places = rng.uniform(0.0, size_m, (2, crowns))
    middle = np.stack(
        [
            places[0, crown] + crown_radius_m * inside[0],
            places[1, crown] + crown_radius_m * inside[1],
            base_m + 0.5 * height[crown] * (1.0 + inside[2]),
        ]
    )
    centre = np.repeat(middle, leaves_a_shoot, axis=1)
    centre += shoot_m * rng.standard_normal(centre.shape)
    centre[:2] %= size_m
    np.maximum(centre[2], leaf_diameter_m, out=centre[2])
    normal = rng.standard_normal(centre.shape)
    normal /= np.sqrt((normal**2).sum(axis=0))
    return LeafStand(size_m, centre, normal, 0.5 * leaf_diameter_m)


class LaserReturns(NamedTuple):
    """Returns of simulated pulses in the order of measurement.  The arrays have the length n.

    `xyz_m` has shape (3, n).  `energy` is the share of the pulse's energy in the return.
    `on_ground` is true for returns from the ground.
    """

    xyz_m: Floats
    number: NDArray[np.intp]
    total: NDArray[np.intp]
    line: NDArray[np.intp]
    time_s: Floats
    energy: Floats
    on_ground: NDArray[np.bool_]


def laser_scan(
    rng: np.random.Generator,
    stand: LeafStand,
    *,
    pulses_a_m2: float = 200.0,
    altitude_m: float = 80.0,
    offsets_m: tuple[float, ...] = (-28.0, 0.0, 28.0),
    footprint_m: float = 0.1,
    resolution_m: float = 0.3,
    speed_mps: float = 8.0,
    most_returns: int = 5,
) -> LaserReturns:
    """Scan a stand from lines along y with a moving sensor.

    Each pulse consists of seven rays of equal energy, one in the middle and six around it.  If the
    ranges of several rays differ by less than the resolution, these rays make a single return.  It
    is on the axis of the pulse, at their mean range.

    Parameters
    ----------
    rng
        Random generator of the pulses.
    stand
        The stand to scan.  Pulses outside the plot meet its periodic copies.
    pulses_a_m2
        Pulses of all lines per square metre of ground.
    altitude_m, offsets_m
        Height of the sensor, and offset of each line from the centre of the plot along x.
    footprint_m
        Diameter of a pulse.
    resolution_m
        Smallest distance between two returns.
    speed_mps
        Speed of the sensor.
    most_returns
        Largest number of returns of a pulse.  The energy of further returns is added to the last
        return.
    """
    parts = [
        _one_line(
            rng, stand, line, offset, pulses_a_m2 / len(offsets_m), altitude_m, footprint_m,
            resolution_m, speed_mps, most_returns,
        )
        for line, offset in enumerate(offsets_m)
    ]  # fmt: skip
    return LaserReturns(*(np.concatenate(each, axis=-1) for each in zip(*parts, strict=True)))


def _one_line(
    rng: np.random.Generator,
    stand: LeafStand,
    line: int,
    offset_m: float,
    pulses_a_m2: float,
    altitude_m: float,
    footprint_m: float,
    resolution_m: float,
    speed_mps: float,
    most_returns: int,
) -> LaserReturns:
    side, top = stand.size_m, stand.top_m
    # The area includes all pulses that may cross the plot below its top. Along the track, pulses
    # are vertical.
    lean = top * np.array([min(offset_m - 0.5 * side, 0.0), max(offset_m + 0.5 * side, 0.0)])
    low, high = -lean[1] / altitude_m, side - lean[0] / altitude_m
    # There is one pulse at a random position in each cell of a lattice, because scanners distribute
    # pulses evenly.
    across, along = (max(round(each * math.sqrt(pulses_a_m2)), 1) for each in (high - low, side))
    count = across * along
    place = np.stack(np.meshgrid(np.arange(across), np.arange(along))).reshape(2, -1)
    aim = (place + rng.random((2, count))) / np.array([[across], [along]])
    aim *= np.array([[high - low], [side]])
    aim[0] += low
    # A line scanner looks across the track. The time of a pulse therefore depends on its position
    # along the track.
    aim = aim[:, np.argsort(aim[1])]
    time_s = 1000.0 * line + aim[1] / speed_mps
    sensor = np.stack([np.full(count, 0.5 * side + offset_m), aim[1], np.full(count, altitude_m)])
    turns = np.arange(6) * (math.pi / 3.0)
    around = 0.33 * footprint_m * np.stack([np.cos(turns), np.sin(turns)])
    ring = np.concatenate([np.zeros((2, 1)), around], axis=1)
    ground = (aim[:, :, np.newaxis] + ring[:, np.newaxis]).reshape(2, -1)
    slope = (np.repeat(sensor[:2], 7, axis=1) - ground) / altitude_m
    height = np.sort(stand.first_hits(ground, slope).reshape(count, 7), axis=1)[:, ::-1]
    new = np.ones((count, 7), dtype=np.bool_)
    new[:, 1:] = height[:, :-1] - height[:, 1:] > resolution_m
    number = np.minimum(np.cumsum(new, axis=1), most_returns)
    total = number[:, -1]
    key = (np.arange(count)[:, np.newaxis] * most_returns + number - 1).ravel()
    rays = np.bincount(key, minlength=count * most_returns)
    mean = np.bincount(key, height.ravel(), count * most_returns)[rays > 0] / rays[rays > 0]
    pulse, place = np.divmod(np.flatnonzero(rays), most_returns)
    axis = (sensor - np.concatenate([aim, np.zeros((1, count))]))[:, pulse]
    xyz = np.concatenate([aim, np.zeros((1, count))])[:, pulse] + axis * (mean / altitude_m)
    # Only returns inside the plot are kept, as in a clipped cloud.
    kept = ((xyz[:2] >= 0.0) & (xyz[:2] <= side)).all(axis=0)
    return LaserReturns(
        xyz[:, kept],
        place[kept] + 1,
        total[pulse[kept]],
        np.full(np.count_nonzero(kept), line),
        time_s[pulse[kept]],
        rays[rays > 0][kept] / 7.0,
        mean[kept] == 0.0,
    )


def hidden_share(
    stand: LeafStand, altitude_m: float, positions_m: Floats, pitch_m: float = 0.1
) -> Floats:
    """Share of telecentric views in which each target of a stand is hidden, found by casting rays.

    Parameters
    ----------
    stand
        The stand. It is periodic, so every target is below a canopy.
    altitude_m
        Height of the cameras.
    positions_m
        Shape (N, 2): offsets of the cameras from their targets.
    pitch_m
        Distance between targets.

    Returns
    -------
    ndarray
        Shape (targets,).  The mean of the shares is p̄, and V is 1 minus the mean of their squares.
    """
    count = round(stand.size_m / pitch_m)
    line = (np.arange(count) + 0.5) * (stand.size_m / count)
    targets = np.stack(np.meshgrid(line, line)).reshape(2, -1)
    hidden = np.zeros(targets.shape[1])
    for position in np.asarray(positions_m, dtype=np.float64):
        slope = np.repeat(position[:, np.newaxis] / altitude_m, targets.shape[1], axis=1)
        hidden += stand.first_hits(targets, slope) > 0.0
    return hidden / len(positions_m)
