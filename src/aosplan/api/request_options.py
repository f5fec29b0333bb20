"""Keyword arguments of the functions that make plans, for type checkers and editors."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypedDict

if TYPE_CHECKING:
    import os

    from aosplan.api.scenes import Stand


class RequestOptions(TypedDict, total=False):
    """Options of ``aosplan plan`` with underscores; `aosplan.PlanRequest` has the same fields."""

    altitude: float | str | None
    gsd: float | None
    target_size: float | None
    target_pixels: float | None
    focal_height: float
    vhat: float | str | None
    visibility: float | str | None
    find: str | None
    signature: str | None
    contrast: float | None
    canopy_offset: float | None
    crown_share: float | None
    false_alarms: float | None
    scene: str | os.PathLike[str] | Stand | None
    density: float | None
    integrated_density: float | None
    occluder_size: float | None
    volume_height: float | None
    volume_base: float | None
    stems_per_hectare: float | None
    crown_diameter: float | None
    leaf_area_index: float | None
    voxel: float | None
    ground: str | None
    min_height: float | None
    units: str | None
    crop: str | os.PathLike[str] | None
    opacity: str | None
    leaf_size: float | None
    trajectory: str | os.PathLike[str] | None
    crown_base: float | None
    camera: str | os.PathLike[str] | None
    focal_length: float | None
    sensor_width: float | None
    sensor_height: float | None
    fov: float | None
    image_width: int | None
    image_height: int | None
    coverage: float
    model: str | None
    view: str | None
    edges: str | None
    rays: str | None
    optimize: str
    within: float | None
    max_aperture: float | None
    max_samples: int | None
    baseline: float | None
    samples: int | None
    allow_no_common_ground: bool
    sensitivity: bool
    grid: str
    lanes: int | str | None
    lane_pitch: float | str | None
    origin: tuple[float, float] | None
    heading: float | str
    line_length: float | None
    area: str | os.PathLike[str] | None
    around: str | os.PathLike[str] | None
    around_radius: float | None
    clear: str | os.PathLike[str] | None
    no_fly: str | os.PathLike[str] | None
    buffer: float | None
    order: str | None
    poa: str | os.PathLike[str] | None
    max_sites: int | None
    drone: str | os.PathLike[str] | None
    speed: float | None
    transit_speed: float | None
    acceleration: float | None
    climb: float | None
    hold: float
    hold_error: float
    autopilot: str | None
    camera_control: str | None
    payload: str | None
    trigger: str
    max_blur: float | None
    exposure_time: float | None
    photo_interval: float | None
    wind_speed: float | None
    wind_from: float | None
    airspeed: float | None
    takeoff: tuple[float, float] | None
    flight_time: float | None
    file_waypoints: int | None
    resume_at: int | None
    clearance: float
    terrain: str | os.PathLike[str] | None
    terrain_units: str | None
    terrain_tolerance: float | None
    altitude_frame: str
