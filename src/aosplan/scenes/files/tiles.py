"""Checks that the files of one point cloud have the same coordinate reference system, and the
warnings that they share.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from aosplan.crs import ground_scale, location_of, transformer, true_lengths, unit_text
from aosplan.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pyproj import CRS

    from aosplan.scenes.files.las import PointFile
    from aosplan.scenes.voxels import VoxelVolume

    Warned = tuple[str, str]

APART_M = 0.05
"""Two coordinate reference systems are different if the positions of the same point differ by more
than this.
"""


def warnings_of_files(files: Sequence[PointFile]) -> list[Warned]:
    """The warnings of several files.  A warning that several files have in common is given once."""
    names: dict[Warned, list[str]] = {}
    for file in files:
        for warning in file.warnings:
            names.setdefault(warning, []).append(file.name)
    return [
        (code, f"{having[0]}{_and_more(having)} {sentence}")
        for (code, sentence), having in names.items()
    ]


def _and_more(names: Sequence[str]) -> str:
    return f" (and {len(names) - 1} more)" if len(names) > 1 else ""


def brought_together(files: Sequence[PointFile], source: str) -> list[Warned]:
    """Check that all files have the same reference system, and scale their x and y to true metres.

    Returns
    -------
    list
        Warnings about a projection whose scale is not 1, and about files without a reference
        system.

    Raises
    ------
    RequestError
        If the files have different reference systems, or if their projection distorts angles.
    """
    first = next((file for file in files if file.reference.horizontal is not None), None)
    if first is None:
        return []
    crs = first.reference.horizontal
    assert crs is not None
    doubts: list[Warned] = []
    silent = [file.name for file in files if file.reference.horizontal is None]
    if silent:
        message = (
            f"{silent[0]}{_and_more(silent)} has no coordinate reference system; the system of "
            f"{first.name} is assumed, which is {crs.name}"
        )
        doubts.append(("crs_assumed", message))
    for file in files:
        _check_same(first, file)
    across_m = first.units.across_m
    assert across_m is not None
    x, y, _ = first.first_m() / across_m
    scale = ground_scale(crs, float(x), float(y))
    along = true_lengths(scale, across_m, f"point cloud {source}")
    if along != (across_m, across_m):
        by = along[0] / across_m, along[1] / across_m
        for file in files:
            file.stretch(*by)
        message = (
            f"{unit_text(across_m)} of the projection {crs.name} are {by[0]:.4g} (x) and "
            f"{by[1]:.4g} (y) times as long on the ground, so x and y were scaled by these "
            "factors"
        )
        doubts.append(("projection_scaled", message))
    return doubts


def located(volume: VoxelVolume, files: Sequence[PointFile]) -> VoxelVolume:
    """The volume with the location of its middle, if the files have a location."""
    file = next((file for file in files if file.reference.horizontal is not None), None)
    if file is None or file.reference.horizontal is None:
        return volume
    corner_m = np.array([volume.x_min_m, volume.y_min_m])
    x, y = ((corner_m + 0.5 * np.array(volume.size_m)) / file.metres).tolist()
    found = location_of(file.reference.horizontal, x, y)
    if found is None:
        return volume
    return replace(volume, place=found[:2], turn_deg=found.turn_deg)


def _check_same(first: PointFile, file: PointFile) -> None:
    """Refuse a file whose reference system is not the reference system of the first file."""
    one, other = first.reference, file.reference
    if other.horizontal is not None and file is not first:
        assert one.horizontal is not None
        if not _are_equal(one.horizontal, other.horizontal, first, file):
            raise RequestError(
                f"point clouds {first.name} and {file.name} have different coordinate reference "
                f"systems: {one.horizontal.name} and {other.horizontal.name}",
                "reproject the files to one system",
            )
    if one.vertical and other.vertical and _datum(one.vertical) != _datum(other.vertical):
        raise RequestError(
            f"heights of point clouds {first.name} and {file.name} have different "
            f"vertical datums: {one.vertical} and {other.vertical}",
            "transform the files to one vertical coordinate reference system",
        )


def _datum(name: str) -> str:
    """Name of a vertical datum without its unit: NAVD88 for ``NAVD88 height (ftUS)``."""
    return name.lower().split(" height")[0].split("(")[0].strip()


def _are_equal(one: CRS, other: CRS, first: PointFile, file: PointFile) -> bool:
    if one == other:
        return True
    from pyproj.exceptions import ProjError

    here = file.first_m()[:2]
    assert file.units.across_m is not None
    assert first.units.across_m is not None
    try:
        there = transformer(other, one).transform(*(here / file.units.across_m).tolist())
    except ProjError:
        return False
    moved = math.dist([value * first.units.across_m for value in there], here.tolist())
    return moved <= APART_M
