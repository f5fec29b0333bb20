"""Search for the distance of the ground from the cameras if the heights of the cameras above the
ground are not known.

The height of the ground cannot be computed from poses of photogrammetry or from heights above sea
level. Planes at very different distances are therefore compared first. The nearest plane is at
twice the spacing of the views, because neighbouring photos do not overlap on nearer planes. The
farthest plane is at the largest distance at which the views can distinguish planes.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from aosplan.errors import RequestError
from aosplan.postflight.integral.agreement import agreement_at, details_of
from aosplan.postflight.integral.focal_plane import Raster, footprint_m, pixel_m

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.postflight.integral.recording import Recording

MOST_VIEWS = 32
"""Number of views, around the central one, that are compared."""

LONGEST_PX = 240
"""Longest side of the images that are compared."""

STEP_PX = 1.3
"""Shift of the outermost views between two neighbouring planes [px of these images]."""

NEAREST, FARTHEST = 0.2, 20.0
"""Smallest and largest distance, divided by the extent of the views.  The smallest distance is at
least twice the spacing of the views.
"""

NEARER, FARTHER = 0.5, 2.2
"""Range of distances that is searched in finer steps, divided by the distance of the clearest
plane.

The clearest plane may be at the crowns.  The ground is then up to about twice as far away.
"""


def range_below(recording: Recording, indices: NDArray[np.intp]) -> tuple[float, float]:
    """Range of heights that contains the clearest plane, and also the ground if the clearest plane
    is at the crowns.

    This function moves the plane of the recording to the clearest plane.

    Raises
    ------
    RequestError
        If all views are from one place.
    """
    positions = recording.positions_m[indices]
    middle = 0.5 * (positions.min(axis=0) + positions.max(axis=0))
    order = np.argsort(np.hypot(*(positions - middle).T), kind="stable")[:MOST_VIEWS]
    near = indices[order]
    extent = float(np.hypot(*np.ptp(recording.positions_m[near], axis=0)))
    if not extent > 0.0:
        raise RequestError("--focus is not possible, because all photos are from one place")
    sources = [recording.sources[index] for index in near]
    views = [source.view for source in sources]
    details = details_of(sources, LONGEST_PX)
    camera_m = float(recording.heights_m[near].mean()) + recording.plane.height_m
    closest = max(2.0 * (recording.nearest_m(near) or 0.0), NEAREST * extent)
    nearest, farthest = 1.0 / closest, 1.0 / (FARTHEST * extent)
    lens = details[0].intrinsics
    steps = math.ceil((nearest - farthest) * lens.fx_px * 0.5 * extent / STEP_PX)
    distances = 1.0 / np.linspace(farthest, nearest, steps + 1)
    values = []
    for distance in distances:
        plane = recording.plane._replace(height_m=camera_m - float(distance))
        try:
            corners = footprint_m(plane, views[0], lens)
        except RequestError:  # The central camera is below this plane, or sees the horizon.
            values.append(0.0)
            continue
        raster = Raster.over([*corners.min(axis=0), *corners.max(axis=0)], pixel_m(corners, lens))
        values.append(agreement_at(details, views, plane, raster).value)
    distance = float(distances[_clearest(np.array(values))])
    recording.refocus(camera_m - distance, (), np.array([], dtype=np.intp))
    return camera_m - FARTHER * distance, camera_m - NEARER * distance


def _clearest(values: NDArray[np.float64]) -> int:
    """Index of the peak that rises most above its surroundings; if there are no peaks, index of the
    largest value.
    """
    from scipy.signal import find_peaks

    found, about = find_peaks(values, prominence=0.0)
    return int(found[np.argmax(about["prominences"])] if len(found) else np.argmax(values))
