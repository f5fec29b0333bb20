"""Subsets of views: all views, views within a smaller aperture, a thinned set of views, or a list.

A subset is written as ``all``, or as one or more of ``pitch=M``, ``aperture=M`` and ``views=LIST``,
separated by spaces.  The conditions are applied in this order: first the list, then the aperture,
then the pitch.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.errors import RequestError
from aosplan.files import read_bytes
from aosplan.units import at_least_zero, nearest_hint, positive, shown

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

PARTS = ("views", "aperture", "pitch")


class ViewSubset(NamedTuple):
    """The views of a recording to integrate.

    Parameters
    ----------
    pitch_m
        Smallest distance between views; None for no limit.
    aperture_m
        Side of a square around the centre of the recording.  Only views in this square are used.
    views
        Numbers from 1, ranges and names, separated by commas, or a file that contains these; None
        for all views.
    """

    pitch_m: float | None = None
    aperture_m: float | None = None
    views: str | None = None


def read_view_subset(text: str, name: str) -> ViewSubset:
    """Parse a subset from text such as ``pitch=2.8 aperture=14``, or ``all``.

    Raises
    ------
    RequestError
        If a part is unknown.
    """
    parts = text.split()
    if parts == ["all"]:
        return ViewSubset()
    given: dict[str, str] = {}
    for part in parts:
        key, equals, value = part.partition("=")
        if not equals or key not in PARTS or key in given:
            raise RequestError(
                f"{name} {shown(text)}: {shown(part)} is not one of "
                f"{', '.join(f'{known}=…' for known in PARTS)}, or is given twice",
                nearest_hint(key, PARTS) or "give these parts, or only all",
            )
        given[key] = value
    if not given:
        raise RequestError(
            f"{name} {shown(text)} names no photos", "give all, or a part such as pitch=M"
        )
    return view_subset_of(given.get("pitch"), given.get("aperture"), given.get("views"), name)


def view_subset_of(
    pitch: str | None, aperture: str | None, views: str | None, name: str = ""
) -> ViewSubset:
    """A subset from the texts of its parts."""
    place = f"{name} " if name else "--"
    return ViewSubset(
        None if pitch is None else positive(pitch, f"{place}pitch", "m"),
        None if aperture is None else at_least_zero(aperture, f"{place}aperture", "m"),
        views,
    )


def chosen(
    choice: ViewSubset, names: Sequence[str], positions_m: NDArray[np.float64]
) -> NDArray[np.intp]:
    """Indices of the views of a subset, in increasing order.

    Parameters
    ----------
    choice
        The subset.
    names
        Names of all views.
    positions_m
        Shape (N, 2): positions of the views along the focal plane.

    Raises
    ------
    RequestError
        If the subset names a view that does not exist, or contains no views.
    """
    left = np.arange(len(names)) if choice.views is None else _listed(choice.views, names)
    middle = 0.5 * (positions_m.min(axis=0) + positions_m.max(axis=0))
    offsets = positions_m - middle
    if choice.aperture_m is not None:
        # Because of the tolerance, all views of a grid with exactly this aperture are inside, in
        # spite of rounding errors.
        reach = 0.5 * choice.aperture_m * (1.0 + 1e-9) + 1e-9
        left = left[np.abs(offsets[left]).max(axis=1) <= reach]
    if choice.pitch_m is not None and len(left):
        left = _thinned(left, offsets, choice.pitch_m)
    if not len(left):
        raise RequestError(
            f"no photo is in a square of {choice.aperture_m:g} m around the middle",
            "a larger --aperture",
        )
    return left


def _thinned(
    left: NDArray[np.intp], offsets: NDArray[np.float64], pitch_m: float
) -> NDArray[np.intp]:
    """Views that are at least one pitch apart, chosen from the centre outwards.

    Each view that is left out is closer than one pitch to a chosen view.
    """
    from scipy.spatial import cKDTree

    points = offsets[left]
    tree = cKDTree(points)
    free = np.ones(len(left), dtype=bool)
    kept = []
    for index in np.argsort(np.hypot(*points.T), kind="stable"):
        if free[index]:
            kept.append(index)
            # Because of the tolerance, all sites of a grid with exactly this pitch are chosen, in
            # spite of rounding errors.
            free[tree.query_ball_point(points[index], pitch_m * (1.0 - 1e-9))] = False
    return np.sort(left[kept])


def _listed(text: str, names: Sequence[str]) -> NDArray[np.intp]:
    """Indices of the views that a list or a file names."""
    if os.path.isfile(text):
        try:
            entries = read_bytes(text).decode("utf-8-sig").splitlines()
        except UnicodeDecodeError as error:
            raise RequestError(f"'{text}' is not UTF-8 text (byte {error.start})") from None
        place = f"'{text}'"
    else:
        entries, place = text.split(","), f"views {shown(text)}"
    known = {name: index for index, name in enumerate(names)}
    found: set[int] = set()
    for entry in (entry.strip() for entry in entries):
        if not entry or entry.startswith("#"):
            continue
        if entry in known:
            found.add(known[entry])
            continue
        first, dash, last = entry.partition("-")
        ends = [first, last] if dash else [first]
        if not all(end.strip().isascii() and end.strip().isdecimal() for end in ends):
            raise RequestError(
                f"{place}: no image is called {shown(entry)}",
                nearest_hint(entry, names) or "give names, numbers from 1, or ranges such as 1-9",
            )
        low, high = (int(end[:12]) for end in (ends[0], ends[-1]))
        if not 1 <= low <= high <= len(names):
            raise RequestError(
                f"{place}: {shown(entry)} is not within 1 to {len(names)}",
                "photos are numbered from 1, in the order of the poses",
            )
        found.update(range(low - 1, high))
    if not found:
        raise RequestError(f"{place} names no photos")
    return np.array(sorted(found))
