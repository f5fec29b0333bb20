"""Reading of the metadata of a drone's photo: angles of the camera, heights, focal length, band.

XMP is read in the forms that the manufacturers of drones use, as attributes or elements:

- DJI (``drone-dji:``) and recent Autel (``drone:``): ``GimbalYawDegree``, ``GimbalPitchDegree`` and
  ``GimbalRollDegree`` are the angles of the rotations of a north-east-down frame, in the order yaw,
  pitch, roll.  With a pitch of -90 degrees, the camera looks straight down.  ``RelativeAltitude``
  is above the take-off point.  ``RtkFlag`` is 50 for a fixed solution.  ``DewarpData`` is a date
  followed by fx, fy, cx, cy, k1, k2, p1, p2, k3 in pixels, where cx and cy are relative to the
  centre of the photo.  ``CalibratedFocalLength`` is in pixels.
- Parrot (``drone-parrot:``): ``CameraYawDegree``, ``CameraPitchDegree``, ``CameraRollDegree``, with
  the same meaning.
- Skydio (``drone-skydio:``): ``CameraOrientationNED`` contains yaw, pitch and roll with the same
  meaning.
- senseFly, Parrot Sequoia and older Autel firmware, with the names of Pix4D (``Camera:``): ``Yaw``,
  ``Pitch`` and ``Roll``.  With a pitch of 0, the camera looks straight down.

EXIF has the absolute altitude, the focal length, its 35 mm equivalent and the pixel pitch. The
orientation in EXIF tells image viewers how to rotate the image. It is not applied here, so the
pixels are in the order of the sensor.
"""

from __future__ import annotations

import math
import os
import re
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import RequestError, needs_extra
from aosplan.files import decoding
from aosplan.postflight.photo_positions import GPS, XMP_BYTES, allowing_any_size

if TYPE_CHECKING:
    from collections.abc import Mapping

EXIF = 0x8769
"""EXIF tag of the exposure information."""

ORIENTATION = 0x0112
"""EXIF tag of the orientation.  It is 1 for an upright image, and 2 to 8 for rotated and mirrored
images.
"""

FULL_FRAME_DIAGONAL_MM = math.hypot(36.0, 24.0)
"""Diagonal of a 35 mm film frame, to which equivalent focal lengths refer."""

MM_PER_UNIT = {2: 25.4, 3: 10.0, 4: 1.0, 5: 1e-3}
"""Millimetres in each of EXIF's units of the focal plane: inch, cm, mm and µm."""

RTK_FIXED = 50

MAKERS = ("drone-dji", "drone", "drone-parrot", "Camera")
"""Namespaces of manufacturers in XMP, in order of priority."""

BANDS = ("thermal", "visible", "wide", "zoom")

SOURCES = {
    # Bands for the values of ImageSource.
    "infraredcamera": "thermal", "widecamera": "wide", "zoomcamera": "zoom",
    "visualcamera": "wide", "visiblecamera": "wide",
}  # fmt: skip

SUFFIXES = {
    # Bands for the last letter of a file name (DJI).
    "T": "thermal", "THRM": "thermal", "IR": "thermal", "R": "thermal",
    "V": "wide", "W": "wide", "WIDE": "wide", "Z": "zoom", "ZOOM": "zoom", "S": "screen", "SCRN": "screen",
}  # fmt: skip

PREFIXES = {"IRX": "thermal", "IR": "thermal", "MAX": "wide", "MIX": "screen", "PIC": "screen"}
"""Bands for the first letters of a file name (Autel)."""

THERMAL_NAMES = {"lwir", "thermal", "ir"}

_VALUE = re.compile(rb"([A-Za-z][\w-]*):(\w+)\s*(?:=\s*[\"']|>)\s*([^\"'<>]{0,400})")

_ORIENTATION_NED = re.compile(rb"CameraOrientationNED")


class PhotoMetadata(NamedTuple):
    """Metadata of a photo.  A value that the photo does not have is None.

    Attributes
    ----------
    relative_altitude_m, absolute_altitude_m
        Height above the take-off point, and above the ellipsoid or sea level.
    yaw_deg, pitch_deg, roll_deg
        Angles of the camera in a north-east-down frame.  With a pitch of -90, the camera looks
        straight down.
    size_px
        Width and height of the image.
    focal_px
        Focal length in pixels of this image size.
    lens_px
        Calibration: fx, fy, cx, cy (relative to the corner), k1, k2, p1, p2, k3.
    band
        One of `BANDS` except ``visible``, or ``screen`` for a screenshot of the remote controller.
    is_rtk
        Whether the position is a fixed RTK solution.
    model
        Make and model of the camera.
    orientation
        Orientation in EXIF, 1 to 8.  It is 1 if the photo does not have a valid orientation.
    """

    relative_altitude_m: float | None
    absolute_altitude_m: float | None
    yaw_deg: float | None
    pitch_deg: float | None
    roll_deg: float | None
    size_px: tuple[int, int]
    focal_px: float | None
    lens_px: tuple[float, ...] | None
    band: str | None
    is_rtk: bool
    model: str
    orientation: int


def read_metadata(path: str) -> PhotoMetadata | None:
    """Read the metadata of a photo; None if the file is not an image.

    Raises
    ------
    MissingExtraError
        If Pillow is not installed.
    """
    with needs_extra("reading the metadata of photos", "pictures"):
        from PIL import Image
    try:
        with open(path, "rb") as file:
            start = file.read(XMP_BYTES)
        with decoding("photo", path), allowing_any_size(Image), Image.open(path) as image:
            size = image.size
            packet = image.info.get("xmp", b"")
            exif = image.getexif()
            main: Mapping[int, Any] = dict(exif)
            gps, shot = _directory(exif, GPS), _directory(exif, EXIF)
    except (RequestError, OSError, ValueError, TypeError, SyntaxError, KeyError, ZeroDivisionError):
        return None
    packet = packet.encode() if isinstance(packet, str) else packet
    xmp = _xmp(packet if isinstance(packet, bytes) and packet else start)
    lens = _lens(xmp, size)
    return PhotoMetadata(
        _number(xmp, "RelativeAltitude"),
        _first(_number(xmp, "AbsoluteAltitude"), _gps_altitude(gps)),
        *_angles(xmp, gps),
        size,
        lens[0] if lens else _focal_px(xmp, shot, size),
        lens,
        _band(xmp, os.path.basename(path), size, main),
        _number(xmp, "RtkFlag") == RTK_FIXED,
        " ".join(_text(main.get(tag)) for tag in (271, 272)).strip(),
        _orientation(main.get(ORIENTATION)),
    )


def _directory(exif: Any, tag: int) -> dict[int, Any]:
    try:
        return dict(exif.get_ifd(tag))
    except (KeyError, TypeError, ValueError, OSError, SyntaxError):
        return {}


def _orientation(value: Any) -> int:
    return value if isinstance(value, int) and 1 <= value <= 8 else 1


def _text(value: Any) -> str:
    return "".join(c for c in str(value or "") if c.isprintable()).strip()


def _first(*values: float | None) -> float | None:
    return next((value for value in values if value is not None), None)


def _xmp(packet: bytes) -> dict[str, str]:
    """Values of an XMP packet by ``namespace:name``."""
    found: dict[str, str] = {}
    for space, name, text in _VALUE.findall(packet):
        key = f"{space.decode()}:{name.decode()}"
        value = text.decode("utf-8", "replace").strip()
        if value:
            found.setdefault(key, value)
    match = _ORIENTATION_NED.search(packet)
    if match:
        # The three angles are a structure, or a list in the order roll, pitch, yaw.
        part = packet[match.end() : match.end() + 600]
        for space, name, text in _VALUE.findall(part):
            if name in (b"Yaw", b"Pitch", b"Roll") and space != b"Camera":
                found.setdefault(f"ned:{name.decode()}", text.decode("ascii", "replace"))
    return found


def _float(text: str | None) -> float | None:
    """The finite number in a text, which may be written as a fraction; None if there is no such
    number.
    """
    if text is None:
        return None
    above, slash, below = text.partition("/")
    try:
        value = float(above) / float(below) if slash else float(above)
    except (ValueError, ZeroDivisionError):
        return None
    return value if math.isfinite(value) and abs(value) < 1e9 else None


def _number(xmp: Mapping[str, str], name: str, makers: tuple[str, ...] = MAKERS) -> float | None:
    return _first(*(_float(xmp.get(f"{maker}:{name}")) for maker in (*makers, "drone-skydio")))


def _exif_number(value: Any) -> float | None:
    try:
        number = float(value)
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return number if math.isfinite(number) and abs(number) < 1e9 else None


def _gps_altitude(gps: Mapping[int, Any]) -> float | None:
    altitude = _exif_number(gps.get(6))
    below = gps.get(5) in (1, b"\x01")
    return None if altitude is None else -altitude if below else altitude


def _angles(
    xmp: Mapping[str, str], gps: Mapping[int, Any]
) -> tuple[float | None, float | None, float | None]:
    """Yaw, pitch and roll in the north-east-down frame.  With a pitch of -90, the camera looks
    straight down.
    """
    names = ("Yaw", "Pitch", "Roll")
    for pattern in (
        "drone-dji:Gimbal{}Degree",
        "drone:Gimbal{}Degree",
        "drone-parrot:Camera{}Degree",
        "ned:{}",
    ):
        yaw, pitch, roll = (_float(xmp.get(pattern.format(name))) for name in names)
        if pitch is not None:
            flight = _float(xmp.get(pattern.partition(":")[0] + ":FlightYawDegree"))
            return _first(yaw, flight, _exif_number(gps.get(17))), pitch, roll
    yaw, pitch, roll = (_float(xmp.get(f"Camera:{name}")) for name in names)
    if pitch is not None and abs(pitch) < 60.0:
        pitch -= 90.0  # Pix4D's pitch is 0 if the camera looks straight down.
    # In surveys, the camera is tilted by less than 60 degrees. A larger pitch is therefore relative
    # to the horizon.
    elif pitch is not None and pitch > 0.0:
        pitch = -pitch
    return _first(yaw, _exif_number(gps.get(17))), pitch, roll


def _lens(xmp: Mapping[str, str], size: tuple[int, int]) -> tuple[float, ...] | None:
    """DJI's calibration; None if the photo has already been corrected with this calibration."""
    text = xmp.get("drone-dji:DewarpData")
    if text is None or xmp.get("drone-dji:DewarpFlag", "0") == "1":
        return None
    values = [_float(part) for part in text.rpartition(";")[2].split(",")]
    if len(values) != 9 or any(value is None for value in values):
        return None
    fx, fy, cx, cy, *rest = (value or 0.0 for value in values)
    if not (0.1 * size[0] < fx < 100.0 * size[0] and 0.1 * size[0] < fy < 100.0 * size[0]):
        return None
    return (fx, fy, 0.5 * size[0] + cx, 0.5 * size[1] + cy, *rest)


def _focal_px(
    xmp: Mapping[str, str], shot: Mapping[int, Any], size: tuple[int, int]
) -> float | None:
    """Focal length in pixels, from the first available source: the calibration, the pixel pitch, or
    the 35 mm equivalent.
    """
    calibrated = _number(xmp, "CalibratedFocalLength")
    if calibrated is not None and calibrated > 0.1 * size[0]:
        return calibrated
    focal_mm = _exif_number(shot.get(37386))
    per_unit = _exif_number(shot.get(41486))
    unit_mm = MM_PER_UNIT.get(int(_exif_number(shot.get(41488)) or 2))
    perspective_mm = _float(xmp.get("Camera:PerspectiveFocalLength"))
    if per_unit and unit_mm and (perspective_mm or focal_mm):
        focal = (perspective_mm or focal_mm or 0.0) * per_unit / unit_mm
        if 0.1 * size[0] < focal < 100.0 * size[0]:
            return focal
    equivalent_mm = _exif_number(shot.get(41989))
    if equivalent_mm and equivalent_mm > 0.0:
        return equivalent_mm / FULL_FRAME_DIAGONAL_MM * math.hypot(*size)
    return None


def _band(
    xmp: Mapping[str, str], name: str, size: tuple[int, int], main: Mapping[int, Any]
) -> str | None:
    """Band of the camera that took the photo, for drones with several cameras."""
    for space in MAKERS:
        source = xmp.get(f"{space}:ImageSource", "").replace(" ", "").lower()
        if source in SOURCES:
            return SOURCES[source]
    bands = (xmp.get(f"{space}:BandName", "").lower() for space in ("Camera", "drone-parrot"))
    if any(band in THERMAL_NAMES for band in bands):
        return "thermal"
    stem = os.path.splitext(name)[0].upper()
    if "_" in stem:
        first, last = stem.partition("_")[0], stem.rpartition("_")[2]
        if last in SUFFIXES:
            return SUFFIXES[last]
        if first in PREFIXES:
            return PREFIXES[first]
    if "FLIR" in _text(main.get(271)).upper() and size[0] <= 640:
        return "thermal"
    return None
