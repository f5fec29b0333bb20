"""Choice of the sites from which one place has the highest integral visibility, among candidates
with known views.

Let J be the share of targets that are hidden in both views of a pair of sites. The visibility of N
sites is V = 1 - ΣΣ J / N², where the sum is over all ordered pairs. Sites are added one by one: the
next site is always the one that gives the highest visibility. Then each site is exchanged for the
candidate that improves the visibility most, and this is repeated until no exchange improves it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

LEAST_GAIN = 1e-9
"""Smallest gain of visibility for which a site is exchanged."""


def most_visible(joint: Floats, count: int) -> NDArray[np.intp]:
    """Choose the sites with the highest visibility; returns their indices in increasing order.

    Parameters
    ----------
    joint
        J of all pairs of candidates, shape (candidates, candidates).
    count
        Number N of sites, at most the number of candidates.
    """
    own = np.diagonal(joint)
    chosen: list[int] = []
    shared, total = np.zeros(len(joint)), 0.0
    for _ in range(count):
        with_each = total + 2.0 * shared + own
        with_each[chosen] = np.inf
        best = int(np.argmin(with_each))
        chosen.append(best)
        total = float(with_each[best])
        shared = shared + joint[best]
    improved = True
    while improved:
        improved = False
        for place, site in enumerate(chosen):
            left = shared - joint[site]
            without = total - 2.0 * float(shared[site]) + float(own[site])
            with_each = without + 2.0 * left + own
            with_each[chosen] = np.inf
            best = int(np.argmin(with_each))
            if with_each[best] < total - LEAST_GAIN * count**2:
                chosen[place], total = best, float(with_each[best])
                shared = left + joint[best]
                improved = True
    return np.sort(np.array(chosen, dtype=np.intp))


def visibility(joint: Floats, sites: NDArray[np.intp]) -> float:
    """Visibility V of the given sites."""
    return 1.0 - float(joint[np.ix_(sites, sites)].mean())
