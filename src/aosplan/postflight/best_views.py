"""Select the best N of many recorded views: those that share the fewest occluders.

With the correlation c_ik of what views i and k see, a choice S of N views has the shortfall
1 - V̂ = K = ΣΣ_S c_ik / N².  Views are dropped one by one, always the one that shares most with
those that are left; or taken one by one, always the one that shares least with those taken.  Both
choices are then bettered by exchanging one view for another as long as that lowers K, and the better
one counts: no single exchange betters it.  K is never below 1/N, that of views that share nothing.

The least K is not the largest V where views hide unlike shares p of the target: those that share
least are far apart, and look through more wood.  For V = 1 - ΣΣ_S J_ik / N² what pairs hide in common
takes the place of c, J_ik = p_i p_k + c_ik √(p_i (1-p_i) p_k (1-p_k)).

Only the correlations of the model enter, not the stand's own voxels: a choice that is tuned to the gaps of
one plot shows less on the next.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from aosplan.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    Correlation = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]
    """Correlation of views by their offsets along x and y [m], elementwise."""

MOST_VIEWS = 5000
"""Views to choose from: their correlations take 200 MB."""

WORTHWHILE = 1e-12
"""An exchange lowers the sum of correlations by more than this share of it."""


def thin(
    positions_m: ArrayLike,
    samples: int,
    correlation: Correlation,
    hidden: ArrayLike | None = None,
) -> NDArray[np.intp]:
    """Choose views that share the fewest occluders, or that together show most.

    Parameters
    ----------
    positions_m
        Shape (M, 2): x and y of the recorded views.
    samples
        N, how many to choose, from 1 to M.
    correlation
        Correlation of two views by their offset along x and y, 1 at no offset.
    hidden
        Shape (M,): share p that each view hides, for the largest V; None for the largest V̂.

    Returns
    -------
    ndarray
        Shape (N,): places of the chosen views, rising.

    Raises
    ------
    RequestError
        If there are fewer views than wanted, or more than `MOST_VIEWS`.
    """
    points = np.asarray(positions_m, dtype=np.float64)
    check_count(len(points), samples)
    shared = correlations(points, correlation)
    if hidden is not None:
        shared = jointly(shared, np.asarray(hidden, dtype=np.float64))
    first = int(np.lexsort((points[:, 1], points[:, 0]))[0])
    starts = fewest_shared(shared, samples), least_shared(shared, samples, first)
    return min((exchanged(shared, start) for start in starts), key=lambda s: shortfall(shared, s))


def check_count(count: int, samples: int) -> None:
    """Refuse to choose from fewer views than are wanted, or from more than `MOST_VIEWS`."""
    if count < samples:
        raise RequestError(
            f"{count} positions are fewer than --samples {samples}", "ask for fewer samples"
        )
    if count > MOST_VIEWS:
        raise RequestError(
            f"{count} positions are more than the {MOST_VIEWS} that can be chosen from",
            "leave out every other one, or split the recording",
        )


def correlations(points: NDArray[np.float64], correlation: Correlation) -> NDArray[np.float64]:
    """Correlations of all pairs of views, shape (M, M)."""
    shared = np.empty((len(points), len(points)))
    for row, point in enumerate(points):
        apart = points[:row] - point
        shared[row, :row] = shared[:row, row] = correlation(apart[:, 0], apart[:, 1])
    np.fill_diagonal(shared, 1.0)
    return shared


def jointly(shared: NDArray[np.float64], hidden: NDArray[np.float64]) -> NDArray[np.float64]:
    """J, what pairs of views hide of the same, from their correlations and what each hides."""
    spread = np.sqrt(hidden * (1.0 - hidden))
    joint: NDArray[np.float64] = np.outer(hidden, hidden) + shared * np.outer(spread, spread)
    return joint


def fewest_shared(shared: NDArray[np.float64], samples: int) -> NDArray[np.bool_]:
    """Drop the view that shares most with those left, until so many are left; which they are."""
    chosen = np.ones(len(shared), dtype=bool)
    sums = shared.sum(axis=1) - 0.5 * shared.diagonal()  # a view and itself are one pair
    for _ in range(len(shared) - samples):
        worst = int(np.argmax(np.where(chosen, sums, -np.inf)))
        chosen[worst] = False
        sums -= shared[worst]
    return chosen


def least_shared(shared: NDArray[np.float64], samples: int, first: int) -> NDArray[np.bool_]:
    """Take the view that shares least with those taken, from a first one on; which they are."""
    chosen = np.zeros(len(shared), dtype=bool)
    sums = 0.5 * shared.diagonal()
    view = first
    for _ in range(samples):
        chosen[view] = True
        sums += shared[view]
        view = int(np.argmin(np.where(chosen, np.inf, sums)))
    return chosen


def exchanged(shared: NDArray[np.float64], chosen: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Exchange one view for another as long as the choice shares less for it."""
    chosen = chosen.copy()
    sums = shared[:, chosen].sum(axis=1)
    while True:
        inside, outside = np.flatnonzero(chosen), np.flatnonzero(~chosen)
        if not len(outside):
            return inside
        # ΣΣ changes by 2 (Σ_k c_jk - c_ij) + c_jj - (2 Σ_k c_ik - c_ii) with j for i.
        own = shared.diagonal()
        change = (
            (2.0 * sums[outside] + own[outside])[None, :]
            - (2.0 * sums[inside] - own[inside])[:, None]
            - 2.0 * shared[np.ix_(inside, outside)]
        )
        best = int(np.argmin(change))
        leaves, enters = inside[best // len(outside)], outside[best % len(outside)]
        if change.flat[best] >= -WORTHWHILE * sums[inside].sum():
            return inside
        chosen[leaves], chosen[enters] = False, True
        sums += shared[enters] - shared[leaves]


def shortfall(shared: NDArray[np.float64], chosen: NDArray[np.intp]) -> float:
    """K of a choice of views."""
    return float(shared[np.ix_(chosen, chosen)].mean())
