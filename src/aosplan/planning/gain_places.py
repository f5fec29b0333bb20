"""Places of an area for an order by gain: where the target is expected, and how well it is found
there.

In the search for the order, places are coarse, and the probability of detection at a place depends
only on the share of its photos that have been taken.  The probability of success is computed with
the finer cells of a detection map.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from aosplan.areas.ground_cells import cells_over, side_m
from aosplan.areas.photo_sets import photo_sets
from aosplan.areas.prior import prior_shares
from aosplan.errors import InfeasibleError
from aosplan.files import located
from aosplan.planning.block_order import LEVELS, Places
from aosplan.planning.place_detection import PlaceDetection, canopy_over, relative_depth

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from aosplan.areas.ground_cells import GroundCells
    from aosplan.areas.photo_sets import PhotoSets
    from aosplan.planning.resolve import PlanInputs
    from aosplan.planning.result import Plan

    Floats = NDArray[np.float64]
    Whole = NDArray[np.int64]

MOST_PLACES = 400
"""Approximate largest number of places for which orders are compared."""

PARTS = (0.25, 0.5, 0.75)
"""Shares of the photos that the first line takes of a place. Detection at the place is also
predicted after these shares have been taken.
"""


class GainPlaces:
    """The places of a plan over an area.

    Parameters
    ----------
    made
        A plan with a target to find and a prior of its position.
    points_m
        Positions of its photos, metres east and north, shape (N, 2), in flight order.
    lines
        Indices of the photos of each line.

    Attributes
    ----------
    places
        The places with which orders are compared.

    Raises
    ------
    RequestError
        If the prior cannot be read, or is 0 over the area.
    InfeasibleError
        If no photo shows a place at which the target is expected.
    """

    def __init__(self, made: Plan, points_m: Floats, lines: Sequence[Whole]) -> None:
        self._made, self._points_m = made, points_m
        self._cells, self._shares = prior_of(made.inputs)
        self._depth = relative_depth(canopy_over(made, self._cells))
        self._detection = PlaceDetection(made)
        all_photos = np.arange(len(points_m))
        coarse_m, weights = self._coarse(self._shares * self._by_place(all_photos))
        self._sets = self._sets_of(coarse_m, points_m)
        self.places = Places(weights, self._sets.looks, np.zeros(0))
        if not weights.sum() > 0.0:
            raise InfeasibleError(
                "no photo shows the places at which --poa expects the target",
                "leave --order out, or give fewer no-fly zones",
            )
        self.places = self.places._replace(found=self._found_by_share(coarse_m, lines))

    @property
    def area_probability(self) -> float:
        """Probability that the target is in the area (POA)."""
        return float(self._shares.sum())

    def success(self, photos: Whole) -> float:
        """Probability of success if only the given photos are taken."""
        return float(self._shares @ self._by_place(photos))

    def counts(self, parts: Sequence[Whole]) -> Whole:
        """Number of photos of each part that see each place, shape (parts, places)."""
        return _counts(self._sets, parts, len(self._points_m))

    def covered(self, photos: Whole) -> tuple[float, int]:
        """Share of the area whose places are seen in all their planned photos if only the given
        photos are taken, and the smallest number of these photos that see a place.
        """
        places = self._cells.middles_m[self._cells.inside_rows]
        sets = self._sets_of(places, self._points_m)
        (taken,) = _counts(sets, [photos], len(self._points_m))
        return float((taken == sets.looks).mean()), int(taken.min())

    def _sets_of(self, places_m: Floats, points_m: Floats) -> PhotoSets:
        made = self._made
        return photo_sets(places_m, points_m, made.inputs.footprint_m, made.heading_deg)

    def _by_place(self, photos: Whole) -> Floats:
        places, points = self._cells.middles_m, self._points_m[np.sort(photos)]
        sets = self._sets_of(places, points)
        return self._detection.probabilities(sets, places, points, self._depth)

    def _coarse(self, weights: Floats) -> tuple[Floats, Floats]:
        """Positions and weights of squares of cells, without those of weight 0."""
        step = math.ceil(math.sqrt(self._cells.inside.sum() / MOST_PLACES))
        middles = self._cells.middles_m
        rows, columns = np.divmod(np.arange(len(middles)), self._cells.inside.shape[1])
        group = (rows // step) * (int(columns.max()) // step + 1) + columns // step
        mass = np.bincount(group, weights).astype(np.float64)
        kept = np.flatnonzero(mass > 0.0)
        centres = [np.bincount(group, weights * axis)[kept] / mass[kept] for axis in middles.T]
        return np.column_stack(centres), mass[kept]

    def _found_by_share(self, places_m: Floats, lines: Sequence[Whole]) -> Floats:
        """Probability of detection with a share of the photos of a place, divided by the
        probability with all photos of this place.

        It is computed for the most important of the places that have the most common number of
        photos, and with the photos in flight order.
        """
        photos, weights = self.places.photos, self.places.weights
        usual = np.flatnonzero(photos == np.bincount(photos[photos > 0]).argmax())
        number = int(usual[np.argmax(weights[usual])])
        seen = self._sets.of(number)
        ends = {int(np.searchsorted(seen, line[-1], side="right")) for line in lines}
        first = min(end for end in ends if end)
        counts = sorted({*ends, *(round(first * part) for part in PARTS)} - {0})
        values = [
            self._detection.found_at(places_m[number], self._points_m[seen[:count]])
            for count in counts
        ]
        share = np.maximum.accumulate([0.0, *values])
        known = np.array([0, *counts]) / len(seen)
        found: Floats = np.interp(np.arange(LEVELS + 1) / LEVELS, known, share / share[-1])
        return found


def prior_of(inputs: PlanInputs) -> tuple[GroundCells, Floats]:
    """Cells over the area of a plan, and the probability that the target is in each of them."""
    area, prior = inputs.area, inputs.request.poa
    assert area is not None  # `PlanRequest` has checked that there are an area and a prior.
    assert prior is not None
    cells = cells_over(area.whole, side_m(float(area.whole.area), min(inputs.footprint_m)))
    return cells, prior_shares(cells, area.origin, located(prior, inputs.folder))


def _counts(sets: PhotoSets, parts: Sequence[Whole], photos: int) -> Whole:
    """Number of photos of each part that see each place, shape (parts, places)."""
    places = len(sets.looks)
    part_of = np.full(photos, -1)
    for number, part in enumerate(parts):
        part_of[part] = number
    part = part_of[sets.photos]
    place = np.repeat(np.arange(places), sets.looks)
    taken = part >= 0
    cell = part[taken] * places + place[taken]
    return np.bincount(cell, minlength=len(parts) * places).reshape(len(parts), places)
