"""The aircraft of a request: autopilot, camera trigger and payload, checked against each other.

The rules are those of the autopilots' own sources: PX4's MavlinkMissionManager takes no terrain
frame; PX4 and ArduCopter fly through a waypoint whose hold is zero; ArduPilot stores whole seconds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from aosplan.errors import RequestError
from aosplan.mission.mission import check_hold

if TYPE_CHECKING:
    from typing import Protocol

    class _Aircraft(Protocol):
        """The options of a request that this module reads."""

        @property
        def drone(self) -> str | None: ...
        @property
        def autopilot(self) -> str | None: ...
        @property
        def camera(self) -> str | None: ...
        @property
        def camera_control(self) -> str | None: ...
        @property
        def payload(self) -> str | None: ...
        @property
        def trigger(self) -> str: ...
        @property
        def hold(self) -> float: ...
        @property
        def altitude_frame(self) -> str: ...


WIRED = ("aos-", "flir-", "gopro-", "sony-")
"""Cameras that autopilots trigger by their own outputs, by the first letters of their presets."""


def settled(request: _Aircraft) -> dict[str, Any]:
    """The options that the drone and the camera decide, where they were not given.

    Raises
    ------
    RequestError
        If the drone, the autopilot, the camera or the payload contradict each other.
    """
    found: dict[str, Any] = {}
    autopilot = request.autopilot
    if request.drone is not None:
        from aosplan.flight.find import find_drone

        own = find_drone(request.drone).autopilot
        if autopilot not in (None, own):
            raise RequestError(
                f"--autopilot {autopilot} contradicts --drone {request.drone}, which "
                f"{_titled(own)} flies",
                "leave --autopilot out, or give another --drone",
            )
        if own in ("px4", "ardupilot"):
            autopilot = found["autopilot"] = own
    if autopilot == "px4":
        found["camera_control"] = request.camera_control or (
            "outputs" if (request.camera or "").startswith(WIRED) else "mavlink"
        )
        if request.altitude_frame == "terrain":
            raise RequestError(
                "--altitude-frame terrain with PX4, which refuses missions with heights above terrain",
                "give --altitude-frame takeoff, with --terrain DEM.tif for ground that is not level",
            )
    elif request.camera_control is not None:
        raise RequestError(
            f"--camera-control {request.camera_control} without PX4",
            "give --autopilot px4, or leave it out: the other autopilots decide it by their settings",
        )
    if request.trigger == "stop":
        check_hold(autopilot, request.hold)
    _check_payload(request)
    return found


def camera_of_payload(payload: str) -> str | None:
    """The preset of a payload's camera: the thermal one, or its wide one; None if there is none."""
    from aosplan.camera.presets import CAMERAS

    named = (f"{payload}-{kind}" for kind in ("thermal", "wide"))
    return next((name for name in named if name in CAMERAS), None)


def _check_payload(request: _Aircraft) -> None:
    """Refuse a payload of DJI's beside a camera of another payload of DJI's."""
    camera, payload = request.camera or "", request.payload
    if payload is not None and camera.startswith("dji-") and not fits(camera, payload):
        raise RequestError(
            f"--payload {payload} contradicts --camera {camera}, the camera of another payload",
            f"give a --camera of {payload}, or leave --payload out",
        )


def fits(camera: str, payload: str) -> bool:
    """Whether a camera's preset is one of a payload's; wide cameras are the same without thermal."""
    built_in = "-".join(camera.split("-")[:2])
    return built_in == payload or (camera.endswith("-wide") and built_in == f"{payload}t")


def _titled(autopilot: str) -> str:
    names = {"px4": "PX4", "ardupilot": "ArduPilot", "dji": "DJI's own autopilot"}
    return names.get(autopilot, f"{autopilot.title()}'s own autopilot")
