"""Conversion of canopy height rasters (GeoTIFF) to a `VoxelVolume`, with an assumption about
crowns.

A raster contains the height of the canopy, but no information about the space below. It is assumed
that leaves fill the space from `crown_base` times the canopy height up to the canopy height, if
this height is at least `min_height_m`. Gaps within crowns are not modelled, so the stand is denser
than in reality. Stems and undergrowth are missing.
"""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from aosplan.crs import (
    Units,
    are_same,
    crs_of_wkt,
    given_units,
    ground_scale,
    height_unit_m,
    location_of,
    true_lengths,
    unit_text,
    units_of,
)
from aosplan.errors import AosplanError, RequestError, SurroundingsError, needs_extra
from aosplan.files import reading
from aosplan.scenes.voxels import FACE, VoxelVolume, fits, too_many_voxels

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.crs import Location

    Floats = NDArray[np.float32]

EXTRA = "raster"
CROWN_BASE = 0.5
HIGHEST_M = 130.0
"""Height of the tallest trees on earth. Larger values in a raster are elevations, or are
in feet.
"""

MAX_EXTENT_M = 100_000.0
MOST_PIXELS = 500_000_000
MOST_OCTETS = 1 << 29
PIXELS_AT_ONCE = 1 << 22
MAGIC = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")

LOWEST_M = -100.0
"""Canopy heights below this value are treated as missing, even if the raster does not mark them."""


def read_canopy(
    path: str,
    *,
    voxel_m: float | None = None,
    min_height_m: float = 2.0,
    crown_base: float = CROWN_BASE,
    units: str | None = None,
) -> VoxelVolume:
    """Read a canopy height raster into voxels.

    Parameters
    ----------
    path
        A GeoTIFF with one band of heights above the ground.
    voxel_m
        Edge length of a voxel; None for the size of the raster's cells.
    min_height_m
        Vegetation lower than this is ignored.
    crown_base
        Height of the crown base as a share of the canopy height, 0 to 1.
    units
        Units that replace those in the raster: ``us-ft`` for cells and heights, or ``us-ft,m``
        (`aosplan.crs.given_units`).

    Returns
    -------
    VoxelVolume
        Each column has the canopy height at its centre.  Cells without data are empty, and a
        warning gives their share.

    Raises
    ------
    RequestError
        If the file is not a GeoTIFF of canopy heights, or has too many cells.
    MissingExtraError
        If rasterio is not installed.
    SurroundingsError
        If the operating system does not allow the file to be read.
    """
    _check_file(path)
    with needs_extra("reading canopy height rasters", EXTRA):
        import rasterio
        from rasterio.errors import NotGeoreferencedWarning, RasterioError
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)
            with rasterio.open(path, driver="GTiff") as raster:
                given = given_units(units) if units else Units(None, None)
                return _volume(raster, path, voxel_m, min_height_m, crown_base, given)
    except AosplanError:
        raise
    except MemoryError as error:
        raise SurroundingsError(
            f"not enough memory for raster {path}", "use larger voxels"
        ) from error
    except (RasterioError, ValueError, OSError) as error:
        reason = " ".join(str(error.__cause__ or error).split())
        raise RequestError(f"raster {path} is damaged or truncated: {reason}") from error


def _check_file(path: str) -> None:
    with reading(path, "raster"), open(path, "rb") as file:
        head = file.read(4)
    if head not in MAGIC:
        what = f"it begins with {head!r}" if head else "it is empty"
        raise RequestError(f"{path} is not a GeoTIFF: {what}")


def _volume(
    raster: Any,
    path: str,
    voxel_m: float | None,
    min_height_m: float,
    crown_base: float,
    given: Units,
) -> VoxelVolume:
    lengths_m, up_m, doubts, location = _metres(raster, path, given)
    _check_layout(raster, path)
    place = raster.transform
    cell_m = abs(place.a) * lengths_m[0], abs(place.e) * lengths_m[1]
    size_m = raster.width * cell_m[0], raster.height * cell_m[1]
    if not max(size_m) <= MAX_EXTENT_M:
        raise RequestError(
            f"raster {path} measures {size_m[0]:.3g} x {size_m[1]:.3g} m, which is too "
            "large for a stand",
            "crop it to the stand, and check the raster's coordinate system",
        )
    edge_m = min(cell_m) if voxel_m is None else voxel_m
    if edge_m > min(size_m):
        raise RequestError(
            f"voxels of {edge_m:g} m are larger than raster {path}, which measures "
            f"{size_m[0]:.4g} x {size_m[1]:.4g} m"
        )
    if not fits((*size_m, 0.0), edge_m):
        raise too_many_voxels((*size_m, HIGHEST_M), edge_m, f"raster {path}")
    # The rows of the volume are numbered from south to north, but the rows of most rasters are
    # numbered from north to south.
    columns, rows = (max(math.floor(length / edge_m + FACE), 1) for length in size_m)
    column = _cells(columns, edge_m / cell_m[0], raster.width, backwards=place.a < 0.0)
    row = _cells(rows, edge_m / cell_m[1], raster.height, backwards=place.e < 0.0)
    tops = _heights(raster, row, column, up_m)
    doubts += _without_data(tops, raster.nodata, up_m)
    known = ~np.isnan(tops)
    share = float(known.mean())
    if share == 0.0:
        raise RequestError(f"raster {path} contains no heights: no cell has data")
    if share < 1.0:
        message = (
            f"{1.0 - share:.1%} of the raster has no data and is treated as open ground, so "
            f"the canopy (p = {float((tops >= min_height_m).mean()):.3g}) looks more "
            "transparent than it is where the raster has data (p = "
            f"{float((tops[known] >= min_height_m).mean()):.3g})"
        )
        doubts.append(("partial_plot", message))
    highest = float(np.nanmax(tops))
    if highest > HIGHEST_M:
        raise RequestError(
            f"raster {path} reaches {highest:.4g} m, higher than any tree",
            "give heights above ground (the surface minus the terrain); if the raster does "
            "not contain their unit, give --units",
        )
    occupied = _crowns(np.nan_to_num(tops), edge_m, min_height_m, crown_base, f"raster {path}")
    if not occupied.any():
        doubts.append(("no_vegetation", f"all heights of the raster are below {min_height_m:g} m"))
    corner = (
        min(place.c, place.c + place.a * raster.width),
        min(place.f, place.f + place.e * raster.height),
    )
    return VoxelVolume(
        occupied=occupied,
        voxel_m=edge_m,
        x_min_m=corner[0] * lengths_m[0],
        y_min_m=corner[1] * lengths_m[1],
        min_height_m=min_height_m,
        ground="raster",
        place=location and location[:2],
        turn_deg=0.0 if location is None else location.turn_deg,
        warnings=tuple(doubts),
        source=path,
        assumed=(
            f"crowns are assumed to be solid from {crown_base:g} of the canopy's height to "
            "its top, because a raster does not show gaps in the crowns or what is below them"
        ),
    )


def _metres(
    raster: Any, path: str, given: Units
) -> tuple[tuple[float, float], float, list[tuple[str, str]], Location | None]:
    """Metres in the units of x, y and heights.  Also returns warnings, and the location of the
    raster's middle.

    Raises
    ------
    RequestError
        If the size of the cells in metres is unknown, or the unit of the heights is not clear.
    """
    if raster.transform.is_identity and raster.crs is None:
        raise RequestError(
            f"raster {path} has no georeference, so the size of its cells is unknown",
            "add it, for example with gdal_translate -a_ullr",
        )
    doubts = []
    crs, stated = None, Units(None, None)
    if raster.crs is None:
        if given.across_m is None:
            message = "the raster has no coordinate system, so metres are assumed"
            doubts.append(("units_assumed", message))
    else:
        crs = crs_of_wkt(raster.crs.to_wkt(), f"raster {path}")
        stated = units_of(crs, f"raster {path}")
    across_m = given.across_m or stated.across_m or 1.0
    up_m = given.up_m or height_unit_m(
        raster.units[0],
        stated,
        f"raster {path}",
        "give the unit with --units, such as ft,m or us-ft",
    )
    lengths_m, location = (across_m, across_m), None
    if crs is not None and given.across_m is None:
        middle = raster.transform * (0.5 * raster.width, 0.5 * raster.height)
        scale = ground_scale(crs, middle[0], middle[1])
        lengths_m = true_lengths(scale, across_m, f"raster {path}")
        location = location_of(crs, middle[0], middle[1])
    if lengths_m != (across_m, across_m):
        message = (
            f"cells of {path} are {lengths_m[0] / across_m:.4g} (x) and "
            f"{lengths_m[1] / across_m:.4g} (y) times as long on the ground as in the projection, "
            "so the cells were scaled by these factors"
        )
        doubts.append(("projection_scaled", message))
    if given.across_m is None and not are_same(across_m, 1.0):
        message = f"{path} has x and y in {unit_text(across_m)}: its cells were converted to metres"
        doubts.append(("units_converted", message))
    if given.up_m is None and not are_same(up_m, 1.0):
        message = f"{path} has heights in {unit_text(up_m)}: they were converted to metres"
        doubts.append(("heights_converted", message))
    return lengths_m, up_m, doubts, location


def _without_data(tops: Floats, nodata: float | None, up_m: float) -> list[tuple[str, str]]:
    """Replace impossible heights, which mark cells without data, by nan. Returns a warning."""
    strange = tops < LOWEST_M
    if not strange.any():
        return []
    value = float(tops[strange].min()) / up_m
    tops[strange] = np.nan
    tagged = (
        "has no value for missing data"
        if nodata is None
        else f"has another value for missing data, {nodata:g}"
    )
    message = (
        f"{float(strange.mean()):.1%} of the heights are as low as {value:.6g}, and the "
        f"raster {tagged}: these heights are treated as missing"
    )
    return [("nodata_assumed", message)]


def _check_layout(raster: Any, path: str) -> None:
    place = raster.transform
    if place.b != 0.0 or place.d != 0.0 or not 0.0 < abs(place.a * place.e) < math.inf:
        raise RequestError(f"raster {path} is rotated or sheared", "resample it to a north-up grid")
    if raster.count != 1:
        raise RequestError(
            f"raster {path} has {raster.count} bands; a canopy height raster has one",
            "select the band of heights with gdal_translate -b",
        )
    if np.dtype(raster.dtypes[0]).kind not in "iuf":
        raise RequestError(f"raster {path} contains {raster.dtypes[0]}, which cannot be heights")
    height, width = raster.block_shapes[0]
    octets = height * width * np.dtype(raster.dtypes[0]).itemsize
    if raster.width * raster.height > MOST_PIXELS or octets > MOST_OCTETS:
        raise RequestError(
            f"raster {path} has {raster.width} x {raster.height} cells, in blocks of {width} "
            f"x {height}, which are too many to read",
            "crop it to the stand, or write it in tiles",
        )


def _cells(count: int, step: float, cells: int, *, backwards: bool) -> NDArray[np.intp]:
    """Indices of the raster cells along one axis that contain the centres of the voxels.  The
    voxels are numbered eastwards or northwards.
    """
    cell: NDArray[np.intp] = np.minimum((np.arange(count) + 0.5) * step, cells - 1.0).astype(
        np.intp
    )
    if backwards:
        cell = cells - 1 - cell
    return cell


def _heights(raster: Any, row: NDArray[np.intp], column: NDArray[np.intp], up_m: float) -> Floats:
    """Canopy heights [m] at rows and columns of the raster; nan for cells without data."""
    scale, shift = raster.scales[0] * up_m, raster.offsets[0] * up_m
    tops = np.full((row.size, column.size), np.nan, dtype=np.float32)
    west, east = int(column.min()), int(column.max()) + 1
    strip = max(PIXELS_AT_ONCE // (east - west), 1)
    for start in range(0, row.size, strip):
        wanted = row[start : start + strip]
        first, last = int(wanted.min()), int(wanted.max()) + 1
        for top in range(first, last, strip):
            bottom = min(top + strip, last)
            cells = raster.read(1, window=((top, bottom), (west, east)), masked=True)
            inside = np.flatnonzero((wanted >= top) & (wanted < bottom))
            picked = cells[wanted[inside] - top][:, column - west].astype(np.float32)
            with np.errstate(over="ignore", invalid="ignore"):
                tops[start + inside] = picked.filled(np.nan) * np.float32(scale) + np.float32(shift)
    tops[~np.isfinite(tops)] = np.nan
    return tops


def _crowns(
    tops: Floats, voxel_m: float, min_height_m: float, crown_base: float, where: str
) -> NDArray[np.bool_]:
    """Voxels from crown base to top, shape (slices, rows, columns)."""
    canopy = (tops >= min_height_m) & (tops > 0.0)
    tops = np.where(canopy, tops, -1.0)
    highest = float(tops.max())
    if highest < 0.0:
        return np.zeros((0, *tops.shape), dtype=np.bool_)
    rows, columns = tops.shape
    size_m = columns * voxel_m, rows * voxel_m, highest
    if not fits(size_m, voxel_m):
        raise too_many_voxels(size_m, voxel_m, where)
    last = np.floor(tops / voxel_m + FACE).astype(np.int32)
    first = np.floor(np.maximum(crown_base * tops, min_height_m) / voxel_m + FACE).astype(np.int32)
    slices = int(last.max()) + 1
    occupied = np.zeros((slices, rows, columns), dtype=np.bool_)
    for k in range(slices):
        np.logical_and(first <= k, k <= last, out=occupied[k])
    occupied &= canopy
    return occupied
