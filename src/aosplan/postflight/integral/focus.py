"""Search for the height at which the views agree, with small corrections of their poses.

The agreement as a function of height (`aosplan.postflight.integral.agreement`) has a peak at the
ground, and often another peak at the crowns.  Errors of positions and of the compass flatten both
peaks.  Poses are therefore corrected (`aosplan.postflight.integral.alignment`) at the highest point
of a coarse curve.  With corrected poses, a fine curve has clearer peaks.  The ground is the lowest
peak.  If there is only one peak, it may be the ground or the crowns.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.errors import RequestError
from aosplan.postflight.integral.agreement import (
    LONGEST_PX,
    WEAK,
    Agreement,
    Detail,
    Peak,
    agreement_at,
    details_of,
    peak_near,
    peaks_of,
)
from aosplan.postflight.integral.alignment import Correction, fitted, shifts_of
from aosplan.postflight.integral.distance_scan import range_below

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from aosplan.postflight.integral.camera_pose import View
    from aosplan.postflight.integral.focal_plane import Raster
    from aosplan.postflight.integral.recording import Recording

    Floats = NDArray[np.float64]

ALIGNMENTS = ("none", "yaw", "positions")
"""Kinds of corrections: no correction, one yaw for all views, or this yaw and the position of each
view.
"""

BELOW, ABOVE = 0.25, 0.55
"""Default range of heights below and above the plane, as shares of the height of the cameras."""

STEP_PX = 1.3
"""Shift of the outermost views from one plane of the search to the next, in pixels."""

MOST_STEPS = 240
"""Largest number of heights."""

MOST_PIXELS = 60_000_000
"""Largest number of pixels of all views that are stored at once (240 MB)."""

ROUNDS = 4
"""Number of times that shifts are measured and corrected at each resolution."""

LEAST_VIEWS = 4
"""Smallest number of views for a search. Fewer views cannot distinguish heights."""


class Focus(NamedTuple):
    """Result of a search for the focus.

    Attributes
    ----------
    heights_m
        Heights that were examined, along the world's upward axis, in increasing order.
    curve
        Agreement of halves of the views at each height.
    ground, crowns
        Peaks of the curve: the lowest peak, and the highest peak above it.  If there is no other
        peak, `crowns` is None, and `ground` may be the ground or the crowns.
    correction
        Corrections of the recorded poses. Without an alignment, they are zero.
    yaw_deviation_deg
        Standard deviation of the yaw correction.
    aligned
        Number of views whose shift was significant.
    at_end
        Whether the peak of the ground is at an end of the range of heights.
    """

    heights_m: Floats
    curve: list[Agreement]
    ground: Peak
    crowns: Peak | None
    correction: Correction
    yaw_deviation_deg: float
    aligned: int
    at_end: bool

    @property
    def name(self) -> str:
        """Name of the layer in focus."""
        return "lowest layer found" if self.crowns is None else "ground"

    def document(self) -> dict[str, Any]:
        """The result as plain values."""
        moved = self.correction.shifts_m
        return {
            "heights_m": [float(height) for height in self.heights_m],
            "agreement": [each.value for each in self.curve],
            "ground": self.ground._asdict(),
            "crowns": None if self.crowns is None else self.crowns._asdict(),
            "yaw_offset_deg": self.correction.yaw_deg,
            "yaw_deviation_deg": self.yaw_deviation_deg,
            "aligned_views": self.aligned,
            "moved_m": float(np.sqrt(np.mean(moved**2))),
        }


class _Level(NamedTuple):
    details: list[Detail]
    raster: Raster


def read_heights(text: str) -> tuple[float, float] | float | None:
    """Parse ``--focus``: a range H1..H2, a height, or None for auto.

    Raises
    ------
    RequestError
        If the text has none of these forms.
    """
    from aosplan.postflight.integral.camera_pose import FARTHEST_M
    from aosplan.units import number

    if text == "auto":
        return None
    ends = text.split("..")
    if len(ends) > 2:
        raise RequestError(f"--focus '{text}' is not a range", "give auto, H or H1..H2 in metres")
    heights = [number(end, "--focus", "m") for end in ends]
    if max(map(abs, heights)) > FARTHEST_M:
        raise RequestError(f"--focus '{text}' is more than {FARTHEST_M:g} m from the origin")
    return heights[0] if len(heights) == 1 else (heights[0], heights[1])


def search_of(
    focus: str | tuple[float, float] | None, focal_height_m: float | None, surface: str | None
) -> tuple[tuple[float, float] | str | None, float | None]:
    """Heights to search (or ``auto``; None for no search), and the height of the plane [m].

    Raises
    ------
    RequestError
        If ``--focus`` is not valid, or if it contradicts another option.
    """
    if focus is None:
        return None, focal_height_m
    found = read_heights(focus) if isinstance(focus, str) else focus
    if isinstance(found, float):
        if focal_height_m is not None:
            raise RequestError("--focus H and --focal-height both set the height", "leave one out")
        return None, found
    if surface is not None:
        raise RequestError(
            f"--focus {focus} searches for a plane, which contradicts --focal-surface",
            "to raise the surface, give --focal-height M",
        )
    return "auto" if found is None else found, focal_height_m


def focus_recording(
    recording: Recording,
    indices: NDArray[np.intp],
    heights_m: tuple[float, float] | str | None,
    *,
    align: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Focus | None:
    """Find the focus of a recording (`find_focus`), and apply it to the plane and the views of the
    recording.

    Parameters
    ----------
    recording, indices, progress
        As for `find_focus`.
    heights_m
        Heights of the lowest and the highest plane, or ``auto``. If it is None, there is no search,
        and the result is None.
    align
        One of `ALIGNMENTS`; by default ``positions`` if the standard deviation of the recorded
        positions is known, as for photos, and ``none`` otherwise.

    Raises
    ------
    RequestError
        In the same cases as `find_focus`.
    """
    if heights_m is None:
        return None
    if align is None:
        align = "none" if recording.sigma_m is None else "positions"
    if align not in ALIGNMENTS:
        raise RequestError(f"--align '{align}' is not one of {', '.join(ALIGNMENTS)}")
    found = find_focus(
        recording,
        indices,
        None if isinstance(heights_m, str) else heights_m,
        align=align,
        sigma_m=recording.sigma_m or 0.5,
        progress=progress,
    )
    chosen = [recording.views[index] for index in indices]
    recording.refocus(
        found.ground.place, found.correction.applied(chosen, recording.plane.frame), indices
    )
    return found


def find_focus(
    recording: Recording,
    indices: NDArray[np.intp],
    heights_m: tuple[float, float] | None = None,
    *,
    align: str = "none",
    sigma_m: float = 0.5,
    progress: Callable[[int, int], None] | None = None,
) -> Focus:
    """Find the height of the ground, and, if requested, errors of the poses.

    Parameters
    ----------
    recording
        The views.
    indices
        Indices of the views to use.
    heights_m
        Heights of the lowest and the highest plane. If it is None, heights around the plane of the
        recording are searched if the heights of the cameras above the ground are known; otherwise,
        all distances are searched.
    align
        One of `ALIGNMENTS`.
    sigma_m
        Standard deviation of recorded positions.  Shifts of up to three times this value are
        examined.
    progress
        Function that is called with the number of finished steps and the total number of steps.

    Raises
    ------
    RequestError
        If there are too few views, if a camera is below a plane, or if the views do not agree at
        any height.
    """
    if len(indices) < LEAST_VIEWS:
        raise RequestError(
            f"--focus needs at least {LEAST_VIEWS} photos, and there are {len(indices)}",
            "give the height of the plane with --focal-height M",
        )
    wide = None
    if heights_m is None and not recording.is_height_known:
        wide = range_below(recording, indices)
    search = _Search(recording, indices, sigma_m, progress or (lambda _done, _all: None))
    low, high = heights_m or wide or search.usual_range()
    places = search.heights_between(low, high)
    few = places[:: 2 if len(places) > 20 else 1]
    correction = Correction.none(len(indices))
    levels = [search.level(2), search.level(1)]
    coarse = search.curve(levels[0], few, correction)
    start = float(few[int(np.argmax([each.value for each in coarse]))])
    if max(each.value for each in coarse) < WEAK:
        raise RequestError(
            f"no plane from {low:g} to {high:g} m is in focus: the best agreement between "
            f"halves of the photos is {max(each.value for each in coarse):.2g}",
            "give other heights with --focus H1..H2, or give the height with --focal-height M",
        )
    aligned = 0
    if align != "none":
        for level in levels:
            start, correction, aligned = search.align(level, start, correction, align)
    fine = search.curve(levels[1], places, correction)
    lowest, highest = peaks_of(places, fine)
    if align != "none":
        ground, correction, aligned = search.align(
            levels[1], float(places[lowest]), correction, align
        )
        if abs(ground - places[lowest]) > 0.5 * np.diff(places).max():
            fine = search.curve(levels[1], places, correction)
            lowest, highest = peaks_of(places, fine)
    found = search.refined(levels[1], places, lowest, correction)
    crowns = None if highest is None else peak_near(places, fine, highest)
    doubt = search.doubt(correction, align)
    deviation = math.hypot(found.deviation, doubt * (search.camera_m - found.place))
    return Focus(
        places,
        fine,
        found._replace(deviation=deviation),
        crowns,
        correction,
        math.degrees(doubt),
        aligned,
        lowest in (0, len(places) - 1),
    )


class _Search:
    """The views of a recording, projected on planes at different heights."""

    def __init__(
        self,
        recording: Recording,
        indices: NDArray[np.intp],
        sigma_m: float,
        progress: Callable[[int, int], None],
    ) -> None:
        self._plane = recording.plane
        self._sources = [recording.sources[index] for index in indices]
        self._views = [source.view for source in self._sources]
        self._positions = recording.positions_m[indices]
        self.camera_m = float(recording.heights_m[indices].mean()) + recording.plane.height_m
        self._recording = recording
        self._reach_m = 3.0 * sigma_m
        self._from_middle = self._positions - self._positions.mean(axis=0)
        self._progress = progress
        self._done, self._all = 0, 1

    def _step(self, count: int = 1) -> None:
        self._done += count
        self._progress(self._done, max(self._all, self._done))

    def usual_range(self) -> tuple[float, float]:
        height = self.camera_m - self._plane.height_m
        return self._plane.height_m - BELOW * height, self._plane.height_m + ABOVE * height

    def heights_between(self, low: float, high: float) -> Floats:
        """Heights that are so far apart that the outermost views can distinguish their planes. Near
        the cameras, the heights are closer together.
        """
        if not low < high:
            raise RequestError(f"--focus {low:g}..{high:g} is empty", "give the lower height first")
        if not high < self.camera_m:
            raise RequestError(
                f"--focus reaches {high:g} m, but the cameras are only at {self.camera_m:.4g} m",
                "heights are measured along the upward axis of the world",
            )
        extent = float(np.hypot(*np.ptp(self._positions, axis=0)))
        if not extent > 0.0:
            raise RequestError("--focus is not possible, because all photos are from one place")
        focal = self._sources[0].intrinsics.fx_px * min(
            LONGEST_PX / max(self._sources[0].intrinsics[:2]), 1.0
        )
        # Between planes at h and h', a view at the distance b from the centre shifts by f b
        # (1/(A-h) - 1/(A-h')) pixels.
        near, far = 1.0 / (self.camera_m - high), 1.0 / (self.camera_m - low)
        steps = math.ceil((near - far) * focal * 0.5 * extent / STEP_PX)
        steps = min(max(steps, 8), MOST_STEPS)
        places: Floats = self.camera_m - 1.0 / np.linspace(far, near, steps + 1)
        return places

    def level(self, coarser: int) -> _Level:
        """Detail of all views in images that are reduced by the factor `coarser`, and a raster for
        their pixels.
        """
        own = max(self._sources[0].intrinsics[:2])
        most = math.sqrt(MOST_PIXELS / len(self._sources))
        longest = max(int(min(own, LONGEST_PX, most)) // coarser, 32)
        details = details_of(self._sources, longest, self._step)
        gsd = self._recording.raster("centre").gsd_m
        scale = own / max(details[0].intrinsics[:2])
        return _Level(details, self._recording.raster("centre", gsd * scale))

    def _views_of(self, correction: Correction) -> list[View]:
        return correction.applied(self._views, self._plane.frame)

    def curve(self, level: _Level, places: Floats, correction: Correction) -> list[Agreement]:
        views = self._views_of(correction)
        self._all = self._done + len(places)
        found = []
        for place in places:
            plane = self._plane._replace(height_m=float(place))
            found.append(agreement_at(level.details, views, plane, level.raster))
            self._step()
        return found

    def align(
        self, level: _Level, height_m: float, correction: Correction, align: str
    ) -> tuple[float, Correction, int]:
        """Find the height and the corrections with which the shifts of views have neither growth
        nor rotation.
        """
        clear = 0
        for _ in range(ROUNDS):
            plane = self._plane._replace(height_m=height_m)
            shifts, is_clear = shifts_of(
                level.details, self._views_of(correction), plane, level.raster, self._reach_m
            )
            clear = int(is_clear.sum())
            if clear < max(LEAST_VIEWS, len(shifts) // 4):
                return height_m, correction, clear
            fit = fitted(shifts, is_clear, self._positions)
            limit = 0.5 * (self.camera_m - height_m)
            height_m -= float(np.clip(fit.growth * (self.camera_m - height_m), -limit, limit))
            moved = correction.shifts_m
            if align == "positions":
                moved = moved - fit.rest_m
            correction = Correction(correction.yaw_deg - math.degrees(fit.turn_rad), moved)
        return height_m, correction, clear

    def refined(
        self,
        level: _Level,
        places: Floats,
        index: int,
        correction: Correction,
    ) -> Peak:
        """The peak, with a more accurate position between the neighbouring heights."""
        first, last = places[max(index - 2, 0)], places[min(index + 2, len(places) - 1)]
        closer = np.linspace(first, last, 9)
        found = self.curve(level, closer, correction)
        best = int(np.argmax([each.value for each in found]))
        return peak_near(closer, found, best)

    def doubt(self, correction: Correction, align: str) -> float:
        """Standard errors of the relative growth and of the rotation [rad], caused by errors of the
        positions.
        """
        if align != "positions":
            return 0.0
        sigma = float(np.sqrt(np.mean(correction.shifts_m**2)))
        return sigma / math.sqrt(float((self._from_middle**2).sum()))
