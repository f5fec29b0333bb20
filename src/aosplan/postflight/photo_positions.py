"""Positions of photos from their metadata: XMP of the drone's manufacturer, or EXIF.

XMP is preferred, because the positions that DJI and other manufacturers write there have more
decimals than the seconds in EXIF. XMP also has the height above the take-off point. The images
themselves are not decoded.
"""

from __future__ import annotations

import contextlib
import filecmp
import math
import os
import re
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import MissingExtraError, RequestError, needs_extra
from aosplan.files import decoding
from aosplan.postflight.positions_file import Place

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

SUFFIXES = (".jpg", ".jpeg", ".tif", ".tiff", ".png")
"""Extensions of photos.  A PNG is a photo if it has a position, because figures are PNGs too."""

GPS = 0x8825
"""EXIF tag of the GPS information."""

XMP_BYTES = 1 << 18
"""Number of bytes at the start of a file in which XMP is searched."""

_SHOT = re.compile(r"(?P<series>.*?)_(?:\d{14}_)?(?P<number>\d{3,})_[A-Z]{1,4}")
"""Matches names of DJI's photos that several cameras take at the same time:
``DJI_20250101120000_0001_T``.
"""

PAIR_DEG = 2e-5
"""Largest difference [deg] between the positions of photos of the same shot, about 2 m."""

_XMP = re.compile(
    rb"(?:drone-dji|drone|drone-parrot|drone-skydio|Camera):"
    rb"(GpsLatitude|GpsLongt?itude|RelativeAltitude)(?:=\"|>)\s*([+-]?\d+(?:\.\d+)?)"
)


class Photos(NamedTuple):
    """The photos of a folder.

    Attributes
    ----------
    places
        Position of each photo by file name, in order; None if the photo has no position.
    doubtful
        Reason why the position of a photo is not used, by file name.
    paired
        Photos that are left out because another photo of the same shot, or a copy, is used. The
        keys are the names of the photos that are left out. The values are the names of the photos
        that are used instead.
    """

    places: dict[str, Place | None]
    doubtful: dict[str, str]
    paired: dict[str, str]


def read_photos(folder: str) -> Photos:
    """Read the positions of the photos in a folder.

    Altitudes are above the take-off point if the XMP has them.

    Raises
    ------
    RequestError
        If the folder does not exist, or if no photo in it has a position.
    MissingExtraError
        If Pillow is not installed.
    """
    places, doubtful = photo_places(folder)
    paired = copies_of(folder, places) | _pairs(places)
    return Photos(
        {name: place for name, place in places.items() if name not in paired}, doubtful, paired
    )


def photo_places(folder: str) -> tuple[dict[str, Place | None], dict[str, str]]:
    """Positions of all photos in a folder by name, and the reasons why some positions are not used.

    Photos in folders inside the folder are included.  Their names are paths relative to the folder.

    Raises
    ------
    RequestError, MissingExtraError
        In the same cases as `read_photos`.
    """
    names = _names(folder)
    places: dict[str, Place | None] = {}
    doubtful: dict[str, str] = {}
    for name in names:
        try:
            places[name] = _place(os.path.join(folder, name))
        except DoubtfulError as error:
            places[name], doubtful[name] = None, str(error)
        if places[name] is None and name.lower().endswith(".png"):
            del places[name]
    if not any(places.values()):
        why = next(iter(doubtful.values()), "")
        raise RequestError(
            (f"folder '{folder}' has no photo with a position ({len(names)} photos were read)")
            + (f": {next(iter(doubtful))} {why}" if why else ""),
            "photos end in .jpg, .tif or .png and have GPS in their EXIF or XMP"
            if not why
            else "rewrite the metadata, for example with exiftool",
        )
    return places, doubtful


def _names(folder: str) -> list[str]:
    """Paths of the photos in a folder and in the folders inside it, relative to the
    outer folder.
    """

    def refuse(error: OSError) -> None:
        if error.filename == folder:
            raise RequestError(
                f"folder '{folder}': {(error.strerror or str(error)).lower()}"
            ) from None

    found = []
    for place, folders, files in os.walk(folder, onerror=refuse):
        folders[:] = [name for name in folders if name[0] != "."]
        found += [
            os.path.relpath(os.path.join(place, name), folder)
            for name in files
            if name.lower().endswith(SUFFIXES)
            and name[0] != "."
            and os.path.isfile(os.path.join(place, name))
        ]
    return sorted(found)


def copies_of(folder: str, places: Mapping[str, Place | None]) -> dict[str, str]:
    """Find photos that are copies of another photo. For each copy, the result has the name of the
    photo that is kept: the one with the shortest name, or the first in alphabetical order.
    """
    alike: dict[tuple[Place, int], list[str]] = {}
    for name, place in places.items():
        if place is not None:
            size = os.path.getsize(os.path.join(folder, name))
            alike.setdefault((place, size), []).append(name)
    found = {}
    for group in alike.values():
        names = sorted(group, key=lambda name: (len(name), name))
        for index, name in enumerate(names):
            one, other = (os.path.join(folder, each) for each in (name, names[0]))
            if index and filecmp.cmp(one, other, shallow=False):
                found[name] = names[0]
    return found


class DoubtfulError(Exception):
    """A position that may be wrong by a large distance, because its hemisphere is unclear or it is
    incomplete.
    """


def _pairs(places: dict[str, Place | None]) -> dict[str, str]:
    """Find photos that several cameras of a drone have taken in one shot. For each photo except the
    first, the result has the name of the first.

    The names that DJI gives to these photos differ in the last letter, such as T and V, and
    sometimes in the seconds of the time.
    """
    first: dict[str, str] = {}
    found = {}
    for name, place in places.items():
        match = _SHOT.fullmatch(os.path.splitext(name)[0])
        if match is None or place is None:
            continue
        shot = f"{match['series']}_{match['number']}"
        other = places.get(first.setdefault(shot, name))
        if first[shot] != name and other is not None and _are_near(place, other):
            found[name] = first[shot]
    return found


def _are_near(one: Place, other: Place) -> bool:
    return (
        abs(one.latitude - other.latitude) < PAIR_DEG
        and abs(one.longitude - other.longitude) < PAIR_DEG
    )


def _place(path: str) -> Place | None:
    with open(path, "rb") as file:
        found = {name.decode(): float(text) for name, text in _XMP.findall(file.read(XMP_BYTES))}
    # Early firmware of DJI misspells the name of the longitude.
    by_xmp = _fix(found.get("GpsLatitude"), found.get("GpsLongitude", found.get("GpsLongtitude")))
    if by_xmp is None:
        exif = _exif_place(path)
        by_exif = _fix(*exif) if exif else None
        return by_exif and Place(*by_exif, found.get("RelativeAltitude"))
    _check_signs(by_xmp, path)
    return Place(*by_xmp, found.get("RelativeAltitude"))


def _fix(latitude: float | None, longitude: float | None) -> tuple[float, float] | None:
    """A position; None if it is incomplete or not on earth, or if both numbers are 0.

    Cameras without a satellite position write zeros.
    """
    if latitude is None or longitude is None or latitude == longitude == 0.0:
        return None
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
        return None
    return latitude, longitude


def _check_signs(by_xmp: tuple[float, float], path: str) -> None:
    """Refuse a position whose hemisphere in EXIF differs from that in XMP."""
    try:
        exif = _exif_place(path)
    except (DoubtfulError, MissingExtraError):
        return  # The numbers in XMP have signs, so EXIF is not needed.
    for one, other in zip(by_xmp, exif or by_xmp, strict=True):
        if one * other < 0.0 and math.isclose(abs(one), abs(other), abs_tol=0.01):
            raise DoubtfulError(f"is at {one:g} by its XMP, and at {other:g} by its EXIF")


def _exif_place(path: str) -> tuple[float, float] | None:
    """Latitude and longitude from EXIF; None if EXIF does not contain them or is damaged.

    Raises
    ------
    DoubtfulError
        If the hemisphere, or a part of an angle, is missing.
    """
    with needs_extra("reading positions from EXIF", "pictures"):
        from PIL import Image
    try:
        with decoding("photo", path), allowing_any_size(Image), Image.open(path) as image:
            tags = image.getexif().get_ifd(GPS)
        latitude, longitude = degrees_of(tags, 1, "NS"), degrees_of(tags, 3, "EW")
    except (
        RequestError,
        OSError,
        ValueError,
        TypeError,
        ZeroDivisionError,
        SyntaxError,
        KeyError,
    ):
        return None  # Damaged metadata are treated as missing.
    return None if latitude is None or longitude is None else (latitude, longitude)


@contextlib.contextmanager
def allowing_any_size(pillow: Any) -> Iterator[None]:
    """Let Pillow open images of any size, because only their metadata are decoded."""
    kept, pillow.MAX_IMAGE_PIXELS = pillow.MAX_IMAGE_PIXELS, None
    try:
        yield
    finally:
        pillow.MAX_IMAGE_PIXELS = kept


def degrees_of(tags: dict[int, object], reference: int, letters: str) -> float | None:
    """Latitude or longitude in degrees.

    `reference` is the tag of the hemisphere.  The tag of the angle is the next one.
    """
    parts = tags.get(reference + 1)
    if not isinstance(parts, tuple) or len(parts) != 3:
        return None
    whole, minutes, seconds = (_number(part) for part in parts)
    if whole is None or abs(whole) > 180.0:
        return None
    if minutes is None or seconds is None:
        # 0/0 means that a part of the angle is not used. The part before it then has decimals.
        before = whole if minutes is None else minutes
        if before == math.floor(before) and not (whole == before == 0.0):
            raise DoubtfulError("has a position without its minutes or seconds")
        minutes, seconds = minutes or 0.0, 0.0
    value = abs(whole) + minutes / 60.0 + seconds / 3600.0
    if value == 0.0:
        return 0.0
    given = tags.get(reference, "")
    text = given.decode("ascii", "replace") if isinstance(given, bytes) else str(given)
    letter = text.strip("\0 ").upper()[:1]
    if not letter or letter not in letters:
        raise DoubtfulError(f"has a position without its hemisphere ({letters[0]} or {letters[1]})")
    if whole < 0.0 and letter == letters[0]:
        raise DoubtfulError(
            f"is at {whole:g} degrees and at {letter}, and these values contradict each other"
        )
    return -value if letter == letters[1] else value


def _number(part: Any) -> float | None:
    """A number in EXIF; None for 0/0."""
    try:
        value = float(part)
    except ZeroDivisionError:
        return None
    return None if math.isnan(value) else value
