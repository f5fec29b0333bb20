"""Reading of poses from OpenDroneMap's ``shots.geojson``.

Each feature has the position of a photo as latitude and longitude. Its properties are ``filename``,
``width`` and ``height``, and three others. ``focal`` is the focal length divided by the longer side
of the image. ``translation`` is the position of the camera in metres, in the UTM zone of the
reconstruction. ``rotation`` is the rotation from world to camera, as an axis times an angle. The
file does not contain lens distortion. It should therefore be used with images whose distortion has
been removed.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from aosplan.errors import RequestError
from aosplan.files import read_table
from aosplan.messages import Message
from aosplan.postflight.integral.camera_pose import FARTHEST_M, View, checked_intrinsics
from aosplan.postflight.integral.georeference import Georeference
from aosplan.postflight.integral.photo_poses import PosedViews
from aosplan.units import number, shown, whole

if TYPE_CHECKING:
    from numpy.typing import NDArray


def read_shots(path: str) -> PosedViews:
    """Read the views of an OpenDroneMap reconstruction.

    The origin of the world is the centre of the photos. Its axes are parallel to the axes of the
    UTM zone. Heights are taken from the reconstruction.

    Raises
    ------
    RequestError
        If a property of a feature is missing or not valid.  The message names the feature.
    """
    features = read_table(path).get("features")
    if not isinstance(features, list) or not features:
        raise RequestError(f"'{path}' is not a GeoJSON FeatureCollection with features")
    found: dict[str, tuple[Any, ...]] = {}
    for index, feature in enumerate(features, 1):
        place = f"'{path}', feature {index}"
        name, *rest = _shot(feature, place)
        if name in found:
            raise RequestError(f"{place}: image {shown(name)} is given twice")
        found[name] = tuple(rest)
    places = np.array([shot[2] for shot in found.values()])
    positions = np.array([shot[1] for shot in found.values()])
    box = positions[:, :2].min(axis=0) + positions[:, :2].max(axis=0)
    middle = np.array([*np.rint(0.5 * box), 0.0])
    views = [
        View(name, rotation, -rotation @ (position - middle), lens)
        for name, (rotation, position, _, lens) in found.items()
    ]
    latitude, longitude = (float(value) for value in places.mean(axis=0))
    zone = min(int((longitude + 180.0) // 6.0) + 1, 60)
    map_of_it = Georeference(
        f"EPSG:{(32600 if latitude >= 0.0 else 32700) + zone}", float(middle[0]), float(middle[1])
    )
    x, y = map_of_it.to_world(*places.T)
    off = np.hypot(x - (positions - middle)[:, 0], y - (positions - middle)[:, 1]).max()
    if off > 1.0:
        # If the positions are in another zone or are local coordinates, the integral image is
        # correct but has no location.
        message = Message(
            "map",
            f"'{path}': translations differ by {off:.3g} m from those of "
            f"{map_of_it.crs}, so the integral image is not georeferenced",
        )
        return PosedViews(views, None, None, (message,), 0.1)
    return PosedViews(views, map_of_it, (latitude, longitude), (), 0.1)


def _shot(feature: Any, place: str) -> tuple[Any, ...]:
    properties = feature.get("properties") if isinstance(feature, dict) else None
    geometry = feature.get("geometry") if isinstance(feature, dict) else None
    if not isinstance(properties, dict) or not isinstance(geometry, dict):
        raise RequestError(f"{place} has no properties or no geometry")
    name = properties.get("filename")
    if not isinstance(name, str) or not name.strip() or "\0" in name:
        raise RequestError(f"{place} has no filename")
    place = f"{place} ({shown(name)})"
    turn = _triple(properties.get("rotation"), f"{place}: rotation")
    position = _triple(properties.get("translation"), f"{place}: translation")
    if np.abs(position).max() > FARTHEST_M:
        raise RequestError(f"{place}: the camera is more than {FARTHEST_M:g} m from the origin")
    coordinates = geometry.get("coordinates")
    if not isinstance(coordinates, list) or len(coordinates) < 2:
        raise RequestError(f"{place}: coordinates are not longitude and latitude")
    longitude, latitude = (number(value, f"{place}: coordinate") for value in coordinates[:2])
    if abs(latitude) > 90.0 or abs(longitude) > 180.0:
        raise RequestError(f"{place}: {latitude:g}, {longitude:g} is not a latitude and longitude")
    width = whole(properties.get("width"), f"{place}: width")
    height = whole(properties.get("height"), f"{place}: height")
    focal = number(properties.get("focal"), f"{place}: focal") * max(width, height)
    lens = checked_intrinsics(
        width, height, [focal, focal, 0.5 * width, 0.5 * height], f"{place}: focal"
    )
    return name, _by_axis(turn), position, (latitude, longitude), lens


def _triple(value: Any, name: str) -> NDArray[np.float64]:
    if not isinstance(value, list) or len(value) != 3:
        raise RequestError(f"{name} is not three numbers")
    return np.array([number(each, name) for each in value])


def _by_axis(turn: NDArray[np.float64]) -> NDArray[np.float64]:
    """The rotation around an axis.  The length of the axis is the angle in radians (Rodrigues)."""
    angle = math.hypot(*turn)
    if angle == 0.0:
        return np.eye(3)
    x, y, z = turn / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    found: NDArray[np.float64] = (
        np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross
    )
    return found
