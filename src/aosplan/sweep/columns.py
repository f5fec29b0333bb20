"""Uniform scenarios solved as whole columns.

Where neighbouring samples share no occluder V̂ = 1 - 1/N, the number of samples follows from the
target alone and the baseline from the coverage rule, so a block of scenarios is a handful of array
operations, and every quantity is an array over just the axes on which it depends.  Fixed baselines
below the rule's take the steps of `aosplan.sweep.lattices`.  Scenarios that need more, an aperture
that binds, and those that cannot be met, are left to `aosplan.sweep.rows`.
"""

from __future__ import annotations

import math
from collections import Counter
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.flight import path_of
from aosplan.models.equations import integrated_density, transparency
from aosplan.pattern import MOST_SITES, Sites, pattern_for
from aosplan.problem import Requirement
from aosplan.quantities import exact_share
from aosplan.resolve import find_camera, find_preset_scene
from aosplan.sweep.lattices import fewest, shortfalls

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from aosplan.sweep.scenarios import Block

    Columns = Mapping[str, NDArray[Any]]

CAMERA = {"camera", "focal_length", "sensor_width", "sensor_height", "fov"}
UNDERSTOOD = {
    "altitude",
    "gsd",
    "target_size",
    "target_pixels",
    "focal_height",
    "vhat",
    "scene",
    "density",
    "integrated_density",
    "occluder_size",
    "volume_height",
    "volume_base",
    "image_width",
    "image_height",
    "coverage",
    "max_aperture",
    "max_samples",
    "baseline",
    "samples",
    "clearance",
    "grid",
    "origin",
    "heading",
    "speed",
    "acceleration",
    "hold",
} | CAMERA
"""Options that columns understand; `model` and `optimize` at their defaults besides."""

CLEAREST = 1e-290
"""Densities below this overflow the contrast."""

GRIDS = ("trimmed", "rectangle", "square", "line")


class Solved(NamedTuple):
    """Results of a block by name, each broadcasting to its shape, and where they hold."""

    columns: dict[str, NDArray[Any]]
    holds: NDArray[np.bool_]


class _Scene(NamedTuple):
    density: Any
    transparency: Any
    occluder_size_m: Any
    bottom_m: Any
    top_m: Any
    known: Any


class _Camera(NamedTuple):
    focal_length_px: Any
    height_ratio: Any
    width_ratio: Any


def solve_columns(block: Block) -> Solved | None:
    """Solve what columns can of a block; None where the options are beyond them."""
    given = block.columns
    if not set(given) <= UNDERSTOOD | {"model", "optimize"}:
        return None
    if not (_only(given, "model", "uniform") and _only(given, "optimize", "samples")):
        return None
    if "grid" in given and not set(given["grid"].flat) <= set(GRIDS):
        return None
    camera = _camera(given)
    altitude = _altitude(given, camera)
    with np.errstate(all="ignore"):
        scene = _above(_scene(given), given.get("focal_height", np.float64(0.0)))
        height = scene.top_m - given.get("coverage", np.float64(0.98)) * (
            scene.top_m - scene.bottom_m
        )
        unit = _unit_baseline_m(scene.occluder_size_m, height, altitude, camera.focal_length_px)
        holds = (
            scene.known
            & (scene.density > CLEAREST)
            & (scene.density < 1.0)
            & (scene.transparency > 0.0)
            & (altitude > scene.top_m)
            & (altitude >= scene.top_m + given.get("clearance", np.float64(2.0)))
            & (height > 0.0)
            & np.isfinite(unit)
        )
        required = _by_value(_fewest, np.int64, given.get("vhat", np.array([0.98])))
        wanted = given.get("samples", required)
        grid = given.get("grid", np.array(["trimmed"], dtype=object))
        baseline = given.get("baseline", unit)
        shortfall = None
        if "baseline" in given:
            closer = _closer(given, grid, required, baseline / unit, holds)
            wanted, required, shortfall = closer.wanted, closer.required, closer.shortfall
            holds = holds & closer.known
        else:
            holds = holds & (wanted >= required)
        holds = holds & (wanted <= MOST_SITES)
        layout = _layouts(wanted, grid)
        samples = layout["samples"]
        if shortfall is None:
            shortfall = 1.0 / samples
        if "max_samples" in given:
            holds = holds & (samples <= given["max_samples"])
        if "samples" in given and "max_samples" in given:
            holds = holds & (given["samples"] <= given["max_samples"])
        longer = np.maximum(layout["x"], layout["y"])
        if "max_aperture" in given:
            holds = holds & (longer * baseline <= given["max_aperture"])
        columns = _results(
            given, layout, shortfall, required, baseline, unit, height, scene, camera, altitude
        )
    return Solved(columns, np.asarray(holds))


def _results(
    given: Columns,
    layout: dict[str, Any],
    shortfall: Any,
    required: Any,
    baseline: Any,
    unit: Any,
    height: Any,
    scene: _Scene,
    camera: _Camera,
    altitude: Any,
) -> dict[str, Any]:
    p, t = scene.density, scene.transparency
    samples, normalized = layout["samples"], 1.0 - shortfall
    focal = camera.focal_length_px
    timing = (
        given.get("speed", np.float64(5.0)),
        given.get("acceleration", np.float64(2.0)),
        given.get("hold", np.float64(1.0)),
    )
    length, time = _flight(layout, baseline, timing)
    return {
        "altitude_m": altitude,
        "baseline_m": baseline,
        "samples": samples,
        "samples_required": required,
        "aperture_m": (np.sqrt(samples) - 1.0) * baseline,
        "grid_rows": layout["rows"],
        "grid_columns": layout["columns"],
        "grid_extent_x_m": layout["x"] * baseline,
        "grid_extent_y_m": layout["y"] * baseline,
        "visibility_density": p,
        "visibility_minimum": t,
        "visibility_maximum": t * (1.0 + p),
        "visibility_expected": t * (1.0 + p * normalized),
        "visibility_normalized": normalized,
        "visibility_shortfall": shortfall,
        "visibility_effective_samples": 1.0 / shortfall,
        "visibility_contrast": np.sqrt((1.0 / shortfall) * t / p),
        "disparity_normalized": baseline / unit,
        "disparity_pixels": baseline * focal * height / ((altitude - height) * altitude),
        "camera_gsd_m": altitude / focal,
        "camera_footprint_x_m": altitude * camera.height_ratio,
        "camera_footprint_y_m": altitude * camera.width_ratio,
        "flight_length_m": length,
        "flight_time_s": time,
    }


def _only(given: Columns, name: str, value: str) -> bool:
    return name not in given or set(given[name].flat) == {value}


def _by_value(function: Callable[[Any], Any], dtype: Any, values: NDArray[Any]) -> NDArray[Any]:
    """A function of one value, evaluated once for each distinct value of an array.

    Where it gives several numbers, they are along a last axis of the result.
    """
    if values.dtype == object:  # text and numbers may be mixed, which do not sort
        numbered = {value: place for place, value in enumerate(dict.fromkeys(values.flat))}
        distinct = list(numbered)
        places = np.array([numbered[value] for value in values.flat])
    else:
        found, places = np.unique(values, return_inverse=True)
        distinct = found.tolist()
    table = np.array([function(value) for value in distinct], dtype=dtype)
    return np.asarray(table[places]).reshape(values.shape + table.shape[1:])


@lru_cache(maxsize=100_000)
def _fewest(vhat: float | str) -> int:
    """Samples that a target takes, exactly as `Requirement` counts them; too many to fly: -1."""
    text = repr(vhat) if isinstance(vhat, float) else vhat
    target = exact_share(text, "vhat")
    fewest = Requirement("normalized", target).fewest_independent(None)  # type: ignore[arg-type]
    assert fewest is not None  # a normalised target below 1 is always met
    return min(fewest, MOST_SITES + 1)


def _camera(given: Columns) -> _Camera:
    if not set(given) & (CAMERA - {"camera"}):
        names = given.get("camera", np.array(["dji-m3t-thermal"], dtype=object))
        found = _by_value(_intrinsics, np.float64, names)
        return _Camera(found[..., 0], found[..., 1], found[..., 2])
    width, height = given["image_width"], given["image_height"]
    if "fov" in given:
        focal_over_width = 0.5 / np.tan(np.radians(given["fov"]) / 2.0)
        sensor_ratio = height / width
    else:
        focal_over_width = given["focal_length"] / given["sensor_width"]
        sensor_ratio = (
            given["sensor_height"] / given["sensor_width"]
            if "sensor_height" in given
            else height / width
        )
    return _Camera(
        focal_over_width * width, sensor_ratio / focal_over_width, 1.0 / focal_over_width
    )


@lru_cache(maxsize=1000)
def _intrinsics(name: str) -> tuple[float, float, float]:
    camera = find_camera(name)
    return (
        camera.focal_length_px,
        camera.sensor_height_mm / camera.focal_length_mm,
        camera.sensor_width_mm / camera.focal_length_mm,
    )


def _altitude(given: Columns, camera: _Camera) -> Any:
    if "altitude" in given:
        return given["altitude"]
    if "gsd" in given:
        return given["gsd"] * camera.focal_length_px
    return given["target_size"] / given["target_pixels"] * camera.focal_length_px


def _scene(given: Columns) -> _Scene:
    if "density" not in given and "integrated_density" not in given:
        names = given.get("scene", np.array(["paper-forest"], dtype=object))
        found = _by_value(_preset, np.float64, names)
        density, clear, size, bottom, top, known = (found[..., place] for place in range(6))
        return _Scene(density, clear, size, bottom, top, known > 0.0)
    size, thickness = given["occluder_size"], given["volume_height"]
    bottom = given.get("volume_base", np.array(2.0))
    if "density" in given:
        density = integrated_density(given["density"], thickness, size)
        clear = transparency(given["density"], thickness, size)
    else:
        density = given["integrated_density"]
        clear = 1.0 - density
    return _Scene(density, clear, size, bottom, bottom + thickness, np.True_)


@lru_cache(maxsize=1000)
def _preset(name: str) -> tuple[float, ...]:
    """Numbers of a preset scene, and whether the name is one."""
    scene = find_preset_scene(name)
    if scene is None:
        return (math.nan,) * 5 + (0.0,)
    return (
        scene.integrated_density,
        scene.transparency,
        scene.occluder_size_m,
        scene.volume_base_m,
        scene.canopy_top_m,
        1.0,
    )


def _above(scene: _Scene, focal_height: Any) -> _Scene:
    """What of the volumes stands above a height; Beer-Lambert for what is cut off."""
    if not np.any(focal_height):
        return scene
    bottom = np.maximum(scene.bottom_m, focal_height)
    share = (scene.top_m - bottom) / (scene.top_m - scene.bottom_m)
    cut = share < 1.0
    log_clear = np.log(scene.transparency) * share
    return scene._replace(
        density=np.where(cut, -np.expm1(log_clear), scene.density),
        transparency=np.where(cut, np.exp(log_clear), scene.transparency),
        bottom_m=bottom - focal_height,
        top_m=scene.top_m - focal_height,
        known=scene.known & (scene.top_m > focal_height),
    )


def _unit_baseline_m(size: Any, height: Any, altitude: Any, focal: Any) -> Any:
    """Baseline at which occluders at a height have d̂ = 1, or move by a pixel if smaller."""
    by_size = size * altitude / height
    by_pixel = (altitude - height) * altitude / (focal * height)
    return np.where(focal * size / (altitude - height) > 1.0, by_size, by_pixel)


class _Closer(NamedTuple):
    """What a fixed baseline makes of each scenario, and where that is known."""

    wanted: Any
    required: Any
    shortfall: Any
    known: Any


def _closer(given: Columns, grid: Any, independent: Any, dhat: Any, holds: Any) -> _Closer:
    """Samples and shortfalls where neighbours may share occluders."""
    allowed = _by_value(_allowed, np.float64, given.get("vhat", np.array([0.98])))
    fixed = given.get("samples")
    parts = [grid, independent, allowed, dhat, holds, *([] if fixed is None else [fixed])]
    shape = np.broadcast_shapes(*(np.shape(part) for part in parts))
    kinds, independent, allowed, dhat, holds, *rest = (
        np.broadcast_to(part, shape).reshape(-1) for part in parts
    )
    required = np.zeros(len(dhat), dtype=np.int64)
    wanted, shortfall = np.ones_like(required), np.full(len(dhat), np.nan)
    for kind in set(kinds.tolist()):
        rows = np.flatnonzero(holds & (kinds == kind) & (independent <= MOST_SITES))
        asked = allowed[rows], independent[rows], dhat[rows]
        counted = "line" if kind == "line" else "trimmed"
        required[rows] = fewest(counted, *asked)
        own = required[rows] if kind == counted else None
        if rest:
            own = rest[0][rows]
        elif own is None:
            own = fewest(kind, *asked)
        sound = (own > 0) & (own <= MOST_SITES)
        wanted[rows] = np.where(sound, own, 1)
        shortfall[rows] = np.where(sound, shortfalls(kind, wanted[rows], dhat[rows]), np.nan)
    known = (required > 0) & np.isfinite(shortfall)
    return _Closer(*(part.reshape(shape) for part in (wanted, required, shortfall, known)))


def _allowed(vhat: float | str) -> float:
    """1 - V̂ of a target."""
    return float(1 - exact_share(repr(vhat) if isinstance(vhat, float) else vhat, "vhat"))


class _Layout(NamedTuple):
    pattern: Sites
    legs: tuple[tuple[float, int], ...]


@lru_cache(maxsize=4096)
def _layout(grid: str, samples: int) -> _Layout:
    pattern = pattern_for(grid, min(samples, MOST_SITES))
    lengths: Counter[float] = Counter()
    for leg, count in path_of(pattern).legs:
        lengths[math.hypot(leg.x, leg.y)] += count
    return _Layout(pattern, tuple(lengths.items()))


def _layouts(wanted: NDArray[Any], grid: NDArray[Any]) -> dict[str, Any]:
    """Shape of each scenario's grid, and the legs of its path, by distinct pairs."""
    kinds, kind_places = np.unique(grid.astype(str), return_inverse=True)
    counts, count_places = np.unique(wanted, return_inverse=True)
    pairs, places = np.unique(
        kind_places.reshape(grid.shape) * len(counts) + count_places.reshape(wanted.shape),
        return_inverse=True,
    )
    layouts = [
        _layout(str(kinds[pair // len(counts)]), int(counts[pair % len(counts)]))
        for pair in pairs.tolist()
    ]
    shape = np.broadcast_shapes(grid.shape, wanted.shape)

    def column(function: Callable[[Sites], float], dtype: Any) -> NDArray[Any]:
        table = np.array([function(layout.pattern) for layout in layouts], dtype=dtype)
        return np.asarray(table[places]).reshape(shape)

    return {
        "samples": column(lambda pattern: pattern.samples, np.int64),
        "rows": column(lambda pattern: pattern.rows, np.int64),
        "columns": column(lambda pattern: pattern.columns, np.int64),
        "x": column(lambda pattern: pattern.extent[0], np.float64),
        "y": column(lambda pattern: pattern.extent[1], np.float64),
        "legs": [layout.legs for layout in layouts],
        "places": places.reshape(shape),
    }


def _flight(layout: dict[str, Any], baseline: Any, timing: tuple[Any, Any, Any]) -> tuple[Any, Any]:
    """Length of each path, and its time with a stop at every site."""
    legs, places = layout["legs"], layout["places"]
    most = max(map(len, legs))
    table = np.zeros((2, most, len(legs)))
    for column, found in enumerate(legs):
        if found:
            table[:, : len(found), column] = np.transpose(found)
    speed, acceleration, hold = timing
    length, time = 0.0, layout["samples"] * hold
    for kind in range(most):
        leg = table[0, kind][places] * baseline
        count = table[1, kind][places]
        length = length + leg * count
        slow = 2.0 * np.sqrt(leg / acceleration)
        fast = leg / speed + speed / acceleration
        time = time + np.where(leg >= speed**2 / acceleration, fast, slow) * count
    return length, time
