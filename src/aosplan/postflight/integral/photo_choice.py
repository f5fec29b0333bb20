"""Choose the photos of a folder that show the ground from about the same height."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from aosplan.errors import RequestError
from aosplan.geodesy import to_local
from aosplan.messages import Message
from aosplan.postflight.photo_metadata import PhotoMetadata, read_metadata
from aosplan.postflight.photo_positions import copies_of, photo_places

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping

    from numpy.typing import NDArray

    from aosplan.postflight.positions_file import Place

LEVEL_DEG = -30.0
"""Pitch above which a camera shows the horizon instead of the ground."""

LOW = 0.5
"""A photo below this share of the median height of all photos is assumed to have been taken during
the climb.
"""

FAR_M, FAR = 500.0, 20.0
"""A position is wrong if its distance from the median position is larger than both of these values.
The first value is in metres. The second is a multiple of the median distance of all photos from the
median position.
"""

MOST_WRONG = 0.1
"""Largest share of the photos that may be left out because of the climb, or because of wrong
positions.
"""


def chosen_photos(
    folder: str, band: str | None
) -> tuple[dict[str, Place], dict[str, PhotoMetadata], list[Message]]:
    """Choose the photos of a folder.

    Photos are left out if they have no position or a position far from the others, if they are
    copies of other photos, if they look at the horizon, or if they were taken during the climb.

    Parameters
    ----------
    folder
        Folder of photos.
    band
        One of `aosplan.postflight.photo_metadata.BANDS`; None if the folder has one band only.

    Returns
    -------
    places, metadata, messages
        Positions of the chosen photos by name, metadata of the chosen photos by name, and warnings
        about the photos that are left out.

    Raises
    ------
    RequestError
        If the folder has photos of several bands and `band` is None, or if no photo remains.
    """
    places, doubtful = photo_places(folder)
    placed = {name: place for name, place in places.items() if place is not None}
    tags = {name: read_metadata(os.path.join(folder, name)) for name in placed}
    known = {name: found for name, found in tags.items() if found is not None}
    known = _of_band(known, band, folder)
    known, tilted = _looking_down(known, folder)
    copies = copies_of(folder, {name: placed[name] for name in known})
    known = {name: found for name, found in known.items() if name not in copies}
    far = _far({name: placed[name] for name in known})
    low = _low(known, placed)
    known = {name: found for name, found in known.items() if name not in {*far, *low}}
    pixels = {pixels_of(folder, name) for name in known}
    silent = [name for name, place in places.items() if place is None and name not in pixels]
    why = f" ({silent[0]} {doubtful[silent[0]]})" if silent and silent[0] in doubtful else ""
    reasons = (
        ("photos_without_position", "without a position", silent, why),
        ("copies", "with the same content as another photo", list(copies), ""),
        ("level_photos", "towards the horizon", tilted, ""),
        ("far_photos", "with a position far from all others", far, ""),
        ("low_photos", "below half of the median height", low, ""),
    )
    messages = [
        Message(
            code,
            f"{len(names)} photo{'s' * (len(names) > 1)} {words} {'are' if len(names) > 1 else 'is'} "
            f"left out: {named(names)}{more}",
        )
        for code, words, names, more in reasons
        if names
    ]
    return placed, known, [*messages, *_turned(known)]


def _far(places: Mapping[str, Place]) -> list[str]:
    """Names of photos with wrong positions, which are far from the positions of all
    other photos.
    """
    latitudes = [place.latitude for place in places.values()]
    longitudes = [place.longitude for place in places.values()]
    middle = int(np.argsort(latitudes)[len(latitudes) // 2])
    origin = latitudes[middle], longitudes[middle]
    east, north = map(np.array, to_local(origin, latitudes, longitudes))
    off = np.hypot(east - np.median(east), north - np.median(north))
    return _few(list(places), off > max(FAR_M, FAR * float(np.median(off))))


def _low(tags: Mapping[str, PhotoMetadata], places: Mapping[str, Place]) -> list[str]:
    """Names of photos that were taken on the ground or during the climb."""
    heights = [
        tags[name].relative_altitude_m
        if places[name].altitude_m is None
        else places[name].altitude_m
        for name in tags
    ]
    above = np.array([np.nan if height is None else height for height in heights])
    low = above < LOW * np.median(above)
    few = _few(list(tags), low)
    return few or [name for name, is_low in zip(tags, _is_climb(above, low), strict=True) if is_low]


def _is_climb(above_m: NDArray[np.float64], low: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mask of the low photos that were taken during the climb or the descent. Their heights
    increase at the beginning of the flight or decrease at its end. If any other photo is low, the
    flight is assumed to have two heights, and no photo is in the mask.
    """
    flown = np.flatnonzero(~low)
    first, last = flown[0], flown[-1]
    climb = np.zeros_like(low)
    climb[:first] = bool((np.diff(above_m[: first + 1]) > 0.0).all())
    climb[last + 1 :] = bool((np.diff(above_m[last:]) < 0.0).all())
    return climb if (climb == low).all() else np.zeros_like(low)


def _few(names: list[str], are_wrong: Collection[bool]) -> list[str]:
    """Names of the photos that are wrong. There are no names if so many photos are wrong that they
    cannot be exceptions.
    """
    found = [name for name, is_wrong in zip(names, are_wrong, strict=True) if is_wrong]
    return found if len(found) <= max(MOST_WRONG * len(names), 1.0) < len(names) else []


def _of_band(
    tags: Mapping[str, PhotoMetadata], band: str | None, folder: str
) -> dict[str, PhotoMetadata]:
    """The photos that were taken by one of the drone's cameras."""
    kinds = {name: found.band for name, found in tags.items() if found.band != "screen"}
    if "thermal" in kinds.values():
        # If there are thermal photos, photos without the name of a camera are from the visible
        # camera.
        kinds = {name: kind or "visible" for name, kind in kinds.items()}
    there = sorted({kind for kind in kinds.values() if kind is not None})
    if band is None:
        if len(there) > 1:
            counted = ", ".join(
                f"{sum(kind == each for kind in kinds.values())} {each}" for each in there
            )
            visible = [each for each in there if each != "thermal"]
            remedies = ["thermal"] * ("thermal" in there) + (
                ["visible"] if len(visible) == 1 else visible
            )
            raise RequestError(
                f"folder '{folder}' contains photos of several cameras: {counted}",
                " or ".join(f"--band {each}" for each in remedies),
            )
        return {name: tags[name] for name in kinds}
    wanted = {"visible", "wide", "zoom", None} if band == "visible" else {band}
    chosen = {name: tags[name] for name, kind in kinds.items() if kind in wanted}
    if not chosen:
        raise RequestError(
            f"--band {band}: folder '{folder}' contains no photo of this kind",
            f"it contains {', '.join(there)}"
            if there
            else "the photos in the folder do not name their camera",
        )
    kinds = {name: tags[name].band for name in chosen}
    if band == "visible" and {"wide", "zoom"} <= set(kinds.values()):
        raise RequestError(
            f"folder '{folder}' contains photos of a wide and of a zoom camera",
            "give --band wide or --band zoom",
        )
    return chosen


def _looking_down(
    tags: Mapping[str, PhotoMetadata], folder: str
) -> tuple[dict[str, PhotoMetadata], list[str]]:
    tilted = [
        name
        for name, found in tags.items()
        if found.pitch_deg is not None and found.pitch_deg > LEVEL_DEG
    ]
    left = {name: found for name, found in tags.items() if name not in set(tilted)}
    if not left:
        raise RequestError(
            f"folder '{folder}' has no photo that looks down"
            + (
                f": {tilted[0]} has a pitch of {tags[tilted[0]].pitch_deg:g} degrees"
                if tilted
                else ""
            ),
            "for a photo straight down, the pitch of the gimbal is -90 degrees",
        )
    return left, tilted


def named(names: Iterable[str]) -> str:
    """Text for a message with the first three of the file names."""
    listed = ["".join(c if c.isprintable() else "?" for c in name) for name in names]
    return ", ".join(listed[:3]) + " ..." * (len(listed) > 3)


def _turned(tags: Mapping[str, PhotoMetadata]) -> list[Message]:
    """Warning about photos that image viewers rotate.  Their pixels are used in the order in which
    they are stored.
    """
    turned = [name for name, found in tags.items() if found.orientation != 1]
    if not turned:
        return []
    return [
        Message(
            "orientation",
            f"{len(turned)} photos have an EXIF orientation other than 1 and are not turned, "
            "because their yaw, pitch and roll are assumed to refer to the sensor: "
            + named(turned),
        )
    ]


def pixels_of(folder: str, name: str) -> str:
    """Name of the file with the pixels of a photo: the radiometric TIFF that belongs to a JPEG, or
    the photo itself.
    """
    stem, ending = os.path.splitext(name)
    if ending.lower() in (".jpg", ".jpeg"):
        for other in (".tif", ".tiff", ".TIF", ".TIFF"):
            if os.path.isfile(os.path.join(folder, stem + other)):
                return stem + other
    return name
