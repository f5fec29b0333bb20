"""The inputs of a plan: resolves the names, files and defaults of a request.

`resolve_inputs` returns a frozen value, `PlanInputs`.  All later stages use this value and do not
read the request.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from aosplan.camera.camera import Camera
from aosplan.camera.presets import find_camera
from aosplan.errors import RequestError
from aosplan.files import located
from aosplan.models.signatures import SIGNATURES, Signature
from aosplan.planning.loaded_scene import load_scene
from aosplan.planning.option_parsers import target_m
from aosplan.planning.options import DEFAULTS, GUIDED
from aosplan.planning.route import FlightInputs, Wind, speed_bounds
from aosplan.solver import refusals
from aosplan.solver.problem import Bounds, CommonGround, GridKind, Requirement
from aosplan.solver.solve import kinds
from aosplan.units import exact_share, rounded_up

if TYPE_CHECKING:
    from collections.abc import Callable

    from aosplan.areas.area import Area
    from aosplan.planning.loaded_scene import LoadedScene, Progress
    from aosplan.planning.request import PlanRequest
    from aosplan.scenes.files.crop import Crop

    T = TypeVar("T")

MODEL_OF = {"uniform": "uniform", "layered": "layered", "cloud": "measured"}
"""The default model for each kind of scene."""


class FindInputs(NamedTuple):
    """The target that ``--find`` names, and the parameters of its detection.

    Attributes
    ----------
    name
        The value of the option.
    size_m
        Width and length of the target.
    signature
        Radiances of the target and of the canopy.
    assumed
        Name of an assumed signature; empty if the request gives the numbers of the signature.
    false_alarms
        False alarms per hectare.
    """

    name: str
    size_m: tuple[float, float]
    signature: Signature
    assumed: str
    false_alarms: float


class PlanInputs(NamedTuple):
    """A request with resolved names, files and defaults.  It contains everything that the stages of
    a plan need.

    Attributes
    ----------
    request
        The request for documents, including the values that its area and its scene determine.
    scene_name
        Name of the scene in the request.  If the request describes the scene by numbers, it is the
        name of the scene itself.
    loaded
        The scene and the other content of its file, with heights above ground.
    camera
        The camera.
    altitude_m
        Altitude above the focal plane.
    focal_height_m
        Height of the focal plane above ground.
    model, view, rays
        The visibility model, its view, and its kind of rays. View or rays are None if the model
        does not have them.
    edges
        Targets that the measured model counts.
    coverage
        Share of the occluders that must have d̂ >= 1.
    hold_error_m
        Standard deviation, per axis, of the position at each site.
    requirement
        The target visibility.
    find
        The target whose probability of detection is computed, or None.
    bounds
        Bounds on baseline and samples.
    objective
        The quantity that is minimised or maximised.
    grids
        Kinds of grid to compare; only one if the request names one.
    heading_deg
        Direction of the flight lines, clockwise from true north.
    compares_headings
        Whether the best heading is searched for, and `heading_deg` is ignored.
    origin
        Latitude and longitude of the middle of the grid; None if the plan has no location or covers
        an area.
    line_length_m
        Length of a continuous line; None for one grid.
    line_pitch
        Distance between lines over an area in baselines, if the request gives it.
    area
        The area to cover, and its no-fly zones; None for one grid.
    max_sites
        Largest number of sites over an area.  Areas that need more sites are refused.
    within_min
        Longest time from take-off to landing, for guided positions; None if it was not given.
    around_radius_m
        Radius of the target area around the origin, for guided positions and reciprocal maps.
    wants_sensitivity
        Whether the effect of a different scene on the plan is computed.
    flight
        Settings of the flight.
    folder
        Folder in which the files of the request are looked for before the current folder.
    """

    request: PlanRequest
    scene_name: str
    loaded: LoadedScene
    camera: Camera
    altitude_m: float
    focal_height_m: float
    model: str
    view: str | None
    rays: str | None
    edges: str
    coverage: float
    hold_error_m: float
    requirement: Requirement
    find: FindInputs | None
    bounds: Bounds
    objective: str
    grids: tuple[GridKind, ...]
    heading_deg: float
    compares_headings: bool
    origin: tuple[float, float] | None
    line_length_m: float | None
    line_pitch: float | None
    area: Area | None
    max_sites: int
    within_min: float | None
    around_radius_m: float
    wants_sensitivity: bool
    flight: FlightInputs
    folder: str

    @property
    def footprint_m(self) -> tuple[float, float]:
        """Size of an image in the focal plane, along and across the heading."""
        return self.camera.footprint_m(self.altitude_m)

    @property
    def is_line(self) -> bool:
        """Whether the request asks for a single line."""
        return [kind.name for kind in self.grids] == ["line"]

    @property
    def is_guided(self) -> bool:
        """Whether the positions are chosen for one place."""
        return [kind.name for kind in self.grids] == [GUIDED]

    def at_heading(self, heading_deg: float) -> PlanInputs:
        """The same inputs with a fixed heading."""
        return self._replace(heading_deg=heading_deg, compares_headings=False)


def resolve_inputs(
    request: PlanRequest,
    *,
    folder: str = "",
    load: Callable[[PlanRequest], LoadedScene] | None = None,
    progress: Progress | None = None,
) -> PlanInputs:
    """Resolve the names, files and defaults of a request.

    Parameters
    ----------
    request
        The request.
    folder
        Folder in which the files of the request are looked for before the current folder.
    load
        Function that returns the scene of a request, if the caller has read the scene before.  It
        replaces `aosplan.planning.loaded_scene.load_scene`.
    progress
        Function that is called with the number of points read and the total, while a point cloud is
        read.

    Raises
    ------
    RequestError
        If a name is unknown, if a file cannot be read, or if values contradict each other.
    """
    camera = camera_of(request, folder=folder)
    altitude_m = altitude_of(request, camera)
    area = _area_of(request, folder)
    heading = request.heading
    if heading == "auto" and area is not None:
        from aosplan.areas.area import long_side_deg

        heading = long_side_deg(area.whole)
        request = request.filled({"heading": heading})

    def surroundings() -> Crop | None:
        from aosplan.planning.cloud_crop import crop_of_plan

        return crop_of_plan(request, area, camera.footprint_m(altitude_m))

    loaded = (
        load(request)
        if load
        else load_scene(request, folder=folder, progress=progress, surroundings=surroundings)
    )
    model = request.model or MODEL_OF[loaded.kind]
    _check_model(model, loaded.kind, request)
    if loaded.scene.integrated_density > 0.0:
        _check_altitude(loaded, altitude_m, request)
    measured = model == "measured"
    guided = request.grid == GUIDED
    usual = "perspective" if guided else "telecentric"
    view = (request.view or usual) if measured else request.view
    rays = request.rays if measured else (request.rays or "nadir")
    edges = request.edges or ("interior" if guided else "auto")
    decided: dict[str, Any] = {"model": model, "view": view, "rays": rays}
    if measured:
        decided["edges"] = edges
    return PlanInputs(
        request=request.filled(decided | dict(loaded.reading)),
        scene_name=loaded.scene.name if request.scene is None else request.scene,
        loaded=loaded,
        camera=camera,
        altitude_m=altitude_m,
        focal_height_m=request.focal_height,
        model=model,
        view=view,
        rays=rays,
        edges=edges,
        coverage=request.coverage,
        hold_error_m=request.hold_error,
        requirement=_requirement_of(request),
        find=_find_of(request),
        bounds=Bounds(
            max_aperture_m=request.max_aperture,
            max_samples=request.max_samples,
            baseline_m=request.baseline,
            samples=request.samples,
            ground=_common_ground(request, camera, altitude_m, over_area=area is not None),
        ),
        objective=request.optimize,
        grids=kinds(
            request.grid,
            request.lanes,
            request.lane_pitch,
            spirals=request.trigger == "stop" and area is None,
        ),
        heading_deg=request.heading_deg,
        compares_headings=heading == "best",
        origin=request.origin,
        line_length_m=request.line_length,
        line_pitch=request.lane_pitch if isinstance(request.lane_pitch, float) else None,
        area=area,
        max_sites=request.max_sites or 0,
        within_min=request.within,
        around_radius_m=request.around_radius or DEFAULTS["around_radius"],
        wants_sensitivity=request.sensitivity,
        flight=flight_of(request, camera.gsd_m(altitude_m), folder),
        folder=folder,
    )


def _filled(value: T | None) -> T:
    """The value of a field that is never None, because `PlanRequest` has set it or checked it."""
    assert value is not None
    return value


def camera_of(request: PlanRequest, *, folder: str = "") -> Camera:
    """The camera of a request: a preset, a file (looked for in `folder` first), or numbers."""
    if request.camera is not None:
        return find_camera(request.camera, folder)
    width, height = _filled(request.image_width), _filled(request.image_height)
    if request.fov is not None:
        return Camera.from_field_of_view(request.fov, width, height)
    sensor_width = _filled(request.sensor_width)
    sensor_height = request.sensor_height or sensor_width * height / width
    focal_length = _filled(request.focal_length)
    return Camera("custom", focal_length, sensor_width, sensor_height, width, height)


def altitude_of(request: PlanRequest, camera: Camera) -> float:
    """Altitude above the focal plane [m].  It is given, or computed from the requested
    resolution.
    """
    if request.altitude is not None:
        # If the request gives a range, a search has chosen a value.
        assert isinstance(request.altitude, float)
        return request.altitude
    if request.gsd is not None:
        return camera.altitude_for_gsd_m(request.gsd)
    gsd_m = _filled(request.target_size) / _filled(request.target_pixels)
    return camera.altitude_for_gsd_m(gsd_m)


def _area_of(request: PlanRequest, folder: str) -> Area | None:
    """The area of a request, or None.  The files of the area are looked for in `folder` first."""
    path = request.area or request.around
    if path is None:
        return None
    from aosplan.areas.area import read_area

    return read_area(
        located(path, folder),
        around_m=None if request.around is None else _filled(request.around_radius),
        clear=request.clear and located(request.clear, folder),
        no_fly=request.no_fly and located(request.no_fly, folder),
        buffer_m=request.buffer or 0.0,
    )


def _common_ground(
    request: PlanRequest, camera: Camera, altitude_m: float, *, over_area: bool
) -> CommonGround | None:
    """The ground that all samples have to see; None if the request allows grids without common
    ground.
    """
    if request.allow_no_common_ground:
        return None
    footprint = camera.footprint_m(altitude_m)
    target = 0.0 if request.find is None or over_area else max(target_m(request.find))
    wanted = max(target, camera.gsd_m(altitude_m))
    # If an image is smaller than the target, or has a single pixel, the common ground has to be
    # half as large as the image.
    along, across = (min(wanted, 0.5 * size) for size in footprint)
    return CommonGround(footprint, (0.0, 0.0) if over_area else (along, across), over_area)


def _requirement_of(request: PlanRequest) -> Requirement:
    if request.visibility is not None:
        return Requirement("visibility", exact_share(request.visibility, "--visibility"))
    vhat = _filled(request.vhat)
    # `repr` gives the shortest decimal number that is converted to this float. The user has usually
    # written this number.
    return Requirement(
        "normalized", exact_share(vhat if isinstance(vhat, str) else repr(vhat), "--vhat")
    )


def _find_of(request: PlanRequest) -> FindInputs | None:
    if request.find is None:
        return None
    if request.signature is not None:
        signature, assumed = SIGNATURES[request.signature], request.signature
    else:
        numbers = request.contrast, request.canopy_offset, request.crown_share
        signature, assumed = Signature(*map(_filled, numbers)), ""
    return FindInputs(
        request.find, target_m(request.find), signature, assumed, _filled(request.false_alarms)
    )


def flight_of(request: PlanRequest, gsd_m: float, folder: str) -> FlightInputs:
    """Settings of the flight of a request. `gsd_m` is the ground sampling distance."""
    drone = None
    if request.drone is not None:
        from aosplan.flight.find import find_drone

        drone = find_drone(request.drone)
    wind = None
    if request.wind_speed:
        wind = Wind(request.wind_speed, _filled(request.wind_from), _filled(request.airspeed))
    blur = None
    if request.trigger == "distance":
        blur = _filled(request.max_blur), _filled(request.exposure_time)
    return FlightInputs(
        trigger=request.trigger,
        speed_mps=_filled(request.speed),
        speed_bounds=speed_bounds(drone, blur, gsd_m),
        transit_mps=min(_filled(request.transit_speed), drone.airspeed_mps if drone else math.inf),
        acceleration_mps2=_filled(request.acceleration),
        climb_mps=_filled(request.climb),
        hold_s=request.hold,
        photo_interval_s=request.photo_interval,
        wind=wind,
        takeoff=request.takeoff,
        flight_time_min=request.flight_time,
        file_waypoints=request.file_waypoints,
        resume_at=request.resume_at,
        clearance_m=request.clearance,
        terrain=None if request.terrain is None else located(request.terrain, folder),
        terrain_units=request.terrain_units,
        terrain_tolerance_m=request.terrain_tolerance or 0.0,
        altitude_frame=request.altitude_frame,
        autopilot=request.autopilot,
        camera_control=request.camera_control,
        payload=request.payload,
        drone_name=request.drone,
        drone=drone,
    )


def _check_altitude(loaded: LoadedScene, altitude_m: float, request: PlanRequest) -> None:
    """Refuse an altitude within the canopy or within the clearance above it."""
    top = loaded.scene.canopy_top_m - request.focal_height
    lowest = top + request.clearance
    if altitude_m > top and altitude_m >= lowest:
        return
    given = request.altitude is not None
    remedy = (
        f"fly {rounded_up(lowest)} m or higher, which is {request.clearance:g} m above the canopy "
        f"({top:.6g} m)"
    )
    outliers = next((said for code, said in loaded.warnings if code == "points_far_above"), None)
    if outliers is not None:
        remedy = outliers
    if altitude_m <= top:
        raise RequestError(
            refusals.within_canopy(altitude_m, top, given=given),
            remedy if request.clearance or outliers else f"fly higher than {top:.6g} m",
        )
    raise RequestError(
        refusals.below_clearance(altitude_m, top, request.clearance, given=given),
        f"{remedy}; or give a smaller --clearance",
    )


def _check_model(name: str, kind: str, request: PlanRequest) -> None:
    if name == "measured" and kind != "cloud":
        raise RequestError(
            "--model measured needs the voxels of a point cloud",
            "give a point cloud or a file that aosplan scene --save wrote, or give another --model",
        )
    if request.edges is not None and name != "measured":
        raise RequestError(
            f"--edges {request.edges} cannot be used with the {name} model",
            "leave it out, or give --model measured",
        )
    if request.view is not None and name != "measured":
        raise RequestError(
            f"--view {request.view} cannot be used with the {name} model",
            "leave it out, or give --model measured",
        )
    if request.rays is not None and name == "measured":
        raise RequestError(
            f"--rays {request.rays} cannot be used with the measured model",
            "leave --rays out, because the measured model traces the real rays",
        )
