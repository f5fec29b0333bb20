"""Matching of a plan without a location to the photos that were taken for it.

Every pair of a photo and a site defines a translation that moves the site to the photo. The correct
translation is the one on which most pairs agree. Missing photos reduce the number of pairs that
agree. Pairs with photos of other objects rarely agree on a wrong translation. A translation that is
wrong by a whole pitch fits almost as well as the correct one. If a whole row of photos is missing,
it fits equally well. Several translations may fit equally well. In this case, the translation whose
matched sites are earliest in the flight is chosen, because flights often end early but rarely begin
late.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

MOST_PAIRS = 4_000_000
"""Largest number of pairs of a photo and a site that are examined."""

CANDIDATES = 64
"""Number of translations that are examined further, beginning with the one on which most pairs
agree.
"""

STEPS = 10
"""Largest number of refinements of a translation.  Each refinement adds the median of the
residuals.
"""


class Registration(NamedTuple):
    """Translation from sites to photos [m], shape (2,), and number of translations that fit equally
    well.
    """

    offset_m: Floats
    alike: int


class _Fit(NamedTuple):
    """Quality of a translation.  The smallest value is the best.

    - `negative`: minus the number of photos that are matched to a site
    - `off`: median distance of the matched photos divided by the reach
    - `late`: sum of the indices of the matched sites in flight order
    """

    negative: int
    off: float
    late: int


def registered(sites_m: Floats, points_m: Floats, reach_m: float) -> Registration | None:
    """The translation of the sites with which the largest number of sites have a photo.

    Parameters
    ----------
    sites_m
        Shape (N, 2), in flight order.
    points_m
        Positions of the photos, shape (M, 2).
    reach_m
        Largest distance of a photo from its site; at most half the pitch.

    Returns
    -------
    Registration or None
        The translation; None if there are more than `MOST_PAIRS` pairs.
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
        """Sites with a photo within reach, their nearest photos, and their distances."""
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
            # The median is rounded, so that tiny errors of the calculation do not affect the
            # choice. The rounding is much finer than the accuracy of GNSS.
            middle = round(float(np.median(off)) / reach_m, 6)
            fits.setdefault(_Fit(-len(np.unique(photo)), middle, int(near.sum())), offset)
    best = min(fits)
    return Registration(fits[best], sum(fit[:2] == best[:2] for fit in fits))
