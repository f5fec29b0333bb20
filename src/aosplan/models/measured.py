"""The measured model: predictions from the voxels of a stand.

In a real stand, crowns and trunks are clumps. Slices are therefore not independent, and occluders
differ in size. If every voxel is known, however, the targets that each view hides are also known
(`aosplan.scenes.occlusion`). The prediction then counts hidden targets. It is exact for the sites
of the plan, whatever their pattern. Let c be the number of the N views that hide a target, and let
Σ be the sum over all n targets. Then

    p̄ = Σ c / (N n),   V = 1 - Σ c² / (N² n),   K = (n Σ c² - (Σ c)²) / (Σ c (N n - Σ c)).

K follows from V = 1 - p̄² - p̄ (1 - p̄) K and is computed with whole numbers. Σ c² can also be
computed from pairs of views: it is the sum of J n over all ordered pairs, where J is the share of
targets that both views hide.

`density` is p̄, the mean over the views of the plan. It depends on the baseline, because slanted
rays meet more occluders than nadir rays. V therefore has a maximum at a finite aperture, and is not
a monotone function of the baseline. V̂ is not a strictly monotone function of the baseline either.
K may be less than 1/N, for two reasons. Two views may hide fewer targets in common than independent
views would. If views hide different shares of the plot, the variance between targets is smaller.

**Edges.** The plot is periodic, which means that it is surrounded by copies of itself. Every target
is therefore below a canopy. However, a plot that was clipped out of a point cloud is sparse at its
rim, and copies make this sparse rim twice as wide. If `edges` is ``interior``, only targets whose
rays all stay on the plot are counted.

**Noise.** If positions deviate randomly from their sites, V and p̄ are random too. Their expected
values are computed as means over simulated flights (`MeasuredModel.noise_expectation`), with
standard errors. All simulated flights together have about `REALISED_VIEWS` views. The random
numbers are the same for every plan. Plans can therefore be compared.
"""

from __future__ import annotations

import math
from copy import copy
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.errors import RequestError
from aosplan.grid.patterns import local_sites
from aosplan.models.memo import remembered
from aosplan.models.model import Prediction
from aosplan.models.plot_interior import LEAST_INTERIOR, margins, nothing_inside
from aosplan.scenes.hidden_counts import HiddenCount, joint_counts, popcount
from aosplan.scenes.occlusion import PlotWindow
from aosplan.scenes.sampled_targets import SampledOcclusion, occlusion_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import ArrayLike, NDArray

    from aosplan.grid.patterns import AnyPattern
    from aosplan.models.correlogram import CorrelogramModel
    from aosplan.models.memo import Known
    from aosplan.scenes.occlusion import ViewKind, Words
    from aosplan.scenes.voxels import VoxelVolume

CACHE_OCTETS = 1 << 28
"""Memory for views that later predictions may reuse [bytes]."""

NOISE_SEED = 1
"""Random seed of the position noise.  Flight r has the seed (`NOISE_SEED`, r)."""

REALISED_VIEWS = 400
"""Approximate number of views (flights times sites) for the expected value over noise.  There are
at least two flights.
"""


class NoiseExpectation(NamedTuple):
    """Mean prediction of simulated flights with position noise, the number of these flights, and
    the standard errors of the mean.
    """

    prediction: Prediction
    flights: int
    seed: int
    density_error: float
    expected_error: float
    normalized_error: float


class MeasuredModel:
    """Predictions from one volume of voxels for views from one altitude.

    Parameters
    ----------
    volume
        The voxels of the plot, which is periodic.
    altitude_m
        Altitude above the focal plane.  It has to be above all voxels.
    heading_deg
        Heading of the patterns, clockwise from north, the direction of increasing rows.
    view
        ``telecentric``: each target is at the centre of its own aperture.  ``perspective``: all
        targets of the plot are below one aperture, which is centred above the plot.
    targets_per_voxel
        Number of targets along each side of a voxel; None for the default of the volume.
    focal_height_m
        Height of the focal plane above the ground.
    hold_error_m
        Standard deviation, along both axes, of the positions around their sites.
    edges
        The targets that are counted.  ``wrapped``: all targets, with copies of the plot around it.
        ``interior``: targets whose rays all stay on the plot.  ``auto``: as ``interior`` if their
        share of all targets is at least `LEAST_INTERIOR`, otherwise all targets.

    Raises
    ------
    RequestError
        If the altitude is not above the volume, or a number is outside its domain.
    """

    name = "measured"
    rule_baseline_m = None
    rises_with_baseline = False

    def __init__(
        self,
        volume: VoxelVolume,
        altitude_m: float,
        *,
        heading_deg: float = 0.0,
        view: ViewKind = "telecentric",
        targets_per_voxel: int | None = None,
        focal_height_m: float = 0.0,
        hold_error_m: float = 0.0,
        edges: str = "wrapped",
    ) -> None:
        self.view = view
        self.edges = edges
        self.heading_deg = heading_deg
        self.hold_error_m = hold_error_m
        self.occlusion = occlusion_of(
            volume,
            altitude_m,
            view=view,
            targets_per_voxel=targets_per_voxel,
            focal_height_m=focal_height_m,
        )
        self._stand = volume, altitude_m, focal_height_m
        top_m = volume.canopy_top_m - focal_height_m
        half_plot_m = 0.5 * min(volume.size_m)
        self._widest_m = half_plot_m * altitude_m / top_m if top_m > 0.0 else math.inf
        self._masks: dict[tuple[float, float], Words] = {}
        self._predictions: Known = {}

    def of_volume(self, volume: VoxelVolume) -> MeasuredModel:
        """A model with the same views of another volume."""
        _, altitude_m, focal_height_m = self._stand
        return MeasuredModel(
            volume,
            altitude_m,
            heading_deg=self.heading_deg,
            view=self.view,
            focal_height_m=focal_height_m,
            edges=self.edges,
        )

    def beside_the_middle(self, most_targets: int) -> MeasuredModel:
        """A telecentric model of the same stand.  If the stand has more than `most_targets`
        targets, the model has one target per voxel, or a sample of the targets.
        """
        volume, altitude_m, focal_height_m = self._stand
        sampled = isinstance(self.occlusion, SampledOcclusion)
        if self.view == "telecentric" and (sampled or self.occlusion.targets <= most_targets):
            return self
        return MeasuredModel(
            volume,
            altitude_m,
            heading_deg=self.heading_deg,
            targets_per_voxel=1 if self.occlusion.targets > most_targets else None,
            focal_height_m=focal_height_m,
            edges=self.edges,
        )

    def wrapped(self) -> MeasuredModel:
        """A model that counts all targets of the periodic plot.  Both models share stored views."""
        return self._with_edges("wrapped")

    def _with_edges(self, edges: str) -> MeasuredModel:
        other = copy(self)
        other.edges = edges
        other._predictions = {}  # noqa: SLF001 (its own)
        return other

    def interior_prediction(self, pattern: AnyPattern, baseline_m: float) -> Prediction | None:
        """The prediction for targets whose rays stay on the plot; None if there are no such
        targets.
        """
        try:
            return self._with_edges("interior").predict(pattern, baseline_m)
        except RequestError:
            return None

    def interior(self, positions_m: ArrayLike) -> PlotWindow | None:
        """Mask of the targets whose rays to the positions all stay on the plot; None if all targets
        are counted.

        Raises
        ------
        RequestError
            If `edges` is ``interior`` and no target has all rays on the plot.
        """
        if self.edges == "wrapped":
            return None
        first, last = self._margins(positions_m)
        if not first.any() and not last.any():
            return None
        occlusion = self.occlusion
        columns, rows = (np.array([occlusion.columns, occlusion.rows]) - first - last).tolist()
        window = PlotWindow(int(first[1]), int(first[0]), rows, columns)
        found = occlusion.targets_in(window)
        if self.edges == "interior" and not found:
            raise nothing_inside()
        if self.edges == "auto" and found < LEAST_INTERIOR * occlusion.targets:
            return None
        return window

    def _margins(self, positions_m: ArrayLike) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Widths of the margins at both ends of x and y, in targets. At least one ray from each
        target in a margin leaves the plot.
        """
        volume, altitude_m, focal_height_m = self._stand
        first, last = margins(
            volume,
            altitude_m,
            positions_m,
            focal_height_m=focal_height_m,
            perspective=self.view == "perspective",
        )
        targets = self.occlusion.targets_per_voxel
        return first * targets, last * targets

    def edges_of(self, pattern: AnyPattern, baseline_m: float) -> str:
        """The targets that are counted for a pattern: ``interior``, or ``wrapped`` for all
        targets.
        """
        sites = self.sites_m(pattern, baseline_m)
        stays = not any(margin.any() for margin in self._margins(sites))
        return "interior" if stays or self.interior(sites) is not None else "wrapped"

    @property
    def volume(self) -> VoxelVolume:
        """The voxels of the plot."""
        return self._stand[0]

    @cached_property
    def nadir(self) -> Prediction:
        """Prediction for a single view from above the centre."""
        return self.predict_positions([(0.0, 0.0)])

    @property
    def density(self) -> float:
        """Density p of a single nadir sample."""
        return self.nadir.density

    @property
    def transparency(self) -> float:
        """1 - p of a single nadir sample."""
        return self.nadir.transparency

    @property
    def independent_baseline_m(self) -> float:
        """Largest distance [m] between two views for which the plot is large enough.

        At this distance, the rays of the two views are half a plot apart at the top of the canopy.
        At larger distances, the rays meet similar parts of the periodic plot again. This distance
        is the largest allowed aperture, and therefore a limit of the baseline.
        """
        return self._widest_m

    @property
    def sharp_baseline_m(self) -> float:
        """The same distance as `independent_baseline_m`."""
        return self.independent_baseline_m

    @property
    def widest_aperture_m(self) -> float:
        """The same distance as `independent_baseline_m`.  Along each axis, no two sites of a grid
        should be farther apart than this.

        If only targets whose rays stay on the plot are counted, the extents are measured along the
        axes of the plot; otherwise, along the axes of the grid.
        """
        if self.edges == "wrapped":
            return self._widest_m
        turn = math.radians(self.heading_deg)
        return self._widest_m / (abs(math.cos(turn)) + abs(math.sin(turn)))

    @remembered
    def predict(self, pattern: AnyPattern, baseline_m: float) -> Prediction:
        """Density and shortfall of a pattern that is flown with a baseline. They are exact for the
        sites. With position noise, they are means over simulated flights (`noise_expectation`).
        """
        if self.hold_error_m > 0.0:
            return self.noise_expectation(pattern, baseline_m).prediction
        return self.predict_positions(self.sites_m(pattern, baseline_m))

    def sites_m(self, pattern: AnyPattern, baseline_m: float) -> NDArray[np.float64]:
        """Sites of a pattern in flight order, metres east and north of the centre, shape (N, 2)."""
        return np.column_stack(local_sites(pattern, baseline_m, self.heading_deg))

    def flights_m(self, pattern: AnyPattern, baseline_m: float) -> Iterator[NDArray[np.float64]]:
        """Positions of flights with random deviations from the sites of a pattern, each of shape
        (N, 2).
        """
        sites = self.sites_m(pattern, baseline_m)
        for flight in range(max(math.ceil(REALISED_VIEWS / len(sites)), 2)):
            missed = np.random.default_rng([NOISE_SEED, flight]).standard_normal(sites.shape)
            yield sites + self.hold_error_m * missed

    def noise_expectation(self, pattern: AnyPattern, baseline_m: float) -> NoiseExpectation:
        """Expected prediction for a pattern that is flown with position noise."""
        flights = list(self.flights_m(pattern, baseline_m))
        # All flights are computed in one call, because their views use the same intermediate
        # results.
        views = self._views(np.concatenate(flights))
        window = self.interior(np.concatenate(flights))
        found = [self._predict(islice(views, pattern.samples), window) for _ in flights]
        density, expected = (
            np.array([getattr(each, name) for each in found]) for name in ("density", "expected")
        )
        p, t = float(density.mean()), sum(each.transparency for each in found) / len(found)
        normalized = np.array([each.normalized for each in found])
        shortfall = (
            (1.0 - float(expected.mean()) - p * p) / (p * t) if p * t else found[0].shortfall
        )
        errors = (
            float(values.std(ddof=1)) / math.sqrt(len(found))
            for values in (density, expected, normalized)
        )
        return NoiseExpectation(Prediction(p, t, shortfall), len(found), NOISE_SEED, *errors)

    def at_best(self, pattern: AnyPattern, baseline_m: float) -> Prediction:
        """The same as `predict`, because there is no faster bound."""
        return self.predict(pattern, baseline_m)

    def predict_positions(self, positions_m: ArrayLike) -> Prediction:
        """Density and shortfall of samples at any positions.

        Parameters
        ----------
        positions_m
            Shape (N, 2), N >= 1: metres east and north of the centre.

        Returns
        -------
        Prediction
            The prediction. Its density is the mean over the views. If no target or every target is
            hidden in all views, the views are treated as independent, and the shortfall is 1/N.
        """
        return self._predict(self._views(positions_m), self.interior(positions_m))

    def hidden_at(self, positions_m: ArrayLike) -> NDArray[np.float64]:
        """p of views at known positions, shape (N,), from the correlogram of the stand.

        In perspective, every view shows the whole plot. The share therefore hardly depends on the
        position.
        """
        points = np.asarray(positions_m, dtype=np.float64)
        if self.view == "perspective":
            return np.full(len(points), self.density)
        return self._correlogram.hidden_at(points)

    def correlation(
        self, x_m: NDArray[np.float64], y_m: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """ρ of two views that are offset from each other to the east and to the north, from the
        correlogram of the stand.

        The correlogram is telecentric.  A correlation computed directly from the voxels would
        depend on single gaps of the plot.
        """
        return self._correlogram.correlation(x_m, y_m)

    @cached_property
    def _correlogram(self) -> CorrelogramModel:
        from aosplan.models.correlogram import CorrelogramModel
        from aosplan.scenes.correlogram import correlogram

        volume, altitude_m, focal_height_m = self._stand
        return CorrelogramModel(correlogram(volume, focal_height_m=focal_height_m), altitude_m)

    def _predict(self, views: Iterable[Words], window: PlotWindow | None) -> Prediction:
        tally = HiddenCount(self.occlusion.words)
        inside = None if window is None else self.occlusion.mask_of(window)
        for mask in views:
            tally.add(mask if inside is None else mask & inside)
        hidden, squares = tally.moments()
        targets = self.occlusion.targets if inside is None else int(popcount(inside))
        rays = tally.views * targets
        clear = rays - hidden
        shortfall = (
            (targets * squares - hidden**2) / (hidden * clear)
            if hidden and clear
            else 1.0 / tally.views
        )
        return Prediction(hidden / rays, clear / rays, shortfall)

    def hidden_share(self, pattern: AnyPattern, baseline_m: float) -> NDArray[np.float64]:
        """Share of a pattern's views that do not see each target, shape (rows, columns).

        Only the counted targets are included. With noise, the views of the first simulated flight
        are used.
        """
        noisy = self.hold_error_m > 0.0
        at = (
            next(self.flights_m(pattern, baseline_m))
            if noisy
            else self.sites_m(pattern, baseline_m)
        )
        tally = HiddenCount(self.occlusion.words)
        for mask in self._views(at):
            tally.add(mask)
        window = self.interior(at)
        hidden: NDArray[np.float64] = np.zeros(1)
        for digit, plane in enumerate(tally.planes):
            bits = self.occlusion.unpack(plane[np.newaxis], window)[0]
            hidden = hidden + bits * float(1 << digit)
        return hidden / tally.views

    def hidden_at_places(self, pattern: AnyPattern, baseline_m: float) -> list[NDArray[np.float64]]:
        """`hidden_share` for apertures at four places of the periodic plot, half a plot apart.

        Each array has the shape (rows, columns), with one target per voxel.  A target has the same
        index in all four arrays.
        """
        volume, altitude_m, focal_height_m = self._stand
        _, rows, columns = volume.occupied.shape
        found = []
        for moved in ((0, 0), (0, columns // 2), (rows // 2, 0), (rows // 2, columns // 2)):
            occupied = np.roll(volume.occupied, moved, axis=(1, 2))
            model = MeasuredModel(
                volume.of_voxels(occupied),
                altitude_m,
                heading_deg=self.heading_deg,
                view=self.view,
                targets_per_voxel=1,
                focal_height_m=focal_height_m,
                hold_error_m=self.hold_error_m,
            )
            back = -moved[0], -moved[1]
            found.append(np.roll(model.hidden_share(pattern, baseline_m), back, axis=(0, 1)))
        return found

    def joint_density(self, positions_m: ArrayLike) -> NDArray[np.float64]:
        """J, the share of targets that are hidden in both views of a pair, for all pairs, shape (N,
        N).

        For any subset S of the positions, p̄ is the mean of J_ii, and V is 1 minus the mean of J_ik
        over all i and k in S.

        Parameters
        ----------
        positions_m
            Shape (N, 2): metres east and north of the centre.
        """
        views, window = np.stack(list(self._views(positions_m))), self.interior(positions_m)
        if window is None:
            return joint_counts(views) / self.occlusion.targets
        inside = self.occlusion.mask_of(window)
        return joint_counts(views & inside) / int(popcount(inside))

    def _views(self, positions_m: ArrayLike) -> Iterator[Words]:
        """Masks of the views.  Masks from earlier calls are used again if they are still stored."""
        positions = np.asarray(positions_m, dtype=np.float64)
        keys = [tuple(position) for position in positions.tolist()]
        capacity = max(CACHE_OCTETS // (8 * self.occlusion.words), 1)
        for start in range(0, len(keys), capacity):
            wanted = keys[start : start + capacity]
            new = [key for key in dict.fromkeys(wanted) if key not in self._masks]
            if new:
                self._masks.update(zip(new, self.occlusion.masks(new), strict=True))
            views = [self._masks[key] for key in wanted]
            for key in list(self._masks)[:-capacity]:
                del self._masks[key]
            yield from views
