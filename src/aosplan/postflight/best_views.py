"""Selection of the best N of many recorded views, which share the fewest occluders.

With the correlation c_ik of views i and k, a set S of N views has the shortfall
1 - V̂ = K = ΣΣ_S c_ik / N².  Two sets are found greedily.  One starts with all views, and the view
that shares most with the others is removed repeatedly.  The other is built up by repeatedly adding
the view that shares least with those in it.  Both are improved by exchanging one view for another
as long as this reduces K, and the better one is the result.  No single exchange improves it.  K is
at least 1/N, which it is for views that share nothing.

The smallest K does not give the largest V if views hide different shares p of the target: views
that share least are far apart and look through more of the canopy.  For V = 1 - ΣΣ_S J_ik / N², c
is replaced by the share that both views hide, J_ik = p_i p_k + c_ik √(p_i (1-p_i) p_k (1-p_k)).

Neither of these sets has the integral that is most similar to that of all M views, because views
that are far apart have another mean.  The expected squared difference of both integrals is
ΣΣ_S J_ik / N² - 2 Σ_S Σ_all J_ik / (N M) + ΣΣ_all J_ik / M².  Its first two terms are a sum over pairs
if -2 N/M Σ_all J_ik is added to each J_ii, so the same search minimises it.

Only the correlations of the model are used, not the voxels of the stand, because a set that is
optimised for the gaps of one plot is worse for other places.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from aosplan.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    Correlation = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]
    """Correlation of views as a function of their offsets along x and y [m], elementwise."""

MOST_VIEWS = 5000
"""Largest number of recorded views; their correlations need 200 MB."""

WORTHWHILE = 1e-12
"""Smallest relative decrease of the sum of correlations for which views are exchanged."""


def choose_views(
    positions_m: ArrayLike,
    samples: int,
    correlation: Correlation,
    hidden: ArrayLike | None = None,
    *,
    alike: bool = False,
) -> NDArray[np.intp]:
    """Choose the views that share the fewest occluders, or that together show most.

    Parameters
    ----------
    positions_m
        Shape (M, 2): x and y of the recorded views.
    samples
        N, number of views to choose, from 1 to M.
    correlation
        Correlation of two views as a function of their offset along x and y; 1 for no offset.
    hidden
        Shape (M,): share p of the target that each view hides, to maximise V; None to maximise V̂.
    alike
        Whether to make the integral of the chosen views as similar as possible to that of all
        views, instead of maximising V; requires `hidden`.

    Returns
    -------
    ndarray
        Shape (N,): indices of the chosen views, increasing.

    Raises
    ------
    RequestError
        If there are fewer views than `samples`, or more than `MOST_VIEWS`.
    """
    points = np.asarray(positions_m, dtype=np.float64)
    check_count(len(points), samples)
    shared = correlations(points, correlation)
    if hidden is not None:
        shared = jointly(shared, np.asarray(hidden, dtype=np.float64))
    if alike:
        shared = representing(shared, samples)
    first = int(np.lexsort((points[:, 1], points[:, 0]))[0])
    starts = fewest_shared(shared, samples), least_shared(shared, samples, first)
    return min((exchanged(shared, start) for start in starts), key=lambda s: shortfall(shared, s))


def check_count(count: int, samples: int) -> None:
    """Refuse to choose from fewer views than are requested, or from more than `MOST_VIEWS`."""
    if count < samples:
        raise RequestError(
            f"{count} positions are fewer than --samples {samples}", "give fewer samples"
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
    """J, the share that both views of each pair hide, from their correlations and hidden shares."""
    spread = np.sqrt(hidden * (1.0 - hidden))
    joint: NDArray[np.float64] = np.outer(hidden, hidden) + shared * np.outer(spread, spread)
    return joint


def representing(joint: NDArray[np.float64], samples: int) -> NDArray[np.float64]:
    """J with another diagonal, so that the views with the smallest ΣΣ_S represent all views.

    The integral of these views is then the most similar to that of all views.
    """
    changed = joint.copy()
    np.fill_diagonal(changed, joint.diagonal() - 2.0 * samples * joint.mean(axis=1))
    return changed


def fewest_shared(shared: NDArray[np.float64], samples: int) -> NDArray[np.bool_]:
    """Mask of the views that remain if the one that shares most with the others is always removed."""
    chosen = np.ones(len(shared), dtype=bool)
    sums = shared.sum(axis=1) - 0.5 * shared.diagonal()  # a view with itself is one pair
    for _ in range(len(shared) - samples):
        worst = int(np.argmax(np.where(chosen, sums, -np.inf)))
        chosen[worst] = False
        sums -= shared[worst]
    return chosen


def least_shared(shared: NDArray[np.float64], samples: int, first: int) -> NDArray[np.bool_]:
    """Mask of the views if the one that shares least with those chosen is always added to `first`."""
    chosen = np.zeros(len(shared), dtype=bool)
    sums = 0.5 * shared.diagonal()
    view = first
    for _ in range(samples):
        chosen[view] = True
        sums += shared[view]
        view = int(np.argmin(np.where(chosen, np.inf, sums)))
    return chosen


def exchanged(shared: NDArray[np.float64], chosen: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Exchange views one by one as long as this reduces the sum of correlations."""
    chosen = chosen.copy()
    sums = shared[:, chosen].sum(axis=1)
    while True:
        inside, outside = np.flatnonzero(chosen), np.flatnonzero(~chosen)
        if not len(outside):
            return inside
        # Replacing i by j changes ΣΣ by 2 (Σ_k c_jk - c_ij) + c_jj - (2 Σ_k c_ik - c_ii).
        own = shared.diagonal()
        change = (
            (2.0 * sums[outside] + own[outside])[None, :]
            - (2.0 * sums[inside] - own[inside])[:, None]
            - 2.0 * shared[np.ix_(inside, outside)]
        )
        best = int(np.argmin(change))
        leaves, enters = inside[best // len(outside)], outside[best % len(outside)]
        if change.flat[best] >= -WORTHWHILE * abs(sums[inside].sum()):
            return inside
        chosen[leaves], chosen[enters] = False, True
        sums += shared[enters] - shared[leaves]


def shortfall(shared: NDArray[np.float64], chosen: NDArray[np.intp]) -> float:
    """K of a set of views."""
    return float(shared[np.ix_(chosen, chosen)].mean())
