"""Selection of the N recorded views that share the fewest occluders.

Let c_ik be the correlation of views i and k, and ΣΣ_S the sum over all ordered pairs of views in a
set S. A set S of N views has the shortfall 1 - V̂ = K = ΣΣ_S c_ik / N². Two sets are found by
greedy algorithms. The first algorithm starts with all views, and repeatedly removes the view that
shares the most occluders with the remaining views. The second starts with one view, and repeatedly
adds the view that shares the fewest occluders with the chosen views. Both sets are then improved by
exchanging one view for another, as long as this reduces K. The result is the better of the two
sets. No exchange of a single view improves it. K is at least 1/N. It equals 1/N for views that do
not share occluders.

If views hide different shares p of the target, the smallest K does not give the largest V. The
reason is that the views that share the fewest occluders are far apart, and look through more of the
canopy. To maximise V = 1 - ΣΣ_S J_ik / N², c is replaced by J, the share of the target that is
hidden in both views: J_ik = p_i p_k
+ c_ik √(p_i (1-p_i) p_k (1-p_k)).

The set whose integral image is most similar to the integral image of all M views is a different
set, because views that are far apart have a different mean. The expected squared difference of the
two integral images is ΣΣ_S J_ik / N² - 2 Σ_S Σ_all J_ik / (N M) + ΣΣ_all J_ik / M². If -2 N/M Σ_all
J_ik is added to each J_ii, the first two terms are a sum over pairs of S. The same search therefore
minimises this difference.

The search uses only the correlations of the model and not the voxels of the stand. A set that is
optimised for the gaps of one plot would be worse than others at other places.
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
"""Largest number of recorded views.  Their correlations need 200 MB."""

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
    """Choose the views that share the fewest occluders, or the views that together have the highest
    visibility.

    Parameters
    ----------
    positions_m
        Shape (M, 2): x and y of the recorded views.
    samples
        N, number of views to choose, from 1 to M.
    correlation
        Correlation of two views as a function of their offset along x and y.  It is 1 for the
        offset 0.
    hidden
        Share p of the target that is hidden in each view, shape (M,). If it is given, V is
        maximised; if it is None, V̂ is maximised.
    alike
        Whether the views are chosen so that their integral is as similar as possible to the
        integral of all views, instead of maximising V. This requires `hidden`.

    Returns
    -------
    ndarray
        Shape (N,): indices of the chosen views, in increasing order.

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
    """Refuse to choose more views than there are, or to choose from more than `MOST_VIEWS`
    views.
    """
    if count < samples:
        raise RequestError(
            f"{count} photos are fewer than --samples {samples}",
            "give a smaller number of --samples",
        )
    if count > MOST_VIEWS:
        raise RequestError(
            f"{count} photos are too many; aosplan can choose from at most {MOST_VIEWS} photos",
            "leave out every other photo, or divide the recording",
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
    """J, the share of the target that is hidden in both views of each pair. It is computed from the
    correlations and hidden shares of the views.
    """
    spread = np.sqrt(hidden * (1.0 - hidden))
    joint: NDArray[np.float64] = np.outer(hidden, hidden) + shared * np.outer(spread, spread)
    return joint


def representing(joint: NDArray[np.float64], samples: int) -> NDArray[np.float64]:
    """Change the diagonal of J.

    After this change, the set S with the smallest sum ΣΣ_S is the set whose integral image is most
    similar to the integral image of all views.
    """
    changed = joint.copy()
    np.fill_diagonal(changed, joint.diagonal() - 2.0 * samples * joint.mean(axis=1))
    return changed


def fewest_shared(shared: NDArray[np.float64], samples: int) -> NDArray[np.bool_]:
    """Mask of the views that remain after views have been removed one by one. In each step, the
    view that shares the most occluders with the others is removed.
    """
    chosen = np.ones(len(shared), dtype=bool)
    # The pair of a view with itself is counted once.
    sums = shared.sum(axis=1) - 0.5 * shared.diagonal()
    for _ in range(len(shared) - samples):
        worst = int(np.argmax(np.where(chosen, sums, -np.inf)))
        chosen[worst] = False
        sums -= shared[worst]
    return chosen


def least_shared(shared: NDArray[np.float64], samples: int, first: int) -> NDArray[np.bool_]:
    """Mask of chosen views. The first chosen view is `first`. In each further step, the view that
    shares the fewest occluders with the chosen views is added.
    """
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
        # If the view i is replaced by the view j, ΣΣ changes by 2 (Σ_k c_jk - c_ij) + c_jj - (2 Σ_k
        # c_ik - c_ii).
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
