"""Sites with the highest integral visibility of one place, among candidates with known views.

With J, the share of targets that both views of a pair do not see, the visibility of N sites is
V = 1 - ΣΣ J / N² over all ordered pairs.  Sites are added one by one, each time the one that gives
the highest visibility.  Each site is then exchanged for the candidate that improves the visibility
most, until no exchange does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

LEAST_GAIN = 1e-9
"""Least gain of the visibility for which a site is exchanged."""


def most_visible(joint: Floats, count: int) -> NDArray[np.intp]:
    """Indices of the sites, in increasing order.

    Parameters
    ----------
    joint
        J, shape (candidates, candidates).
    count
        Number N of sites, at most that of the candidates.
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
    """V of some sites."""
    return 1.0 - float(joint[np.ix_(sites, sites)].mean())
