"""Where photos were taken, as their own metadata say: XMP of the drone's maker, else EXIF.

XMP, where DJI and others write it, has more decimals than EXIF's seconds, and the height above the
take-off.  Neither the pictures nor anything else of the files is decoded.
"""

from __future__ import annotations

import contextlib
import os
import re
from typing import TYPE_CHECKING, Any

from aosplan.errors import RequestError, needs_extra
from aosplan.files import decoding
from aosplan.postflight.positions import Place

if TYPE_CHECKING:
    from collections.abc import Iterator

SUFFIXES = (".jpg", ".jpeg", ".tif", ".tiff")
"""Endings of photos."""

GPS = 0x8825
"""Tag of EXIF under which positions are."""

XMP_BYTES = 1 << 18
"""Makers write XMP at the beginning of a file."""

_XMP = re.compile(
    rb"(?:drone-dji|Camera):(GpsLatitude|GpsLongt?itude|RelativeAltitude)"
    rb"(?:=\"|>)\s*([+-]?\d+(?:\.\d+)?)"
)


def read_photos(folder: str) -> dict[str, Place | None]:
    """Places of the photos in a folder by their names, in order; None where a photo says none.

    Altitudes are above the take-off where the XMP says them.

    Raises
    ------
    RequestError
        Where there is no folder, or no photo in it has a place.
    MissingExtraError
        Where Pillow is not installed.
    """
    try:
        names = sorted(
            name
            for name in os.listdir(folder)
            if name.lower().endswith(SUFFIXES)
            and name[0] != "."
            and os.path.isfile(os.path.join(folder, name))
        )
    except OSError as error:
        raise RequestError(f"folder '{folder}': {(error.strerror or str(error)).lower()}") from None
    places = {name: _place(os.path.join(folder, name)) for name in names}
    if not any(places.values()):
        raise RequestError(
            f"folder '{folder}' has no photo with a position ({len(names)} photos looked at)",
            "photos end in .jpg or .tif and have GPS in their EXIF or XMP",
        )
    return places


def _place(path: str) -> Place | None:
    with open(path, "rb") as file:
        found = {name.decode(): float(text) for name, text in _XMP.findall(file.read(XMP_BYTES))}
    latitude = found.get("GpsLatitude")
    # Early firmware of DJI misspells it.
    longitude = found.get("GpsLongitude", found.get("GpsLongtitude"))
    if latitude is None or longitude is None:
        exif = _exif_place(path)
        if exif is None:
            return None
        latitude, longitude = exif
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0) or latitude == longitude == 0.0:
        return None  # without a fix cameras write zeros
    return Place(latitude, longitude, found.get("RelativeAltitude"))


def _exif_place(path: str) -> tuple[float, float] | None:
    with needs_extra("reading positions from EXIF", "pictures"):
        from PIL import Image
    try:
        with decoding("photo", path), _of_any_size(Image), Image.open(path) as image:
            tags = image.getexif().get_ifd(GPS)
        return next(_degrees(tags, 1)), next(_degrees(tags, 3))
    except (
        RequestError,
        OSError,
        ValueError,
        TypeError,
        ZeroDivisionError,
        StopIteration,
        SyntaxError,
        KeyError,
    ):
        return None  # damaged metadata are none


@contextlib.contextmanager
def _of_any_size(pillow: Any) -> Iterator[None]:
    """Let Pillow open images of any size: of these nothing is decoded but the metadata."""
    kept, pillow.MAX_IMAGE_PIXELS = pillow.MAX_IMAGE_PIXELS, None
    try:
        yield
    finally:
        pillow.MAX_IMAGE_PIXELS = kept


def _degrees(tags: dict[int, object], reference: int) -> Iterator[float]:
    """Degrees of a latitude or longitude: its letter at a tag, three numbers at the next."""
    letter, parts = tags.get(reference), tags.get(reference + 1)
    if isinstance(parts, tuple) and len(parts) == 3:
        whole, minutes, seconds = map(float, parts)
        value = whole + minutes / 60.0 + seconds / 3600.0
        if abs(value) <= 180.0:  # nan is not
            yield -value if str(letter).upper()[:1] in {"S", "W"} else value
