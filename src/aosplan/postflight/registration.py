"""Where a plan without a place lies among the photos that were taken of it.

Every photo and every site make a translation that lays the site on the photo.  Where most of them
agree, the plan lies: photos that are missing take away agreement, those of something else add to
none.  A grid moved by a whole pitch fits almost as well, and just as well where a whole row was left
out: of translations that fit alike, the one whose sites are flown first, as flights break off.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

MOST_PAIRS = 4_000_000
"""Pairs of a photo and a site that are looked at."""

CANDIDATES = 64
"""Translations that are looked into, those of the most pairs."""

STEPS = 10
"""Times that a translation is refined at most; it moves by the middle of what is left."""


class Registration(NamedTuple):
    """Translation from sites to photos [m], shape (2,), and how many fit as well as it."""

    offset_m: Floats
    alike: int


class _Fit(NamedTuple):
    """How good a translation is, the least the best.

    Sites with a photo of their own, as a negative number; how far off those are, over the reach; how
    late in the flight they are.
    """

    negative: int
    off: float
    late: int


def registered(sites_m: Floats, points_m: Floats, reach_m: float) -> Registration | None:
    """Translation of sites that lays a photo on most of them.

    Parameters
    ----------
    sites_m
        Shape (N, 2), in flight order.
    points_m
        Where photos were taken, shape (M, 2).
    reach_m
        Farthest that a photo may be from its site, half the pitch or less.

    Returns
    -------
    Registration or None
        None where there are more than `MOST_PAIRS`.
    """
    from scipy.spatial import cKDTree

    if len(sites_m) * len(points_m) > MOST_PAIRS:
        return None
    pairs = (points_m[:, np.newaxis] - sites_m).reshape(-1, 2)
    cell = np.floor(pairs / reach_m).astype(np.int64)
    _, cell_of, votes = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    cell_of = cell_of.ravel()
    tree = cKDTree(points_m)

    def matched(offset: Floats) -> tuple[NDArray[np.intp], NDArray[np.intp], Floats]:
        """Sites with a photo in reach, their nearest photos, and how far those are."""
        off, photo = (np.asarray(found) for found in tree.query(sites_m + offset))
        near = np.flatnonzero(off <= reach_m)
        return near, photo[near], off[near]

    fits: dict[_Fit, Floats] = {}
    for number in np.argsort(-votes, kind="stable")[:CANDIDATES]:
        offset = np.median(pairs[cell_of == number], axis=0)
        for _ in range(STEPS):
            near, photo, _ = matched(offset)
            if not len(near):
                break
            before, offset = offset, np.median(points_m[photo] - sites_m[near], axis=0)
            if np.abs(offset - before).max() < 1e-9 * reach_m:
                break
        near, photo, off = matched(offset)
        if len(near):
            # In steps that are far below what a satellite tells: rounding is to decide nothing.
            middle = round(float(np.median(off)) / reach_m, 6)
            fits.setdefault(_Fit(-len(np.unique(photo)), middle, int(near.sum())), offset)
    best = min(fits)
    return Registration(fits[best], sum(fit[:2] == best[:2] for fit in fits))
