"""Search for candidates of targets: anomalies in single photos, and hot spots in the integral
image.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from aosplan.postflight.integral.georeference import Georeference
    from aosplan.postflight.integral.images import Picture
    from aosplan.postflight.integral.integral import Integral, ViewSource

RX_SHARE = 0.99
"""Quantile of a photo's RX scores above which a pixel is an anomaly."""

CLEAR = 4.0
"""Smallest difference between a hot spot and its surroundings, in standard deviations."""

WINDOW_M = 4.0
"""Standard deviation of the Gaussian window for the surroundings of a spot."""

MOST_SPOTS = 200


def anomalies(_source: ViewSource, picture: Picture) -> Picture:
    """A picture in which anomalies of a photo are 1 and all other pixels are 0.

    This is the RX detector of Reed and Yu. The score of a pixel is the squared Mahalanobis distance
    between its values and the values of all pixels of the photo. A pixel is an anomaly if its score
    exceeds the quantile `RX_SHARE` of all scores.
    """
    rows, columns, bands = picture.pixels.shape
    flat = picture.pixels.reshape(-1, bands).T.astype(np.float64)
    finite = np.isfinite(flat).all(axis=0)
    off = flat - flat[:, finite].mean(axis=1, keepdims=True)
    spread = np.atleast_2d(np.cov(off[:, finite])) + 1e-9 * np.eye(bands)
    score = np.einsum("ip,ij,jp->p", off, np.linalg.inv(spread), off)
    mask = score > np.quantile(score[finite], RX_SHARE)
    pixels = mask.reshape(rows, columns, 1).astype(np.float32)
    return picture._replace(pixels=pixels, is_byte=False)


class HotSpot(NamedTuple):
    """A place that differs from its surroundings.

    Attributes
    ----------
    x_m, y_m
        Centre on the plane, weighted by the difference.
    area_m2, size_m
        Area in which the difference is at least half of its maximum, and side of a square with this
        area.
    contrast
        Mean value of the spot minus the mean value of the surroundings, in the units of the photos.
    deviations
        Largest difference in standard deviations of the surroundings.
    """

    x_m: float
    y_m: float
    area_m2: float
    size_m: float
    contrast: float
    deviations: float


def hot_spots(integral: Integral, seen: NDArray[np.bool_]) -> list[HotSpot]:
    """Places of an integral image that are brighter or darker than their surroundings.  The
    clearest place is the first.
    """
    from scipy.ndimage import find_objects, gaussian_filter, label

    raster = integral.raster
    grey = np.where(seen, np.nanmean(np.where(seen[..., None], integral.values, 0.0), axis=-1), 0.0)
    window = WINDOW_M / raster.gsd_m

    def smooth(image: NDArray[np.float64], weight: NDArray[np.float64]) -> NDArray[np.float64]:
        blurred: NDArray[np.float64] = gaussian_filter(image * weight, window)
        return blurred / np.maximum(gaussian_filter(weight, window), 1e-9)

    weight = seen.astype(np.float64)
    # In each round, the spots that have been found are excluded from the surroundings.
    for _ in range(3):
        mean = smooth(grey, weight)
        spread = np.sqrt(np.maximum(smooth((grey - mean) ** 2, weight), 1e-12))
        score = np.where(seen, (grey - mean) / spread, 0.0)
        weight = (seen & (np.abs(score) < CLEAR)).astype(np.float64)
    found = []
    for sign in (1.0, -1.0):
        parts, _ = label(sign * score > CLEAR)
        for index, box in enumerate(find_objects(parts), 1):
            part = parts[box] == index
            if part.sum() < 2:
                continue
            above = np.where(part, sign * (grey[box] - mean[box]), 0.0)
            # This is the part of the spot in which the difference is at least half of its maximum.
            part = above >= 0.5 * above.max()
            rows, columns = np.nonzero(part)
            off = np.abs(grey[box] - mean[box])[part]
            row = float(np.average(rows, weights=off)) + box[0].start + 0.5
            column = float(np.average(columns, weights=off)) + box[1].start + 0.5
            area = float(part.sum()) * raster.gsd_m**2
            found.append(
                HotSpot(
                    raster.left_m + column * raster.gsd_m,
                    raster.top_m - row * raster.gsd_m,
                    area,
                    area**0.5,
                    float((grey[box] - mean[box])[part].mean()),
                    sign * float((sign * score[box])[part].max()),
                )
            )
    found.sort(key=lambda spot: -abs(spot.deviations))
    return found[:MOST_SPOTS]


def geojson_bytes(spots: Sequence[HotSpot], georeference: Georeference | None) -> bytes:
    """Hot spots as GeoJSON points.  The clearest spot is the first.

    Raises
    ------
    RequestError
        If the recording has no location.
    """
    if georeference is None:
        raise RequestError(
            "--hot-spots needs photos with positions: the poses have no geographic coordinates"
        )
    features: list[dict[str, Any]] = []
    if spots:
        latitude, longitude = georeference.places(
            [spot.x_m for spot in spots], [spot.y_m for spot in spots]
        )
        for rank, (spot, north, east) in enumerate(zip(spots, latitude, longitude, strict=True), 1):
            numbers = {name: float(f"{value:.6g}") for name, value in spot._asdict().items()}
            features.append(
                {
                    "type": "Feature",
                    "geometry": {
                        "type": "Point",
                        "coordinates": [round(float(east), 9), round(float(north), 9)],
                    },
                    "properties": {"rank": rank, **numbers},
                }
            )
    return (
        json.dumps({"type": "FeatureCollection", "features": features}, indent=1) + "\n"
    ).encode()
