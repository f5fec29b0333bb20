"""Reading of poses from a COLMAP reconstruction, in text or binary files.

``cameras.txt`` has one line per camera: CAMERA_ID MODEL WIDTH HEIGHT PARAMS… ``images.txt`` has two
lines per image. The first is IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME. The second has the
points of the image and is skipped. ``cameras.bin`` and ``images.bin`` contain the same values in
little-endian order, after a count of 8 bytes. The quaternion and T transform world coordinates to
camera coordinates. The centre of the first pixel is (0.5, 0.5). The world is in metres, with z
upwards, only if the reconstruction was aligned (``colmap model_aligner``).
"""

from __future__ import annotations

import math
import os
import struct
from typing import TYPE_CHECKING, Any

import numpy as np

from aosplan.errors import RequestError, SurroundingsError
from aosplan.files import read_bytes
from aosplan.postflight.integral.camera_pose import FARTHEST_M, Intrinsics, View, checked_intrinsics
from aosplan.units import number, shown, whole

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

MODELS = {
    # The parameters of each model in order. f is the focal length along both axes.
    "SIMPLE_PINHOLE": "f cx cy",
    "PINHOLE": "fx fy cx cy",
    "SIMPLE_RADIAL": "f cx cy k1",
    "RADIAL": "f cx cy k1 k2",
    "OPENCV": "fx fy cx cy k1 k2 p1 p2",
    "FULL_OPENCV": "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6",
}
"""Supported camera models by name, with their parameters."""

BY_NUMBER = [
    # Models in the order of their numbers in binary files, each with its number of parameters.
    ("SIMPLE_PINHOLE", 3), ("PINHOLE", 4), ("SIMPLE_RADIAL", 4), ("RADIAL", 5), ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8), ("FULL_OPENCV", 12), ("FOV", 5), ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5), ("THIN_PRISM_FISHEYE", 12),
]  # fmt: skip

UNDISTORT = "colmap image_undistorter converts images of any model to PINHOLE"


def read_colmap(path: str) -> list[View]:
    """Read the views of a reconstruction, in the order of their names.

    Parameters
    ----------
    path
        The folder with both files, text or binary, or the path of one of the files.

    Raises
    ------
    RequestError
        If a file is missing or has an invalid line.  The message gives the place.
    """
    folder = path if os.path.isdir(path) else os.path.dirname(path) or "."
    text = os.path.join(folder, "images.txt")
    binary = os.path.join(folder, "images.bin")
    if path.lower().endswith(".bin") or (not os.path.exists(text) and os.path.exists(binary)):
        binary_cameras = _binary_cameras(os.path.join(folder, "cameras.bin"))
        return sorted(_binary_views(binary, binary_cameras), key=lambda view: view.name)
    cameras = _cameras(os.path.join(folder, "cameras.txt"))
    return sorted(_views(text, cameras), key=lambda view: view.name)


def _lines(path: str) -> Iterator[tuple[int, str]]:
    """Lines with their numbers.  They are read one at a time, because lines with points are
    long.
    """
    try:
        with open(path, encoding="utf-8-sig") as file:
            yield from enumerate((line.strip() for line in file), 1)
    except FileNotFoundError:
        raise RequestError(
            f"there is no file '{path}'",
            "give the folder of a COLMAP reconstruction, which contains the files of cameras and images",
        ) from None
    except UnicodeDecodeError as error:
        raise RequestError(f"'{path}' is not UTF-8 text (byte {error.start})") from None
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise SurroundingsError(f"cannot read '{path}': {reason}") from None


def _cameras(path: str) -> dict[str, Intrinsics]:
    cameras = {}
    for line, text in _lines(path):
        if not text or text.startswith("#"):
            continue
        place = f"'{path}', line {line}"
        words = text.split()
        if len(words) < 4:
            raise RequestError(f"{place} is not CAMERA_ID MODEL WIDTH HEIGHT PARAMS")
        key, model, width, height, *rest = words
        if model not in MODELS:
            raise RequestError(
                f"{place}: camera model {shown(model)} is not one of {', '.join(MODELS)}", UNDISTORT
            )
        names = MODELS[model].split()
        if len(rest) != len(names):
            raise RequestError(f"{place}: {model} has {len(names)} parameters, not {len(rest)}")
        values = [
            number(value, f"{place}: {name}") for name, value in zip(names, rest, strict=True)
        ]
        sides = whole(width, f"{place}: width"), whole(height, f"{place}: height")
        cameras[key] = _intrinsics(model, *sides, values, place)
    return cameras


def _intrinsics(model: str, width: int, height: int, values: list[float], place: str) -> Intrinsics:
    """A camera from the parameters of its model, in their order."""
    named = dict(zip(MODELS[model].split(), values, strict=True))
    if any(named.pop(name, 0.0) for name in ("k4", "k5", "k6")):
        raise RequestError(f"{place}: {model} with k4, k5 or k6 is not supported", UNDISTORT)
    focal = named.pop("f", None)
    ordered = [focal, focal] if focal is not None else [named.pop("fx"), named.pop("fy")]
    return checked_intrinsics(width, height, [*ordered, *named.values()], place)


class _Binary:
    """A binary file whose values are read one after the other."""

    def __init__(self, path: str) -> None:
        self.path = path
        self._content = read_bytes(path)
        self._at = 0

    def take(self, form: str) -> tuple[Any, ...]:
        size = struct.calcsize("<" + form)
        if self._at + size > len(self._content):
            raise RequestError(f"'{self.path}' ends in the middle of a value (byte {self._at})")
        values = struct.unpack_from("<" + form, self._content, self._at)
        self._at += size
        return values

    def text(self) -> str:
        end = self._content.find(b"\0", self._at)
        if end < 0:
            raise RequestError(f"'{self.path}' ends in the middle of a name (byte {self._at})")
        name = self._content[self._at : end]
        self._at = end + 1
        try:
            return name.decode()
        except UnicodeDecodeError:
            raise RequestError(f"'{self.path}': a name is not UTF-8 (byte {self._at})") from None

    def skip(self, count: int) -> None:
        if count > len(self._content) - self._at:
            raise RequestError(f"'{self.path}' ends in the middle of its points (byte {self._at})")
        self._at += count


def _binary_cameras(path: str) -> dict[int, Intrinsics]:
    file = _Binary(path)
    cameras = {}
    for index in range(file.take("Q")[0]):
        key, number_of_model, width, height = file.take("iiQQ")
        place = f"'{path}', camera {index + 1}"
        if not 0 <= number_of_model < len(BY_NUMBER):
            raise RequestError(f"{place}: model {number_of_model} is not known", UNDISTORT)
        model, count = BY_NUMBER[number_of_model]
        values = list(file.take(f"{count}d"))
        if model not in MODELS:
            raise RequestError(
                f"{place}: camera model {model} is not one of {', '.join(MODELS)}", UNDISTORT
            )
        values = [number(value, f"{place}: parameter") for value in values]
        sides = whole(width, f"{place}: width"), whole(height, f"{place}: height")
        cameras[key] = _intrinsics(model, *sides, values, place)
    return cameras


def _binary_views(path: str, cameras: dict[int, Intrinsics]) -> Iterator[View]:
    file = _Binary(path)
    for index in range(file.take("Q")[0]):
        _, *pose, camera = file.take("i7di")
        name = file.text()
        file.skip(24 * file.take("Q")[0])  # Each point has x, y and an index, with 8 bytes each.
        place = f"'{path}', image {index + 1} ({shown(name)})"
        values = [number(value, f"{place}: number") for value in pose]
        if max(map(abs, values)) > FARTHEST_M:
            raise RequestError(f"{place}: a number is larger than {FARTHEST_M:g}")
        if camera not in cameras:
            raise RequestError(f"{place}: camera {camera} is not in cameras.bin")
        yield View(name, _rotation(values[:4], place), np.array(values[4:]), cameras[camera])


def _views(path: str, cameras: dict[str, Intrinsics]) -> Iterator[View]:
    is_points = False
    for line, text in _lines(path):
        if is_points:
            is_points = False
            if not text or _are_points(text):
                continue
        if not text or text.startswith("#"):
            continue
        is_points = True
        place = f"'{path}', line {line}"
        words = text.split(maxsplit=9)
        if len(words) != 10:
            raise RequestError(f"{place} is not IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME")
        values = [number(word, f"{place}: number") for word in words[1:8]]
        if max(map(abs, values)) > FARTHEST_M:
            raise RequestError(f"{place}: a number is larger than {FARTHEST_M:g}")
        if words[8] not in cameras:
            raise RequestError(f"{place}: camera {shown(words[8])} is not in cameras.txt")
        if "\0" in words[9]:
            raise RequestError(f"{place}: the name contains a zero byte")
        rotation = _rotation(values[:4], place)
        yield View(words[9], rotation, np.array(values[4:]), cameras[words[8]])


def _are_points(text: str) -> bool:
    """Whether a line has the points of an image (X Y POINT3D_ID for each point), and not the next
    image.

    The line with points may be missing: for an image without points it is empty, and some programs
    remove empty lines.  The line of an image has its name at a position where a line with points
    has a number.
    """
    words = text.split(maxsplit=12)[:12]
    if len(words) < 10:
        return True
    try:
        for word in words[9:]:
            float(word)
    except ValueError:
        return False
    return True


def _rotation(quaternion: list[float], place: str) -> NDArray[np.float64]:
    """The rotation matrix of a quaternion whose first element is the scalar."""
    length = math.hypot(*quaternion)
    if not abs(length - 1.0) < 1e-3:
        raise RequestError(f"{place}: the quaternion has length {length:g}, not 1")
    w, x, y, z = (value / length for value in quaternion)
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )
