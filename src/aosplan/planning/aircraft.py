"""The aircraft of a request: drone, autopilot, camera trigger and payload, and the options that
they determine.

The limits of autopilots are taken from their sources.  PX4's MavlinkMissionManager rejects terrain
frames.  PX4 and ArduCopter fly through a waypoint whose hold is zero.  ArduPilot stores holds in
whole seconds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from aosplan.errors import RequestError
from aosplan.files import located
from aosplan.mission.mission import check_hold

if TYPE_CHECKING:
    from collections.abc import Mapping

    from aosplan.flight.drones import DronePreset

WIRED = ("aos-", "flir-", "gopro-", "sony-")
"""First letters of the names of camera presets that autopilots trigger by their own outputs."""


def with_drone_file(values: Mapping[str, Any], folder: str) -> dict[str, Any]:
    """The options, in which the name of a drone file is replaced by its full path.  The file is
    looked for in `folder` first.

    The path is needed because a request reads its drone before it knows the folder of its other
    files.
    """
    drone = values.get("drone")
    return {**values, "drone": located(drone, folder)} if isinstance(drone, str) else {**values}


def decided_by_aircraft(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values from the drone, its payload and its autopilot, for options that are not given.

    Raises
    ------
    RequestError
        If there is no such drone, if no camera is known for it, or if the options contradict each
        other.
    """
    brought = _brought_by_drone(values)
    return brought | _decided_by_autopilot({**values, **brought})


def _brought_by_drone(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values from the drone and its payload (camera, speeds and limits), for options that are not
    given.
    """
    drone = _drone_of(values)
    payload = values["payload"]
    carried = payload and camera_of_payload(payload)
    if drone is None:
        found: dict[str, Any] = {"camera": carried}
    else:
        from aosplan.flight.drones import trusted_min

        found = {
            "speed": drone.speed_mps,
            "transit_speed": drone.speed_mps,
            "acceleration": drone.acceleration_mps2,
            "climb": drone.climb_mps,
            "airspeed": drone.airspeed_mps,
            "photo_interval": drone.photo_interval_s,
            "flight_time": trusted_min(drone),
            "camera": carried if payload else drone.camera,
        }
    if values["focal_length"] is not None or values["fov"] is not None:
        found["camera"] = None
    elif (drone or payload) is not None and (values["camera"] or found["camera"]) is None:
        carrier = f"payload {payload}" if payload else f"drone {values['drone']}"
        raise RequestError(
            f"the camera of the {carrier} is not known",
            "give --camera NAME or FILE (aosplan cameras lists the presets), or give --fov "
            "DEG or --focal-length MM together with the size of the image",
        )
    return {name: value for name, value in found.items() if values[name] is None}


def _decided_by_autopilot(values: Mapping[str, Any]) -> dict[str, Any]:
    """The autopilot of the drone, and how it controls the camera."""
    found: dict[str, Any] = {}
    autopilot, control = values["autopilot"], values["camera_control"]
    drone = _drone_of(values)
    if drone is not None:
        if autopilot not in (None, drone.autopilot):
            raise RequestError(
                f"--autopilot {autopilot} contradicts --drone {values['drone']}, which "
                f"{_titled(drone.autopilot)} flies",
                "leave --autopilot out, or give another --drone",
            )
        if drone.autopilot in ("px4", "ardupilot"):
            autopilot = found["autopilot"] = drone.autopilot
    if autopilot == "px4":
        found["camera_control"] = control or (
            "outputs" if (values["camera"] or "").startswith(WIRED) else "mavlink"
        )
        if values["altitude_frame"] == "terrain":
            raise RequestError(
                "--altitude-frame terrain cannot be used with PX4, because PX4 does not accept heights "
                "above terrain",
                "give --altitude-frame takeoff, with --terrain DEM.tif on sloping ground",
            )
    elif control is not None:
        raise RequestError(
            f"--camera-control {control} can be used only with PX4",
            "give --autopilot px4, or leave --camera-control out, because other autopilots "
            "use their own parameters",
        )
    if values["trigger"] == "stop":
        check_hold(autopilot, values["hold"])
    if values["payload"] is not None:
        _check_payload(values["payload"], values["drone"], autopilot, values["camera"] or "")
    return found


def _drone_of(values: Mapping[str, Any]) -> DronePreset | None:
    if values["drone"] is None:
        return None
    from aosplan.flight.find import find_drone

    return find_drone(values["drone"])


def camera_of_payload(payload: str) -> str | None:
    """The preset of a payload's camera: the thermal camera, or else the wide camera; None if there
    is no such preset.
    """
    from aosplan.camera.presets import CAMERAS

    # A payload without a thermal camera has the same wide camera as the variant with a thermal
    # camera.
    named = (f"{payload}-thermal", f"{payload}-wide", f"{payload}t-wide")
    return next((name for name in named if name in CAMERAS), None)


def _check_payload(payload: str, drone: str | None, autopilot: str | None, camera: str) -> None:
    """Refuse a DJI payload if the drone cannot carry it, or if the camera belongs to another
    payload.
    """
    if drone is not None:
        from aosplan.mission.dji_models import check_carried

        check_carried(drone, payload)
    elif autopilot not in (None, "dji"):
        raise RequestError(
            f"--payload {payload} cannot be used with --autopilot {autopilot}, because only "
            "drones of DJI carry this payload",
            "leave --payload out, and give --camera NAME",
        )
    if camera.startswith("dji-") and not camera_fits_payload(camera, payload):
        raise RequestError(
            f"--payload {payload} contradicts --camera {camera}, the camera of another payload",
            f"give a --camera of {payload}, or leave --payload out",
        )


def camera_fits_payload(camera: str, payload: str) -> bool:
    """Whether a camera's preset is one of a payload's cameras.  Variants with and without a thermal
    camera have the same wide camera.
    """
    built_in = "-".join(camera.split("-")[:2])
    return built_in == payload or (camera.endswith("-wide") and built_in == f"{payload}t")


def _titled(autopilot: str) -> str:
    names = {"px4": "PX4", "ardupilot": "ArduPilot", "dji": "DJI's own autopilot"}
    return names.get(autopilot, f"{autopilot.title()}'s own autopilot")
