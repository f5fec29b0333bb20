"""Files that contain a stand in compressed form (``.npz``).  Plans can be made from them without
the point cloud.

The file is a zip archive of plain arrays. It contains ``occupied`` (eight voxels per octet along x)
and the numbers and texts of a `VoxelVolume`. It also contains results that were computed from the
volume: the layers, and possibly the correlogram. It is read without pickle. It is written with
constant dates, so the same stand gives the same bytes.
"""

from __future__ import annotations

import io
import json
import struct
import tokenize
import zipfile
import zlib
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.errors import RequestError
from aosplan.files import parse_table, read_bytes
from aosplan.scenes.files.correlogram_table import correlogram_from, correlogram_table
from aosplan.scenes.opacity import Opacity
from aosplan.scenes.scene import Layer, LayeredScene
from aosplan.scenes.voxels import MAX_VOXELS, HalfStand, VoxelVolume

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.scenes.correlogram import Correlogram

VERSION = 1
BOUNDS = ("densest", "most_open")
"""Names of the two bounds of a volume from pulses."""

HALVES = ("first_half", "first_half_dense", "second_half", "second_half_dense")
"""Names of the volumes from the two halves of the pulses."""

MOST_OCTETS = MAX_VOXELS // 4
"""Largest size of a file, or of an array in it [bytes].  It is twice the size of the largest
volume, at eight voxels per octet.
"""

PLAIN_OCTETS = 16 * 1024 * 1024
"""A file may have this size after unpacking [bytes], whatever its ratio of compression."""

MOST_RATIO = 200
"""Larger files may have at most this ratio between the sizes after and before unpacking. For voxels
of trees, the ratio is about ten.
"""

DAMAGE = (
    ArithmeticError,
    EOFError,
    LookupError,
    MemoryError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
    struct.error,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zipfile.LargeZipFile,
    zlib.error,
)
"""Exceptions that the readers of archives and arrays raise if the file is not valid."""


class VoxelStand(NamedTuple):
    """A volume, its layers, and its correlogram if there is one."""

    volume: VoxelVolume
    layers: tuple[Layer, ...]
    correlogram: Correlogram | None = None

    @classmethod
    def of(cls, volume: VoxelVolume) -> VoxelStand:
        """A stand from a volume.  The layers are computed."""
        from aosplan.scenes.occluder_statistics import layered_scene

        return cls(volume, layered_scene(volume, "stand").layers)

    def scene(self, name: str) -> LayeredScene:
        """The layers as a scene."""
        return LayeredScene(
            name=name,
            layers=self.layers,
            measured_density=self.volume.column_occupancy,
            voxel_m=self.volume.slice_height_m,
            source=self.volume.source,
            assumed=self.volume.assumed,
        )


def stand_npz(stand: VoxelStand) -> bytes:
    """The bytes of an ``.npz`` file with a stand."""
    volume = stand.volume
    about = {
        "version": VERSION,
        "voxel_m": volume.voxel_m,
        "x_min_m": volume.x_min_m,
        "y_min_m": volume.y_min_m,
        "min_height_m": volume.min_height_m,
        "points": volume.points,
        "ground": volume.ground,
        "warnings": [list(warning) for warning in volume.warnings],
        "source": volume.source,
        "assumed": volume.assumed,
        "place": None if volume.place is None else list(volume.place),
        "turn_deg": volume.turn_deg,
        "shape": list(volume.occupied.shape),
        "slice_m": volume.slice_m,
        "opacity": None if volume.opacity is None else volume.opacity.to_document(),
        "layers": stand.layers,
    }
    if stand.correlogram is not None:
        about["correlogram"] = correlogram_table(stand.correlogram)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        _add(archive, "about", np.frombuffer(json.dumps(about).encode(), dtype=np.uint8))
        _add(archive, "occupied", np.packbits(volume.occupied, axis=2))
        others = [*zip(BOUNDS, volume.bounds or (), strict=False)]
        parts = [each for half in volume.halves or () for each in half]
        others += zip(HALVES, parts, strict=False)
        for name, other in others:
            _add(archive, name, np.packbits(other, axis=2))
    return buffer.getvalue()


def _add(archive: zipfile.ZipFile, name: str, array: NDArray[Any]) -> None:
    entry = zipfile.ZipInfo(f"{name}.npy", (1980, 1, 1, 0, 0, 0))
    entry.compress_type = zipfile.ZIP_DEFLATED
    with archive.open(entry, "w", force_zip64=True) as member:
        np.lib.format.write_array(member, array, allow_pickle=False)


def read_stand(path: str) -> VoxelStand:
    """Read a stand from a file that `stand_npz` wrote.

    Raises
    ------
    RequestError
        If the file is not valid, is damaged, or would not fit in memory.
    """
    return parse_stand(read_bytes(path, most=MOST_OCTETS), path)


def parse_stand(stored: bytes, path: str) -> VoxelStand:
    """The stand that the content of a file describes.  Raises the same errors as `read_stand`."""
    content = io.BytesIO(stored)
    try:
        with zipfile.ZipFile(content) as archive:
            declared = sum(entry.file_size for entry in archive.infolist())
        if declared <= MOST_OCTETS:
            if declared > max(PLAIN_OCTETS, MOST_RATIO * len(stored)):
                raise ValueError(f"{len(stored)} bytes are too few for a stand of {declared} bytes")
            with np.load(content, allow_pickle=False) as arrays:
                about, packed = arrays["about"], arrays["occupied"]
                if not (isinstance(about, np.ndarray) and isinstance(packed, np.ndarray)):
                    raise TypeError("its members are not arrays")
                bounds, halves = (
                    [arrays[name] for name in names if name in arrays.files]
                    for names in (BOUNDS, HALVES)
                )
                table = parse_table(about.tobytes(), path)
                return _stand(table, [packed, *bounds], halves, path)
    except DAMAGE as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise RequestError(f"'{path}' is not a voxel file, or it is damaged: {reason}") from None
    raise RequestError(f"'{path}' contains more than {MAX_VOXELS} voxels")


def _stand(
    about: dict[str, Any],
    packed: list[NDArray[np.uint8]],
    halves: list[NDArray[np.uint8]],
    path: str,
) -> VoxelStand:
    volume = _volume(about, packed, halves)
    if "layers" not in about:  # Files of early versions contain only the voxels.
        return VoxelStand.of(volume)
    layers = tuple(Layer(*map(float, layer)) for layer in about["layers"])
    table = about.get("correlogram")
    return VoxelStand(volume, layers, None if table is None else correlogram_from(table, path))


def _count(value: Any) -> int:
    if not 0 <= value < 2**53:
        raise ValueError("its number of points is not a number")
    return int(value)


def _volume(
    about: dict[str, Any], packed: list[NDArray[np.uint8]], halves: list[NDArray[np.uint8]]
) -> VoxelVolume:
    if about["version"] != VERSION:
        raise ValueError(f"its version is {about['version']}, not {VERSION}")
    slice_m, opacity, place = (about.get(name) for name in ("slice_m", "opacity", "place"))
    unpacked, parts = (
        [_unpacked(each, about["shape"]) for each in arrays] for arrays in (packed, halves)
    )
    return VoxelVolume(
        unpacked[0],
        voxel_m=float(about["voxel_m"]),
        x_min_m=float(about["x_min_m"]),
        y_min_m=float(about["y_min_m"]),
        min_height_m=float(about["min_height_m"]),
        points=_count(about["points"]),
        ground=str(about["ground"]),
        warnings=tuple((str(code), str(message)) for code, message in about["warnings"]),
        source=str(about["source"]),
        assumed=str(about.get("assumed", "")),
        slice_m=None if slice_m is None else float(slice_m),
        opacity=None if opacity is None else Opacity.from_document(opacity),
        place=None if place is None else (float(place[0]), float(place[1])),
        turn_deg=float(about.get("turn_deg", 0.0)),
        bounds=(unpacked[1], unpacked[2]) if len(unpacked) == 3 else None,
        halves=(HalfStand(*parts[:2]), HalfStand(*parts[2:])) if parts else None,
    )


def _unpacked(packed: NDArray[np.uint8], shape: list[int]) -> NDArray[np.bool_]:
    slices, rows, columns = shape
    if packed.dtype != np.uint8 or packed.shape != (slices, rows, -(-columns // 8)):
        raise ValueError("its voxels do not have the shape that the file states")
    return np.unpackbits(packed, axis=2, count=columns).view(np.bool_)
