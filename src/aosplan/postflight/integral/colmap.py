"""Poses of a COLMAP reconstruction, from its text files.

``cameras.txt`` has a camera a line: CAMERA_ID MODEL WIDTH HEIGHT PARAMS…  ``images.txt`` has two
lines an image: IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, and its points, which are skipped.
The quaternion and T are world to camera; the first pixel's centre is (0.5, 0.5).  The world is in
metres, and its z up, only where the reconstruction was aligned (``colmap model_aligner``).
"""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING

import numpy as np

from aosplan.errors import RequestError, SurroundingsError
from aosplan.postflight.integral.camera_pose import FARTHEST_M, Intrinsics, View, checked_intrinsics
from aosplan.units import number, shown, whole

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

MODELS = {
    # Which of fx fy cx cy k1 k2 p1 p2 stand where; f is both focal lengths.
    "SIMPLE_PINHOLE": "f cx cy",
    "PINHOLE": "fx fy cx cy",
    "SIMPLE_RADIAL": "f cx cy k1",
    "RADIAL": "f cx cy k1 k2",
    "OPENCV": "fx fy cx cy k1 k2 p1 p2",
}
"""Camera models that are read, by name, with their parameters."""

UNDISTORT = "colmap image_undistorter makes PINHOLE images of any model"


def read_colmap(path: str) -> list[View]:
    """Views of a reconstruction, in the order of their names.

    Parameters
    ----------
    path
        The folder with both text files, or one of them.

    Raises
    ------
    RequestError
        Where a file is missing, is binary, or has a line that does not fit; the message says where.
    """
    folder = path if os.path.isdir(path) else os.path.dirname(path) or "."
    text = os.path.join(folder, "images.txt")
    if not os.path.exists(text) and (
        path.lower().endswith(".bin") or os.path.exists(os.path.join(folder, "images.bin"))
    ):
        raise RequestError(
            f"'{folder}' holds COLMAP's binary files",
            "colmap model_converter --output_type TXT writes the text that is read here",
        )
    cameras = _cameras(os.path.join(folder, "cameras.txt"))
    return sorted(_views(text, cameras), key=lambda view: view.name)


def _lines(path: str) -> Iterator[tuple[int, str]]:
    """Lines with their numbers, a few at a time: the points of an image fill long ones."""
    try:
        with open(path, encoding="utf-8-sig") as file:
            yield from enumerate((line.strip() for line in file), 1)
    except FileNotFoundError:
        raise RequestError(
            f"no file '{path}'", "a COLMAP reconstruction is the folder with both text files"
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
        values = {
            name: number(value, f"{place}: {name}") for name, value in zip(names, rest, strict=True)
        }
        focal = values.pop("f", None)
        ordered = [focal, focal] if focal is not None else [values.pop("fx"), values.pop("fy")]
        ordered += values.values()
        sides = whole(width, f"{place}: width"), whole(height, f"{place}: height")
        cameras[key] = checked_intrinsics(*sides, ordered, place)
    return cameras


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
            raise RequestError(f"{place}: the name holds a zero byte")
        rotation = _rotation(values[:4], place)
        yield View(words[9], rotation, np.array(values[4:]), cameras[words[8]])


def _are_points(text: str) -> bool:
    """Whether a line has the points of an image, X Y POINT3D_ID each, and is not the next image.

    Programs that drop empty lines drop those of images without points.  The line of an image has a
    name where points have numbers.
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
    """The rotation matrix of a quaternion, scalar first."""
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
