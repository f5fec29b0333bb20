"""Inputs of a block from its options, as columns: camera, altitude, scene, target, flight."""

from __future__ import annotations

import math
import os
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.camera.camera import Optics, focal_length_of_fov
from aosplan.errors import RequestError
from aosplan.flight.drones import AUTOPILOTS
from aosplan.mission.mission import check_hold
from aosplan.planning.aircraft import with_drone_file
from aosplan.planning.loaded_scene import load_scene
from aosplan.planning.options import DEFAULTS
from aosplan.planning.request import PlanRequest
from aosplan.planning.resolve import camera_of, flight_of
from aosplan.scenes.density import density_of_part, integrated_density, transparency
from aosplan.scenes.presets import find_preset_scene
from aosplan.scenes.scene import SMALLEST_M, UniformScene
from aosplan.solver.problem import TOLERANCE, Requirement
from aosplan.units import exact_share

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from aosplan.sweeps.block import Block

    Columns = Mapping[str, NDArray[Any]]

GRIDS = ("trimmed", "rectangle", "square", "line")
"""Kinds of grid that the vectorized solver supports."""

VALUES: dict[str, tuple[Any, ...]] = {
    "model": ("uniform",),
    "optimize": ("samples",),
    "grid": GRIDS,
    "trigger": ("stop",),
    "rays": ("nadir",),
    "hold_error": (0.0,),
}
"""For some options, the values that the vectorized solver supports. It does not support other
values of these options.
"""

AIRCRAFT = ("camera", "drone", "payload", "autopilot", "camera_control", "altitude_frame")
"""Options that determine the camera, the speeds and the autopilot together."""

UNDERSTOOD = {
    "altitude",
    "gsd",
    "target_size",
    "target_pixels",
    "focal_height",
    "vhat",
    "visibility",
    "scene",
    "density",
    "integrated_density",
    "occluder_size",
    "volume_height",
    "volume_base",
    "focal_length",
    "sensor_width",
    "sensor_height",
    "fov",
    "image_width",
    "image_height",
    "coverage",
    "max_aperture",
    "max_samples",
    "baseline",
    "samples",
    "allow_no_common_ground",
    "clearance",
    "origin",
    "heading",
    "speed",
    "acceleration",
    "climb",
    "hold",
    "transit_speed",
    "photo_interval",
    *AIRCRAFT,
    *VALUES,
}
"""Options that the vectorized solver supports, or that do not change its results."""

MOST_COUNTED = 1 << 53
"""All numbers of samples above this limit are treated as equal, because they are too large for a
plan.
"""


def solvable_as_columns(block: Block) -> NDArray[np.bool_] | None:
    """Mask of the scenarios that the vectorized solver can solve, because it supports all their
    options; None if there are no such scenarios.

    The mask broadcasts to the shape of the block.
    """
    given = block.columns
    if not set(given) <= UNDERSTOOD:
        return None
    if "occluder_size" in given and given.keys().isdisjoint(("density", "integrated_density")):
        return None  # Presets and scene files have their own occluder size.
    checked = {
        name: value
        for name, value in block.request_values(0).items()
        # The values of these options may be wrong in only some of the rows.
        if name not in ("max_samples", "heading", *AIRCRAFT, *VALUES)
    }
    if "fov" in checked:
        checked["fov"] = 90.0
    try:
        PlanRequest(**checked)
    except RequestError:
        return None  # Options contradict each other, or an option is missing.
    mask: NDArray[np.bool_] = np.True_  # type: ignore[assignment]  # broadcasts as any array
    for name in VALUES.keys() & given.keys():
        mask = mask & _among(given[name], VALUES[name])
    if "heading" in given and given["heading"].dtype == object:
        numeric = [isinstance(value, float) for value in given["heading"].flat]
        mask = mask & np.reshape(numeric, given["heading"].shape)
    if "fov" in given:
        mask = mask & (given["fov"] < 180.0)
    return mask if mask.any() else None


def known_share(name: str, column: NDArray[Any], folder: str) -> float:
    """Share of an option's values that the vectorized solver supports.  Other options are not
    considered.
    """
    if name not in UNDERSTOOD:
        return 0.0
    if name == "scene":
        known = [value is None or uniform_scene(value, folder)[-1] > 0.0 for value in column.flat]
    elif name == "heading" and column.dtype == object:
        known = [not isinstance(value, str) for value in column.flat]
    elif name in VALUES:
        known = [value is None or value in VALUES[name] for value in column.flat]
    else:
        return 1.0
    return sum(known) / len(known)


def _among(column: NDArray[Any], values: tuple[Any, ...]) -> NDArray[np.bool_]:
    return np.reshape([value in values for value in column.flat], column.shape)


def by_value(function: Callable[..., Any], dtype: Any, *columns: NDArray[Any]) -> NDArray[Any]:
    """Evaluate a function once for each distinct combination of the values of columns.

    If the function returns several numbers, they are along the last axis of the result.
    """
    numbered = [_numbered(values) for values in columns]
    sizes = [len(distinct) for distinct, _ in numbered]
    places: Any = np.zeros((), dtype=np.int64)
    for size, (_, own) in zip(sizes, numbered, strict=True):
        places = places * size + own
    shape = np.shape(places)
    if len(columns) == 1:
        combined = [(value,) for value in numbered[0][0]]
    else:
        found, places = np.unique(places, return_inverse=True)
        indices = zip(*np.unravel_index(found, sizes), strict=True) if columns else [()]
        combined = [
            tuple(distinct[place] for place, (distinct, _) in zip(index, numbered, strict=True))
            for index in indices
        ]
    table = np.array([function(*values) for values in combined], dtype=dtype)
    return np.asarray(table[np.reshape(places, shape)])


def _numbered(values: NDArray[Any]) -> tuple[list[Any], NDArray[np.intp]]:
    """The distinct values of an array, and the index of each element among them."""
    if values.dtype == object:  # Objects may be text and numbers, which cannot be sorted together.
        numbered = {value: place for place, value in enumerate(dict.fromkeys(values.flat))}
        places = np.array([numbered[value] for value in values.flat], dtype=np.intp)
        return list(numbered), places.reshape(values.shape)
    found, places = np.unique(values, return_inverse=True)
    return found.tolist(), places.reshape(values.shape)


def column(given: Columns, name: str) -> NDArray[Any]:
    """The column of an option, or its default value."""
    if name in given:
        return given[name]
    value = DEFAULTS[name]
    return np.array(value, dtype=object if isinstance(value, str) else None)


@dataclass(frozen=True)
class CameraColumns(Optics[Any]):
    """Cameras."""

    focal_length_mm: Any
    sensor_width_mm: Any
    sensor_height_mm: Any
    image_width_px: Any


class AircraftColumns(NamedTuple):
    """The cameras and the settings of their flights, and whether the options of an aircraft can be
    combined.
    """

    camera: CameraColumns
    speed_mps: Any
    acceleration_mps2: Any
    hold_s: Any
    known: Any


def aircraft_columns(given: Columns, folder: str) -> AircraftColumns:
    """The cameras and the settings of flights of a block, found in the same way as in
    `aosplan.planning.resolve`.
    """
    own = next((name for name in ("fov", "focal_length") if name in given), None)
    named = tuple(name for name in AIRCRAFT if name in given)
    resolve = partial(_aircraft, named, own, folder)
    found = by_value(resolve, np.float64, *(given[name] for name in named))
    focal, across, along, pixels, speed, most, acceleration, autopilot = np.moveaxis(found, -1, 0)
    if own == "fov":
        pixels, across = given["image_width"], np.float64(1.0)
        focal, along = focal_length_of_fov(given["fov"], np), given["image_height"] / pixels
    elif own == "focal_length":
        focal, across = given["focal_length"], given["sensor_width"]
        pixels = given["image_width"]
        along = given.get("sensor_height", across * given["image_height"] / pixels)
    hold = column(given, "hold")
    held = by_value(_is_held, bool, autopilot, hold) if np.any(autopilot >= 0.0) else np.True_
    return AircraftColumns(
        CameraColumns(focal, across, along, pixels),
        np.minimum(given.get("speed", speed), most),
        given.get("acceleration", acceleration),
        hold,
        np.isfinite(speed) & held,
    )


@lru_cache(maxsize=10_000)
def _aircraft(
    names: tuple[str, ...], own_camera: str | None, folder: str, *values: str
) -> tuple[float, ...]:
    """Numbers of the camera, speed and its limit, acceleration, and the number of the autopilot.

    The numbers are nan if the options cannot be combined.
    """
    options: dict[str, Any] = dict(zip(names, values, strict=True))
    if own_camera is not None:
        options |= {own_camera: 1.0, "sensor_width": 1.0, "image_width": 1, "image_height": 1}
        if own_camera == "fov":
            del options["sensor_width"]
    try:
        request = PlanRequest(altitude=1.0, **with_drone_file(options, folder))
        camera = camera_of(request, folder=folder)
        flight = flight_of(request, camera.gsd_m(1.0), folder)
    except RequestError:
        return (math.nan,) * 8
    return (
        camera.focal_length_mm,
        camera.sensor_width_mm,
        camera.sensor_height_mm,
        camera.image_width_px,
        flight.speed_mps,
        min((bound.speed_mps for bound in flight.speed_bounds), default=math.inf),
        flight.acceleration_mps2,
        -1 if flight.autopilot is None else AUTOPILOTS.index(flight.autopilot),
    )


def _is_held(autopilot: float, hold_s: float) -> bool:
    """Whether an autopilot can hold its position for the whole time `hold_s`."""
    try:
        check_hold(AUTOPILOTS[int(autopilot)] if autopilot >= 0.0 else None, hold_s)
    except RequestError:
        return False
    return True


def altitude_columns(given: Columns, camera: CameraColumns) -> Any:
    """Altitudes above the focal plane [m], given or computed from the requested resolution."""
    if "altitude" in given:
        return given["altitude"]
    gsd_m = given["gsd"] if "gsd" in given else given["target_size"] / given["target_pixels"]
    return camera.altitude_for_gsd_m(gsd_m)


class SceneColumns(NamedTuple):
    """The parts of uniform scenes above the focal plane, with heights relative to this plane.

    `canopy_top_m` is above the ground.  `clear` is true if nothing is hidden.  `empty` is true if
    there are no occluders at all.  `known` is true if the scene is uniform.
    """

    density: Any
    transparency: Any
    occluder_size_m: Any
    bottom_m: Any
    top_m: Any
    canopy_top_m: Any
    clear: Any
    empty: Any
    known: Any
    name: Any


def scene_columns(given: Columns, folder: str) -> SceneColumns:
    """The scenes of a block, cut at the focal plane in the same way as in
    `aosplan.scenes.scene.UniformScene.above`.
    """
    by_slice = "density" in given
    known: Any = np.True_
    if by_slice or "integrated_density" in given:
        share = given["density" if by_slice else "integrated_density"]
        size, thickness = given["occluder_size"], given["volume_height"]
        bottom, name = column(given, "volume_base"), np.array("custom")
        slices, whole = (share, None) if by_slice else (None, share)
    else:
        name = column(given, "scene")
        found = by_value(lambda scene: uniform_scene(scene, folder), np.float64, name)
        slices, whole, size, bottom, thickness, known = (found[..., place] for place in range(6))
        known = known > 0.0
    top = bottom + thickness
    density, clear = _shares(slices, whole, thickness, thickness, size)
    empty = density == 0.0
    plane = given.get("focal_height")
    if plane is None or not np.any(plane):
        return SceneColumns(density, clear, size, bottom, top, top, empty, empty, known, name)
    cut = plane > 0.0
    base = np.maximum(bottom, plane)
    left = np.where(cut, top - base, thickness)
    known = known & ((left >= SMALLEST_M) | (plane >= top))
    density, clear = _shares(slices, whole, left, thickness, size, cut)
    nothing = (plane >= top) | (density == 0.0)
    return SceneColumns(
        density,
        clear,
        size,
        np.where(cut, base - plane, bottom),
        np.where(cut, (base - plane) + left, top),
        top,
        nothing,
        empty,
        known,
        name,
    )


def _shares(
    slices: Any, whole: Any, left: Any, thickness: Any, size: Any, cut: Any = None
) -> tuple[Any, Any]:
    """p and 1 - p of the remaining parts of volumes, computed from the density of a slice or from
    the density of the whole volume.
    """
    if whole is not None and cut is not None:
        whole = np.where(cut, density_of_part(whole, left, thickness, np), whole)
    if slices is None:
        return whole, 1.0 - whole
    density, clear = (
        integrated_density(slices, left, size),
        transparency(slices, left, size),
    )
    if whole is None:
        return density, clear
    by_slice = np.isfinite(slices)
    return np.where(by_slice, density, whole), np.where(by_slice, clear, 1.0 - whole)


def forget_files() -> None:
    """Clear stored content of files."""
    uniform_scene.cache_clear()
    _aircraft.cache_clear()


@lru_cache(maxsize=1000)
def uniform_scene(name: str, folder: str) -> tuple[float, ...]:
    """Numbers of a uniform scene from a preset or file, and whether there is such a scene."""
    file = os.path.splitext(name)[1].lower() in (".toml", ".json")
    found: Any = None
    if file or find_preset_scene(name) is not None:
        with suppress(RequestError):
            found = load_scene(PlanRequest(altitude=1.0, scene=name), folder=folder).scene
    if not isinstance(found, UniformScene):
        return (math.nan,) * 5 + (0.0,)
    return (
        math.nan if found.density is None else found.density,
        math.nan if found.given_integrated_density is None else found.given_integrated_density,
        found.occluder_size_m,
        found.volume_base_m,
        found.volume_height_m,
        1.0,
    )


class TargetColumns(NamedTuple):
    """The target visibilities.

    `most` is the largest acceptable shortfall 1 - V̂, including the tolerance of the solver.
    `fewest` is the number of samples that is enough if all samples are independent. It is 0 if no
    number is enough.
    """

    symbol: str
    value: Any
    most: Any
    fewest: Any


def target_columns(given: Columns, scene: SceneColumns) -> TargetColumns:
    """The targets of a block. They are computed as exactly as in
    `aosplan.solver.problem.Requirement`.
    """
    if "visibility" not in given:
        shares = column(given, "vhat")
        counted = by_value(_counted, np.float64, shares)
        fewest = counted[..., 2].astype(np.int64)
        return TargetColumns("V̂", counted[..., 0], counted[..., 1] * (1.0 + TOLERANCE), fewest)
    shares = given["visibility"]
    asked = by_value(lambda share: _values(_exact(share)), np.float64, shares)
    allowed = asked[..., 1] * (1.0 + TOLERANCE)
    p, t = scene.density, scene.transparency
    fewest = _fewest_by_density(shares, allowed, p, t)
    return TargetColumns("V", asked[..., 0], (allowed / p - p) / t, fewest)


@lru_cache(maxsize=100_000)
def _counted(share: float | str) -> tuple[float, float, int]:
    """A target, the shortfall that the target allows, and the number of samples that it needs."""
    target = Requirement("normalized", _exact(share))
    fewest = target.fewest_independent(None)  # type: ignore[arg-type]  # whatever the model
    assert fewest is not None  # A normalised target below 1 can always be met.
    return (*_values(target.target), min(fewest, MOST_COUNTED))


def _exact(share: float | str) -> Any:
    return exact_share(repr(share) if isinstance(share, float) else share, "target")


def _values(target: Any) -> tuple[float, float]:
    return float(target), float(1 - target)


class _Nadir(NamedTuple):
    """The properties of a model that a requirement uses."""

    density: float
    transparency: float


def _fewest_by_density(shares: Any, allowed: Any, p: Any, t: Any) -> NDArray[np.int64]:
    """⌈p T / (1 - V - p²)⌉.  It is computed in exact arithmetic if rounding could change the
    result.
    """
    shares, allowed, p, t = np.broadcast_arrays(shares, allowed, p, t)
    left = allowed - p * p
    count = p * t / left
    error = 1e-15 * (2.0 + allowed / np.abs(left))
    far = (count > 0.0) & (np.abs(count - np.rint(count)) > 4.0 * error * count)
    sure = (far & (count < 2.0**40)) | (left < -4.0 * error * allowed)
    fewest = np.where(left > 0.0, np.maximum(np.ceil(np.minimum(count, 2.0**40)), 1.0), 0.0)
    fewest = np.where(sure, fewest, 0.0).astype(np.int64)
    for place in np.argwhere(~sure & (p > 0.0) & (t > 0.0) & (p < 1.0)).tolist():
        at = tuple(place)
        target = Requirement("visibility", _exact(shares[at]))
        exact = target.fewest_independent(_Nadir(float(p[at]), float(t[at])))  # type: ignore[arg-type]
        fewest[at] = 0 if exact is None else min(exact, MOST_COUNTED)
    return fewest
