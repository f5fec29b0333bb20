"""Poses of the photos in a folder, from their metadata.  Missing values are taken from a plan.

The axes of the world are east, north and up, in metres.  Its origin is the origin of the plan, or
the centre of the photos.  Heights are above the take-off point.
"""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.errors import RequestError
from aosplan.files import read_table
from aosplan.geodesy import to_local
from aosplan.messages import Message
from aosplan.postflight.integral.camera_pose import Intrinsics, View
from aosplan.postflight.integral.georeference import Georeference
from aosplan.postflight.integral.photo_choice import chosen_photos, named, pixels_of
from aosplan.postflight.photo_metadata import BANDS, PhotoMetadata
from aosplan.units import number, positive

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from aosplan.postflight.positions_file import Place

FARTHEST_M = 20_000.0
"""Greatest distance between photos of one recording."""

PLAN = "plan.json"
"""Name of the file of a plan in the folder of photos."""


class PhotoOptions(NamedTuple):
    """The choice of photos, and values for metadata that the photos do not have.

    Parameters
    ----------
    band
        One of `aosplan.postflight.photo_metadata.BANDS`; None if the folder has only one band.
    plan
        File of a plan. If it is None, ``plan.json`` in the folder is used if it exists.
    altitude_m
        Mean height of the cameras above the take-off point, for photos without a height.
    heading_deg
        Direction of the top of the photos, for photos without a yaw.
    """

    band: str | None = None
    plan: str | None = None
    altitude_m: float | None = None
    heading_deg: float | None = None


class PosedViews(NamedTuple):
    """Views with their poses, the location of their world, and warnings."""

    views: list[View]
    georeference: Georeference | None = None
    origin: tuple[float, float] | None = None
    messages: tuple[Message, ...] = ()
    sigma_m: float | None = None
    """Standard deviation of a position along an axis; None if it is not known."""


class _Plan(NamedTuple):
    """Values of a plan, for photos that do not have these values."""

    altitude_m: float | None = None
    heading_deg: float | None = None
    origin: tuple[float, float] | None = None
    camera: str | None = None


def read_photo_poses(
    folder: str, options: PhotoOptions, camera: Callable[[int, int], Intrinsics] | None
) -> PosedViews:
    """Read the views of the photos in a folder.

    Parameters
    ----------
    folder
        Folder with photos that have GPS positions.
    options
        The choice of photos, and values for missing metadata.
    camera
        Function that returns the intrinsics of a photo.  They replace the metadata of the photo.

    Raises
    ------
    RequestError
        If neither a photo, nor the options, nor a plan has a value that is needed, or if the folder
        has photos of several bands and no band is chosen.
    """
    plan, messages = _plan_of(folder, options)
    placed, known, said = chosen_photos(folder, options.band)
    messages += said
    names = list(known)
    if options.altitude_m is not None:
        plan = plan._replace(altitude_m=options.altitude_m)
    if options.heading_deg is not None:
        plan = plan._replace(heading_deg=options.heading_deg)
    origin = plan.origin or _middle([placed[name] for name in names])
    latitudes, longitudes = zip(
        *((placed[n].latitude, placed[n].longitude) for n in names), strict=True
    )
    east, north = to_local(origin, latitudes, longitudes)
    farthest = max(map(math.hypot, east, north))
    if farthest > FARTHEST_M:
        raise RequestError(
            f"a photo of '{folder}' is {farthest / 1000.0:.4g} km from the "
            + ("plan's origin" if plan.origin else "middle of the others"),
            "leave photos of other flights out of the folder",
        )
    heights, said = _heights(folder, known, [placed[name].altitude_m for name in names], plan)
    messages += said
    turned, said = _rotations(folder, known, plan)
    messages += said
    lenses, said = _lenses(folder, known, camera, plan)
    messages += [*said, *_sizes(known)]
    views = []
    for index, name in enumerate(names):
        if pixels_of(folder, name) != name and pixels_of(folder, name) in known:
            continue  # The TIFF of this photo is a separate view.
        position = np.array([east[index], north[index], heights[index]])
        rotation = turned[index]
        views.append(View(pixels_of(folder, name), rotation, -rotation @ position, lenses[index]))
    is_rtk = all(found.is_rtk for found in known.values())
    return PosedViews(
        views,
        Georeference.around(*origin),
        origin,
        tuple(messages),
        0.03 if is_rtk else 1.0,
    )


def _plan_of(folder: str, options: PhotoOptions) -> tuple[_Plan, list[Message]]:
    path = options.plan
    said = []
    if path is None:
        beside = os.path.join(folder, PLAN)
        if not os.path.isfile(beside):
            return _Plan(), []
        path = beside
        said.append(
            Message(
                "plan", f"values that the tags of the photos do not contain are taken from '{path}'"
            )
        )
    document = read_table(path)
    request = document.get("request", document)
    if not isinstance(request, dict):
        raise RequestError(f"'{path}' is not a plan: its request is not a table")
    altitude, heading = document.get("altitude_m", request.get("altitude")), request.get("heading")
    origin, camera = request.get("origin"), request.get("camera")
    place = None
    if isinstance(origin, list) and len(origin) == 2:
        place = (number(origin[0], f"'{path}' origin"), number(origin[1], f"'{path}' origin"))
    return _Plan(
        positive(altitude, f"'{path}' altitude", "m")
        if isinstance(altitude, (int, float))
        else None,
        number(heading, f"'{path}' heading") if isinstance(heading, (int, float)) else None,
        place,
        camera if isinstance(camera, str) else None,
    ), said


def _middle(places: Sequence[Place]) -> tuple[float, float]:
    """Centre of the bounding box of some places, rounded to about 0.1 m."""
    latitudes = [place.latitude for place in places]
    first = places[0].longitude
    # Near the antimeridian, longitudes are converted to values within 180° of the first longitude.
    longitudes = [first + (place.longitude - first + 180.0) % 360.0 - 180.0 for place in places]
    latitude = 0.5 * (min(latitudes) + max(latitudes))
    longitude = 0.5 * (min(longitudes) + max(longitudes))
    return round(latitude, 6), (round(longitude, 6) + 180.0) % 360.0 - 180.0


def _heights(
    folder: str,
    tags: Mapping[str, PhotoMetadata],
    above_takeoff: Sequence[float | None],
    plan: _Plan,
) -> tuple[NDArray[np.float64], list[Message]]:
    """Heights above the take-off point.

    Without RTK heights, these are the barometric heights. With RTK heights, they are the mean
    barometric height plus the deviations of the RTK heights from their mean.
    """
    relative = [
        one if one is not None else other.relative_altitude_m
        for one, other in zip(above_takeoff, tags.values(), strict=True)
    ]
    absolute = [found.absolute_altitude_m for found in tags.values()]
    has_absolute = all(height is not None for height in absolute)
    if all(height is not None for height in relative):
        above = np.array(relative, dtype=np.float64)
        if has_absolute and all(found.is_rtk for found in tags.values()):
            precise = np.array(absolute, dtype=np.float64)
            return precise - (precise - above).mean(), []
        return above, []
    if plan.altitude_m is None:
        name = next(n for n, height in zip(tags, relative, strict=True) if height is None)
        raise RequestError(
            f"photo '{os.path.join(folder, name)}' has no height above the take-off",
            "give --altitude M, the mean height of the photos above the ground, or --plan FILE",
        )
    if has_absolute:
        sea = np.array(absolute, dtype=np.float64)
        return sea - sea.mean() + plan.altitude_m, [
            Message(
                "altitudes",
                "the photos have only heights above sea level, so only the differences between "
                "these heights are used, and the mean height is assumed to be "
                f"{plan.altitude_m:g} m",
            )
        ]
    return np.full(len(relative), plan.altitude_m), [
        Message(
            "altitudes",
            f"the photos have no heights, so a height of {plan.altitude_m:g} m is assumed for all",
        )
    ]


def _rotations(
    folder: str, tags: Mapping[str, PhotoMetadata], plan: _Plan
) -> tuple[list[NDArray[np.float64]], list[Message]]:
    """Rotation from world to camera of each photo."""
    found, level, turned = [], [], []
    for name, tag in tags.items():
        yaw = tag.yaw_deg
        if yaw is None:
            if plan.heading_deg is None:
                raise RequestError(
                    f"photo '{os.path.join(folder, name)}' has no yaw, so the direction of its "
                    "top is unknown",
                    "give --heading DEG for all photos, or --plan FILE",
                )
            yaw = plan.heading_deg
            turned.append(name)
        if tag.pitch_deg is None:
            level.append(name)
        pitch = -90.0 if tag.pitch_deg is None else tag.pitch_deg
        found.append(camera_rotation(yaw, pitch, tag.roll_deg or 0.0))
    messages = []
    if level:
        messages.append(
            Message(
                "pitch",
                f"{len(level)} photos have no pitch, so they are assumed to look straight down: "
                + named(level),
            )
        )
    if turned:
        messages.append(
            Message(
                "yaw",
                f"{len(turned)} photos have no yaw; {plan.heading_deg:g} degrees are assumed "
                f"for them: {named(turned)}",
            )
        )
    return found, messages


def camera_rotation(yaw_deg: float, pitch_deg: float, roll_deg: float) -> NDArray[np.float64]:
    """Rotation from world (east, north, up) to camera, from the angles of the camera in the
    north-east-down frame.

    Parameters
    ----------
    yaw_deg, pitch_deg, roll_deg
        Angles of rotations around the axes down, right and forward, in this order.  Before the
        rotations, the camera looks north, and the top of its image is upwards.  With a pitch of -90
        degrees, it looks straight down, and the top of its image points in the direction of the
        yaw.

    Returns
    -------
    ndarray
        Shape (3, 3): rows are the image's right, the image's down, and the viewing direction.
    """
    y, p, r = (math.radians(angle) for angle in (yaw_deg, pitch_deg, roll_deg))
    cy, sy, cp, sp, cr, sr = (f(a) for a in (y, p, r) for f in (math.cos, math.sin))
    # The columns are the directions forward, right and down of the camera, in the north-east-down
    # frame.
    body = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    to_enu = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    rows: NDArray[np.float64] = (to_enu @ body).T[[1, 2, 0]]
    return rows


def _lenses(
    folder: str,
    tags: Mapping[str, PhotoMetadata],
    camera: Callable[[int, int], Intrinsics] | None,
    plan: _Plan,
) -> tuple[list[Intrinsics], list[Message]]:
    """Intrinsics of each photo.

    They are taken from the first available source: the given camera, the calibration of the photo,
    its focal length, or the camera of the plan.
    """
    from aosplan.postflight.integral.camera_pose import from_camera

    found, lacking = [], []
    for name, tag in tags.items():
        width, height = tag.size_px
        if camera is not None:
            found.append(camera(width, height))
        elif tag.lens_px is not None:
            fx, fy, cx, cy, k1, k2, p1, p2, k3 = tag.lens_px
            found.append(Intrinsics(width, height, fx, fy, cx, cy, k1, k2, p1, p2, k3))
        elif tag.focal_px is not None:
            focal = tag.focal_px
            found.append(Intrinsics(width, height, focal, focal, width / 2.0, height / 2.0))
        elif plan.camera is not None:
            from aosplan.camera.presets import find_camera

            lacking.append(name)
            found.append(from_camera(find_camera(plan.camera))(width, height))
        else:
            raise RequestError(
                f"photo '{os.path.join(folder, name)}' has no focal length"
                + (f" ({tag.model})" if tag.model else ""),
                "give --camera NAME (aosplan cameras lists them), --fov DEG, or --plan FILE",
            )
    if not lacking:
        return found, []
    return found, [
        Message(
            "camera",
            f"{len(lacking)} photos have no focal length, so the camera of the plan is used: "
            f"{plan.camera}",
        )
    ]


def _sizes(tags: Mapping[str, PhotoMetadata]) -> list[Message]:
    """Warning about photos of another size than most photos."""
    sizes = [tag.size_px for tag in tags.values()]
    usual = max(sizes, key=sizes.count)
    others = [name for name, size in zip(tags, sizes, strict=True) if size != usual]
    if not others:
        return []
    return [
        Message(
            "sizes",
            f"{len(others)} of {len(sizes)} photos do not have the usual size of "
            f"{usual[0]} x {usual[1]} pixels: {named(others)}; if they were cropped or scaled, their "
            "tags may describe the original photo",
        )
    ]


def check_band(text: str | None) -> str | None:
    """Check the name of a band.

    Raises
    ------
    RequestError
        If the name is not one of `BANDS`.
    """
    if text is not None and text not in BANDS:
        raise RequestError(f"--band '{text}' is not one of {', '.join(BANDS)}")
    return text


def is_photo_folder(path: str) -> bool:
    """Whether a path is a folder without the files of a COLMAP model."""
    return os.path.isdir(path) and not any(
        os.path.exists(os.path.join(path, f"{name}.{ending}"))
        for name in ("images", "cameras")
        for ending in ("txt", "bin")
    )
