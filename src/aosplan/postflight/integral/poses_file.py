"""Poses and intrinsics of images, from the AOS project's JSON or from COLMAP.

A pose is M = [R|t], which transforms world coordinates to camera coordinates: a point X of the
world is at R X + t in the camera's frame.  In this frame, x points to the right of the image, y
downwards and z forwards.  Lengths are in metres.
"""

from __future__ import annotations

import os
from typing import Any

from aosplan.errors import RequestError
from aosplan.files import read_table
from aosplan.postflight.integral.camera_pose import Intrinsics, View, checked_intrinsics, pose
from aosplan.units import number, shown, whole


def read_poses(path: str) -> list[View]:
    """Read the views of a recording.

    Parameters
    ----------
    path
        A JSON file of the AOS project, or the files of COLMAP.  The JSON file has ``images``, each
        with ``imagefile`` and ``M3x4``.  It may also have ``camera`` with ``width``, ``height``,
        ``fx``, ``fy``, ``cx``, ``cy`` in pixels, for all images or for a single image.  For COLMAP,
        the path is the folder with ``cameras.txt`` and ``images.txt`` (or ``.bin``), or one of
        these files.

    Raises
    ------
    RequestError
        If the file has neither of these forms. The message names the image.
    """
    if os.path.isdir(path) or path.lower().endswith((".txt", ".bin")):
        from aosplan.postflight.integral.colmap import read_colmap

        views = read_colmap(path)
    else:
        views = _read_json(path)
    if not views:
        raise RequestError(f"'{path}' contains no images")
    names: set[str] = set()
    for view in views:
        if view.name in names:
            raise RequestError(f"'{path}': image {shown(view.name)} is given twice")
        names.add(view.name)
    return views


def _read_json(path: str) -> list[View]:
    table = read_table(path)
    images = table.get("images")
    if not isinstance(images, list):
        raise RequestError(
            f"'{path}' has no list 'images'",
            'the format of the AOS project is {"images": [{"imagefile": …, "M3x4": …}, …]}',
        )
    shared = _camera(table["camera"], f"'{path}': camera") if "camera" in table else None
    return [_view(image, index, path, shared) for index, image in enumerate(images, 1)]


def _view(image: Any, index: int, path: str, shared: Intrinsics | None) -> View:
    place = f"'{path}', image {index}"
    if not isinstance(image, dict):
        raise RequestError(f"{place} is not a table of named values")
    name = image.get("imagefile")
    if not isinstance(name, str) or not name.strip() or "\0" in name:
        raise RequestError(f"{place} has no name in 'imagefile'")
    place = f"{place} ({name})"
    if "M3x4" not in image:
        raise RequestError(f"{place} has no 'M3x4'")
    own = _camera(image["camera"], f"{place}: camera") if "camera" in image else shared
    return View(name, *pose(image["M3x4"], place), own)


def _camera(value: Any, place: str) -> Intrinsics:
    names = ("width", "height", "fx", "fy", "cx", "cy")
    if not isinstance(value, dict) or set(value) != set(names):
        raise RequestError(f"{place} does not have exactly the names {', '.join(names)}")
    return checked_intrinsics(
        whole(value["width"], f"{place}: width"),
        whole(value["height"], f"{place}: height"),
        [number(value[name], f"{place}: {name}") for name in names[2:]],
        place,
    )
