"""The photos that see each place on the ground. A photo sees a place if its footprint contains the
place.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.numerics import heading_axis, turned

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Whole = NDArray[np.int64]

BORDER_M = 1e-6
"""Tolerance with which a place on the border of a footprint is treated as inside."""


class PhotoSets(NamedTuple):
    """The photos that see each of some places.

    Attributes
    ----------
    start
        Shape (places + 1,): the photos of place k are ``photos[start[k]:start[k + 1]]``, in
        increasing order.
    photos
        Indices of photos.
    """

    start: Whole
    photos: Whole

    @property
    def looks(self) -> Whole:
        """Number of photos that see each place."""
        return np.diff(self.start)

    def of(self, place: int) -> Whole:
        """Indices of the photos that see one place."""
        return self.photos[self.start[place] : self.start[place + 1]]


def along_and_across(points_m: Floats, heading_deg: float) -> Floats:
    """Convert points (east, north) to points along a heading and to its right, shape (N, 2)."""
    return np.column_stack(turned(points_m[:, 0], points_m[:, 1], heading_axis(heading_deg)))


def photo_sets(
    places_m: Floats, points_m: Floats, footprint_m: tuple[float, float], heading_deg: float
) -> PhotoSets:
    """The photos that see each place.

    Parameters
    ----------
    places_m
        East and north, shape (places, 2).
    points_m
        East and north of the photos, shape (N, 2).
    footprint_m
        Size of a photo on the ground, along the heading and across it.
    heading_deg
        Direction of the photos' upper side, clockwise from north.
    """
    places = along_and_across(places_m, heading_deg)
    points = along_and_across(points_m, heading_deg)
    half = 0.5 * np.array(footprint_m) + BORDER_M
    order = np.argsort(places[:, 0], kind="stable")
    along = places[order, 0]
    first = np.searchsorted(along, points[:, 0] - half[0], side="left")
    stop = np.searchsorted(along, points[:, 0] + half[0], side="right")
    seen, by = [], []
    for photo, (low, high) in enumerate(zip(first.tolist(), stop.tolist(), strict=True)):
        strip = order[low:high]
        within = strip[np.abs(places[strip, 1] - points[photo, 1]) <= half[1]]
        seen.append(within)
        by.append(np.full(len(within), photo, dtype=np.int64))
    place = np.concatenate(seen) if seen else np.zeros(0, np.int64)
    photos = np.concatenate(by) if by else np.zeros(0, np.int64)
    sorted_ = np.argsort(place, kind="stable")
    counts = np.bincount(place, minlength=len(places_m))
    return PhotoSets(np.concatenate([[0], np.cumsum(counts)]), photos[sorted_])
