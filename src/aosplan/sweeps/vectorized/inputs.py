"""Inputs of a block from its options, as columns: camera, altitude, scene, target, flight."""

from __future__ import annotations

import math
import os
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.camera.find import find_camera
from aosplan.errors import RequestError
from aosplan.flight.drones import DRONES
from aosplan.mission.mission import check_hold
from aosplan.planning.loaded_scene import load_scene
from aosplan.planning.options import DEFAULTS
from aosplan.planning.request import PlanRequest
from aosplan.scenes.density import integrated_density, transparency
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
"""Grids that can be solved as columns."""

VALUES: dict[str, tuple[Any, ...]] = {
    "model": ("uniform",),
    "optimize": ("samples",),
    "grid": GRIDS,
    "trigger": ("stop",),
    "rays": ("nadir",),
    "hold_error": (0.0,),
    "drone": tuple(DRONES),
}
"""Options for which only these values can be solved as columns."""

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
    "camera",
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
    "autopilot",
    "payload",
    "camera_control",
    "transit_speed",
    "photo_interval",
    "altitude_frame",
    *VALUES,
}
"""Options that can be solved as columns, or do not change the results here."""

MOST_COUNTED = 1 << 53
"""Numbers of samples above this are not distinguished, because all are too many."""


def solvable_as_columns(block: Block) -> NDArray[np.bool_] | None:
    """Mask of the scenarios whose options can all be solved as columns; None if there are none.

    The mask broadcasts to the block's shape.
    """
    given = block.columns
    if not set(given) <= UNDERSTOOD:
        return None
    if "occluder_size" in given and given.keys().isdisjoint(("density", "integrated_density")):
        return None  # presets and scene files have their own occluder size
    checked = {
        name: value
        for name, value in block.request_values(0).items()
        # These options may have wrong values in some rows only.
        if name not in ("max_samples", "heading", *VALUES)
    }
    if "fov" in checked:
        checked["fov"] = 90.0
    try:
        PlanRequest(**checked)
    except RequestError:
        return None  # options that contradict each other, or a missing option
    mask: NDArray[np.bool_] = np.True_  # type: ignore[assignment]  # broadcasts as any array
    for name in VALUES.keys() & given.keys():
        mask = mask & _among(given[name], VALUES[name])
    if "heading" in given and given["heading"].dtype == object:
        numeric = [isinstance(value, float) for value in given["heading"].flat]
        mask = mask & np.reshape(numeric, given["heading"].shape)
    if "fov" in given:
        mask = mask & (given["fov"] < 180.0)
    if "autopilot" in given and "drone" in given:
        return None  # they may contradict each other in some rows only
    if "autopilot" in given or "drone" in given:
        mask = mask & _held(given)
    return mask if mask.any() else None


def _held(given: Columns) -> NDArray[np.bool_]:
    """Mask of the scenarios whose autopilot stops for the whole hold."""
    pilots = given.get("autopilot")
    if pilots is None:
        pilots = np.array([_autopilot(name) for name in given["drone"].flat], dtype=object)
        pilots = pilots.reshape(given["drone"].shape)
    hold, held = column(given, "hold"), np.True_
    for pilot in set(pilots.flat):
        held = held & ((pilots != pilot) | by_value(partial(_is_held, pilot), bool, hold))
    return np.asarray(held)


def _autopilot(drone: str | None) -> str | None:
    return DRONES[drone].autopilot if drone in DRONES else None


def _is_held(autopilot: str | None, hold_s: float) -> bool:
    try:
        check_hold(autopilot, hold_s)
    except RequestError:
        return False
    return True


def known_share(name: str, column: NDArray[Any], folder: str) -> float:
    """Share of an option's values that can be solved as columns, regardless of other options."""
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


def by_value(function: Callable[[Any], Any], dtype: Any, values: NDArray[Any]) -> NDArray[Any]:
    """Evaluate a function of one value once for each distinct value of an array.

    If the function returns several numbers, they are along the last axis of the result.
    """
    if values.dtype == object:  # text and numbers may be mixed, which cannot be sorted
        numbered = {value: place for place, value in enumerate(dict.fromkeys(values.flat))}
        distinct = list(numbered)
        places = np.array([numbered[value] for value in values.flat])
    else:
        found, places = np.unique(values, return_inverse=True)
        distinct = found.tolist()
    table = np.array([function(value) for value in distinct], dtype=dtype)
    return np.asarray(table[places]).reshape(values.shape + table.shape[1:])


def column(given: Columns, name: str) -> NDArray[Any]:
    """The column of an option, or its default value."""
    if name in given:
        return given[name]
    value = DEFAULTS[name]
    return np.array(value, dtype=object if isinstance(value, str) else None)


class CameraColumns(NamedTuple):
    """Cameras; `known` is true if there is a camera of this name."""

    focal_length_px: Any
    focal_length_mm: Any
    sensor_width_mm: Any
    sensor_height_mm: Any
    known: Any = np.True_


def camera_columns(given: Columns, folder: str) -> CameraColumns:
    """The cameras of a block, as `aosplan.planning.resolve.camera_of` finds them."""
    if "fov" in given:
        width = given["image_width"]
        focal = 0.5 / np.tan(np.radians(given["fov"]) / 2.0)
        return CameraColumns(focal * width, focal, 1.0, given["image_height"] / width)
    if "focal_length" in given:
        focal, sensor = given["focal_length"], given["sensor_width"]
        width, height = given["image_width"], given["image_height"]
        across = given.get("sensor_height", sensor * height / width)
        return CameraColumns(focal * width / sensor, focal, sensor, across)
    if "camera" in given:
        found = by_value(lambda name: _camera(name, folder), np.float64, given["camera"])
    elif "drone" in given:
        found = by_value(lambda name: _camera(_carried(name), folder), np.float64, given["drone"])
    else:
        found = np.array(_camera(DEFAULTS["camera"], folder))
    focal_px, focal, width, height, known = (found[..., place] for place in range(5))
    return CameraColumns(focal_px, focal, width, height, known > 0.0)


def _carried(drone: str) -> str:
    """The camera of a drone; empty if it is unknown, in which case the row is refused."""
    return (DRONES[drone].camera if drone in DRONES else None) or ""


def _camera(name: str, folder: str) -> tuple[float, ...]:
    """Numbers of a camera, and whether a camera with this name exists."""
    try:
        camera = find_camera(name, folder)
    except RequestError:
        return (math.nan,) * 4 + (0.0,)
    return (
        camera.focal_length_px,
        camera.focal_length_mm,
        camera.sensor_width_mm,
        camera.sensor_height_mm,
        1.0,
    )


def altitude_columns(given: Columns, camera: CameraColumns) -> Any:
    """Altitudes above the focal plane [m], given or computed from the requested resolution."""
    if "altitude" in given:
        return given["altitude"]
    if "gsd" in given:
        return given["gsd"] * camera.focal_length_px
    return given["target_size"] / given["target_pixels"] * camera.focal_length_px


class SceneColumns(NamedTuple):
    """The parts of uniform scenes above the focal plane, with heights above it.

    `canopy_top_m` is above the ground.  `clear` is true if nothing is hidden, `empty` if there are
    no occluders at all, and `known` if the scene is uniform.
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
    """The scenes of a block, cut as by `aosplan.scenes.scene.UniformScene.above`."""
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
    """p and 1 - p of the remaining parts of volumes, from the density of a slice or of the whole."""
    if whole is not None and cut is not None:
        lowered = -np.expm1(np.log1p(-whole) * left / thickness)
        whole = np.where(cut & (whole < 1.0), lowered, whole)
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


@lru_cache(maxsize=1000)
def uniform_scene(name: str, folder: str) -> tuple[float, ...]:
    """Numbers of a uniform scene from a preset or file, and whether there is one."""
    found: Any = find_preset_scene(name)
    if found is None and os.path.splitext(name)[1].lower() in (".toml", ".json"):
        try:
            found = load_scene(PlanRequest(altitude=1.0, scene=name), folder=folder).scene
        except RequestError:
            found = None
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
    """The targets.

    `most` is the largest acceptable shortfall 1 - V̂, including the solver's tolerance.  `fewest`
    is the number of samples that is enough if all are independent, or 0 if no number is enough.
    """

    symbol: str
    value: Any
    most: Any
    fewest: Any


def target_columns(given: Columns, scene: SceneColumns) -> TargetColumns:
    """The targets of a block, computed as exactly as by `aosplan.solver.problem.Requirement`."""
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
    """A target, its shortfall, and the number of samples that it needs."""
    target = Requirement("normalized", _exact(share))
    fewest = target.fewest_independent(None)  # type: ignore[arg-type]  # whatever the model
    assert fewest is not None  # a normalised target below 1 can always be met
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
    """⌈p T / (1 - V - p²)⌉; in exact arithmetic if rounding could change the result."""
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


def timing_columns(given: Columns) -> tuple[Any, Any, Any]:
    """Speed [m/s], acceleration [m/s²] and hold [s] of the flights."""
    hold = column(given, "hold")
    if "drone" not in given:
        return column(given, "speed"), column(given, "acceleration"), hold
    flown = by_value(_flown, np.float64, given["drone"])
    speed = np.minimum(given.get("speed", flown[..., 0]), flown[..., 2])
    return speed, given.get("acceleration", flown[..., 1]), hold


def _flown(drone: str) -> tuple[float, float, float]:
    found = DRONES.get(drone)
    if found is None:
        return (math.nan,) * 3
    return found.speed_mps, found.acceleration_mps2, found.airspeed_mps
