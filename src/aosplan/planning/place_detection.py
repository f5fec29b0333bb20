"""Probability that a target at a place is found. It depends on the photos that see the place and on
the canopy above it.

In the model of independent slices (`aosplan.models.detection`), detection depends on the relative
positions of the photos and on the slices. Places are grouped by the number, the spread along both
axes and the mean distance of their photos. All places of a group get the prediction for the central
place of the group. The optical depth of every slice is multiplied by the relative depth of the
local canopy. Probabilities are computed for the relative depths in `DEPTHS` and interpolated
between them.

For scenes with voxels, detection could be counted in the voxels of the stand, but this takes
seconds for each set of photos. The slices are used instead. Their contrast is scaled once: with the
scaled contrast, the prediction for the planned grid equals the probability that was counted in
voxels.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from aosplan.areas.photo_sets import along_and_across
from aosplan.models.detection import DetectionModel
from aosplan.models.target_window import Target
from aosplan.planning.plan_detection import CLEAR, find_of, slices_of
from aosplan.scenes.local_canopy import LocalCanopy, local_canopy

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.areas.ground_cells import GroundCells
    from aosplan.areas.photo_sets import PhotoSets
    from aosplan.planning.result import Plan
    from aosplan.scenes.scene import Layer

    Floats = NDArray[np.float64]
    Whole = NDArray[np.int64]

STEP = 0.05
"""Largest relative difference of the number and the spread of photos between places in
one group.
"""

MOST_PREDICTIONS = 500
"""Largest number of predictions for a map.  If there are more groups, `STEP` is increased."""

DEPTHS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 3.0, 5.0, 10.0)
"""Optical depths at which detection is predicted, divided by the optical depth of the scene."""

SPREAD_M = 0.5
"""Length that is added to spreads before they are compared, because differences between small
spreads are unimportant.
"""

BISECTIONS = 24

LATTICE_STEPS = 4
"""Largest number of different steps between neighbouring coordinates of a lattice. Rounding and
gaps cause more than one step.
"""


class PlaceDetection:
    """Probability of detection at places, for a plan with a target to find.

    Parameters
    ----------
    plan
        A plan with a predicted detection.
    """

    def __init__(self, plan: Plan) -> None:
        assert plan.detection is not None
        self._plan = plan
        self._layers = slices_of(plan.inputs)
        self._signature = find_of(plan.inputs).signature
        self._models: dict[float, DetectionModel] = {}
        self._is_lattice = True
        if plan.model == "measured" and plan.problem is not None:
            self._signature = self._signature._replace(contrast=self._counted_contrast())
            self._models.clear()

    def probabilities(
        self,
        sets: PhotoSets,
        places_m: Floats,
        points_m: Floats,
        depth: Floats | None = None,
    ) -> Floats:
        """Probability of detection at each place.

        Parameters
        ----------
        sets
            The photos that see each place.
        places_m
            Positions of the places, metres east and north, shape (places, 2).
        points_m
            Positions of the photos, metres east and north, shape (N, 2).
        depth
            Optical depth of the canopy above each place, divided by the optical depth of the scene,
            shape (places,). The default is 1.
        """
        points, places = self._in_axes(points_m), self._in_axes(places_m)
        self._is_lattice = is_lattice(points)
        looks = sets.looks
        found = np.zeros(len(looks))
        seen = np.flatnonzero(looks)
        if not len(seen):
            return found
        ratio = np.ones(len(seen)) if depth is None else depth[seen]
        nodes = np.array(DEPTHS)
        place = np.interp(ratio, nodes, np.arange(len(nodes)))
        lower = np.minimum(place.astype(np.int64), len(nodes) - 2)
        share = np.round(place - lower, 9)
        columns = self._features(sets, places, points)[seen]
        kind = _kinds(columns, lower)
        for number in _middle_members(kind, columns).tolist():
            same = kind == kind[number]
            set_m = points[sets.of(int(seen[number]))] - places[seen[number]]
            # Detection is predicted only for the depths between which a place is interpolated.
            low = float(nodes[lower[number]])
            high = float(nodes[lower[number] + 1])
            below = self._at(low, set_m) if share[same].min() < 1.0 else 0.0
            above = self._at(high, set_m) if share[same].max() > 0.0 else 0.0
            found[seen[same]] = (1.0 - share[same]) * below + share[same] * above
        return found

    def found_at(self, place_m: Floats, points_m: Floats) -> float:
        """Probability of detection at a place below the mean canopy, with photos from some
        positions.
        """
        set_m = self._in_axes(points_m) - self._in_axes(place_m[None])
        return self._at(1.0, set_m)

    def _features(self, sets: PhotoSets, places: Floats, points: Floats) -> Floats:
        """Features of each place that determine detection: number, spread and mean distance of its
        photos.
        """
        looks = sets.looks
        place = np.repeat(np.arange(len(looks)), looks)
        counts = np.maximum(looks, 1)
        found = [np.log(counts)]
        for values, middle in zip(points.T, places.T, strict=True):
            offset = values[sets.photos] - middle[place]
            mean = np.bincount(place, offset, len(looks)) / counts
            square = np.bincount(place, (offset - mean[place]) ** 2, len(looks)) / counts
            found.append(np.log(np.sqrt(square) + SPREAD_M))
            found.append(np.abs(mean) / self._plan.altitude_m)
        return np.column_stack(found)

    def _at(self, depth: float, points_m: Floats) -> float:
        """Probability of detection with photos at the given positions, for a canopy with the given
        relative optical depth.
        """
        return self._model(depth).probability_at(points_m)

    def _model(self, depth: float) -> DetectionModel:
        if depth not in self._models:
            find = find_of(self._plan.inputs)
            self._models[depth] = DetectionModel(
                scaled(self._layers, depth),
                self._plan.altitude_m,
                Target(*find.size_m),
                self._signature,
                false_alarms=find.false_alarms,
            )
        model = self._models[depth]
        return model if self._is_lattice else model.for_search()

    def _in_axes(self, points_m: Floats) -> Floats:
        """Positions of photos along the axes of the occluders."""
        problem = self._plan.problem
        if problem is not None and problem.model.heading_deg is not None:
            return points_m
        return along_and_across(points_m, self._plan.heading_deg)

    def _counted_contrast(self) -> float:
        """Find the contrast with which the slices predict the probability that was counted in
        voxels.
        """
        plan, model = self._plan, self._model(1.0)
        assert plan.detection is not None
        signature = self._signature
        grid = plan.solution.pattern, plan.solution.baseline_m
        low, high = 0.0, 4.0
        for _ in range(BISECTIONS):
            factor = 0.5 * (low + high)
            model.signature = signature._replace(contrast=factor * signature.contrast)
            if model.predict(*grid).probability < plan.detection.probability:
                low = factor
            else:
                high = factor
        return 0.5 * (low + high) * signature.contrast


def _kinds(columns: Floats, lower: Whole) -> Whole:
    """Group number of each place.  Places with the same number get the same prediction."""
    step = STEP
    while True:
        keys = np.column_stack([np.round(columns / step).astype(np.int64), lower])
        kinds, kind = np.unique(keys, axis=0, return_inverse=True)
        if len(kinds) <= MOST_PREDICTIONS:
            return np.asarray(kind).reshape(-1)
        step *= 1.25


def _middle_members(kind: Whole, columns: Floats) -> Whole:
    """Find, for each group, the place whose features are nearest to the mean features of
    the group.
    """
    counts = np.bincount(kind)
    means = np.column_stack([np.bincount(kind, column) / counts for column in columns.T])
    off = np.abs(columns - means[kind]).sum(axis=1)
    order = np.lexsort((off, kind))
    members: Whole = order[np.concatenate([[0], np.cumsum(counts)[:-1]])]
    return members


def is_lattice(points_m: Floats) -> bool:
    """Whether photos are on a lattice along the axes. Photos on a lattice have few different
    offsets from each other.
    """
    for values in points_m.T:
        steps = np.diff(np.unique(np.round(values, 3)))
        if len(np.unique(np.round(steps, 2))) > LATTICE_STEPS:
            return False
    return True


def scaled(layers: tuple[Layer, ...], depth: float) -> tuple[Layer, ...]:
    """Slices with their optical depths multiplied by a factor."""
    if depth == 0.0:
        return CLEAR
    return tuple(
        layer._replace(density=min(-math.expm1(depth * math.log1p(-layer.density)), 0.999))
        for layer in layers
    )


def canopy_over(plan: Plan, cells: GroundCells) -> LocalCanopy | None:
    """The canopy above cells, if the plan's scene has a location."""
    volume = plan.volume
    if volume is None or volume.place is None or plan.origin is None:
        return None
    return local_canopy(
        volume,
        cells.middles_m,
        plan.origin,
        altitude_m=plan.altitude_m,
        footprint_m=max(plan.inputs.footprint_m),
        focal_height_m=plan.inputs.focal_height_m,
    )


def relative_depth(canopy: LocalCanopy | None) -> Floats | None:
    """Optical depth of the canopy above places, divided by that of the whole stand; 1 if it is not
    known.
    """
    if canopy is None or canopy.mean_depth == 0.0:
        return None
    return np.nan_to_num(canopy.depth / canopy.mean_depth, nan=1.0)
