"""DJI WPML: a ``.kmz`` for DJI Pilot 2 and FlightHub 2.

Elements, their order and their values follow DJI's Cloud API documentation (DJI WPML:
template.kml, waylines.wpml, common elements).
"""

from __future__ import annotations

import io
from functools import lru_cache
from itertools import islice
from operator import itemgetter
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from aosplan.errors import RequestError
from aosplan.mission.dji_models import DRONES, PAYLOADS, check_carried
from aosplan.mission.flown_path import flown_path
from aosplan.mission.format import Format, Limits
from aosplan.xml_text import xml_text

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from aosplan.mission.dji_models import DjiDrone
    from aosplan.mission.flown_path import PathPoint
    from aosplan.mission.mission import FlightSettings, Mission

_Value = TypeVar("_Value")

FORMAT = Format(
    "kmz",
    (".kmz",),
    "DJI WPML",
    needs_place=True,
    altitudes="take-off",
    limits=(
        Limits(
            "dji-pilot-2",
            waypoints=(2, 65_535),
            leg_m=(0.5, 2000.0),
            speed_mps=(0.1, 15.0),
            height_m=(None, 1500.0),
            source=(
                "indices and takeOffSecurityHeight: the specification; speeds and legs: "
                "DJI's Mobile SDK 4, because the specification does not limit them"
            ),
        ),
    ),
    flown_by=("dji",),
)

_STOP = (
    "<wpml:waypointTurnMode>toPointAndStopWithDiscontinuityCurvature</wpml:waypointTurnMode>"
    "<wpml:waypointTurnDampingDist>0</wpml:waypointTurnDampingDist>"
)
_THROUGH = (
    "<wpml:waypointTurnMode>toPointAndPassWithContinuityCurvature</wpml:waypointTurnMode>"
    # The damping distance is chosen so that the curves at both ends of the shortest leg fit into
    # it.
    "<wpml:waypointTurnDampingDist>0.2</wpml:waypointTurnDampingDist>"
)


class Machine(NamedTuple):
    """A drone: its name, its numbers, and the camera that it carries if the files name a camera."""

    name: str
    drone: DjiDrone
    payload: int | None = None
    carries: str = ""


class Dialect(NamedTuple):
    """The differences between the files of another application and the files of DJI Pilot 2.

    `machine` is a function that finds the drone of a mission.  If `fly` is true, the files are for
    DJI Fly.  Those files name neither camera nor lens, have the waypoints only in
    ``waylines.wpml``, and give 0 as total distance and duration.
    """

    namespace: str
    machine: Callable[[Mission], Machine]
    fly: bool = False


def render(mission: Mission, dialect: Dialect | None = None) -> bytes:
    """A zip of ``wpmz/template.kml`` and ``wpmz/waylines.wpml`` with constant timestamps.

    Raises
    ------
    RequestError
        If the drone or its payload is not known.
    """
    import zipfile

    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, pieces in documents(mission, dialect or PILOT).items():
            member = zipfile.ZipInfo(f"wpmz/{name}", date_time=(1980, 1, 1, 0, 0, 0))
            member.compress_type = zipfile.ZIP_DEFLATED
            member.create_system = 3
            member.external_attr = 0o644 << 16
            with archive.open(member, "w") as file:
                while some := "".join(islice(pieces, 1000)):
                    file.write(some.encode())
    return buffer.getvalue()


def documents(mission: Mission, dialect: Dialect) -> dict[str, Iterator[str]]:
    """The two documents by name, each in chunks. The application reads one of them, and the drone
    flies according to the other.
    """
    settings = mission.settings
    speed, path = f"{settings.speed_mps:.4f}", flown_path(mission)
    machine = dialect.machine(mission)
    config = _config(mission, machine)
    name = machine.name
    turn = "toPointAndStopWithDiscontinuityCurvature"
    heading = _heading(settings.yaw_deg, fly=dialect.fly)
    totals = f"{_wrap('distance', 0)}{_wrap('duration', 0)}\n" if dialect.fly else ""
    payload = "" if machine.payload is None else _payload(mission, machine)
    template = f"""
{_wrap("author", "aosplan")}
{config}
<Folder>
<name>{xml_text(mission.title)}, for {name}, altitudes above the take-off</name>
<wpml:templateType>waypoint</wpml:templateType>
<wpml:templateId>0</wpml:templateId>
<wpml:waylineCoordinateSysParam>
<wpml:coordinateMode>WGS84</wpml:coordinateMode>
<wpml:heightMode>relativeToStartPoint</wpml:heightMode>
</wpml:waylineCoordinateSysParam>
<wpml:autoFlightSpeed>{speed}</wpml:autoFlightSpeed>
<wpml:globalHeight>{path[0].height_m:.4f}</wpml:globalHeight>
<wpml:gimbalPitchMode>usePointSetting</wpml:gimbalPitchMode>
{_wrap("globalWaypointHeadingParam", heading)}
<wpml:globalWaypointTurnMode>{turn}</wpml:globalWaypointTurnMode>
<wpml:globalUseStraightLine>1</wpml:globalUseStraightLine>
{payload}"""
    waylines = f"""
{config}
<Folder>
<wpml:templateId>0</wpml:templateId>
<wpml:executeHeightMode>relativeToStartPoint</wpml:executeHeightMode>
<wpml:waylineId>0</wpml:waylineId>
{totals}<wpml:autoFlightSpeed>{speed}</wpml:autoFlightSpeed>
"""
    pitch = f"<wpml:gimbalPitchAngle>{settings.gimbal_pitch_deg:g}</wpml:gimbalPitchAngle>\n"
    shown = (
        "<wpml:ellipsoidHeight>HEIGHT</wpml:ellipsoidHeight><wpml:height>HEIGHT</wpml:height>\n"
        "<wpml:useGlobalHeight>0</wpml:useGlobalHeight>"
        "<wpml:useGlobalSpeed>0</wpml:useGlobalSpeed><wpml:waypointSpeed>SPEED</wpml:waypointSpeed>"
        "<wpml:useGlobalHeadingParam>0</wpml:useGlobalHeadingParam>"
        f"<wpml:useGlobalTurnParam>0</wpml:useGlobalTurnParam>\n{pitch}"
    )
    flown = (
        "<wpml:executeHeight>HEIGHT</wpml:executeHeight>"
        "<wpml:waypointSpeed>SPEED</wpml:waypointSpeed>\n"
    )
    aim = _gimbal(settings.gimbal_pitch_deg, "aircraft" if dialect.fly else "north")
    if dialect.fly:
        shoot = _action("takePhoto", _wrap("payloadPositionIndex", 0))
    else:
        shoot = _take_photo(_lens(mission, machine))
    sites = iter(()) if dialect.fly else _placemarks(mission, path, heading, shown, (aim, shoot))
    return {
        "template.kml": _kml(dialect.namespace, template, sites),
        "waylines.wpml": _kml(
            dialect.namespace, waylines, _placemarks(mission, path, heading, flown, (aim, shoot))
        ),
    }


def _kml(namespace: str, head: str, placemarks: Iterator[str]) -> Iterator[str]:
    yield (
        '<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2" '
        f'xmlns:wpml="{namespace}">\n<Document>{head}'
    )
    yield from placemarks
    yield "</Folder>\n</Document>\n</kml>\n"


def _wrap(name: str, *inner: object) -> str:
    return f"<wpml:{name}>{''.join(map(str, inner))}</wpml:{name}>"


def _payload(mission: Mission, machine: Machine) -> str:
    return f"""<wpml:payloadParam>
<wpml:payloadPositionIndex>0</wpml:payloadPositionIndex>
<wpml:imageFormat>{_lens(mission, machine)}</wpml:imageFormat>
</wpml:payloadParam>
"""


def _config(mission: Mission, machine: Machine) -> str:
    """The mission configuration: take-off, return, speeds, drone and payload."""
    settings = mission.settings
    _, drone, payload, _ = machine
    climb, back = f"{mission.climb_m():.4f}", f"{mission.return_m():.4f}"
    # The reference height is above the ellipsoid. If this height is not known, the optional element
    # is left out.
    reference = ""
    if _has_reference(settings):
        latitude, longitude = mission.home()
        place = f"{latitude:.10f},{longitude:.10f},{settings.takeoff_ground_m:.2f}"
        reference = _wrap("takeOffRefPoint", place) + "\n"
    carried = ""
    if payload is not None:
        numbers = (
            _wrap("payloadEnumValue", payload)
            + _wrap("payloadSubEnumValue", 0)
            + _wrap("payloadPositionIndex", 0)
        )
        carried = _wrap("payloadInfo", numbers) + "\n"
    return f"""<wpml:missionConfig>
<wpml:flyToWaylineMode>safely</wpml:flyToWaylineMode>
<wpml:finishAction>goHome</wpml:finishAction>
<wpml:exitOnRCLost>executeLostAction</wpml:exitOnRCLost>
<wpml:executeRCLostAction>goBack</wpml:executeRCLostAction>
<wpml:takeOffSecurityHeight>{climb}</wpml:takeOffSecurityHeight>
{reference}<wpml:globalTransitionalSpeed>{mission.transit_mps:.4f}</wpml:globalTransitionalSpeed>
<wpml:globalRTHHeight>{back}</wpml:globalRTHHeight>
<wpml:droneInfo>{_wrap("droneEnumValue", drone.number)}\
{_wrap("droneSubEnumValue", drone.variant)}</wpml:droneInfo>
{carried}</wpml:missionConfig>"""


def _has_reference(settings: FlightSettings) -> bool:
    """Whether the take-off point and its height above the ellipsoid are known."""
    known = None not in (settings.takeoff_latitude, settings.takeoff_ground_m)
    return known and settings.height_datum == "ellipsoid"


def reference_notes(missions: Sequence[Mission]) -> list[str]:
    """Assumptions of the files, one sentence each."""
    settings = missions[0].settings
    if not _has_reference(settings):
        return []
    return [
        f"the height of the take-off reference point is {settings.takeoff_ground_m:.1f} m above "
        "the ellipsoid, as in the terrain file; all other heights are above the take-off"
    ]


def notes(missions: Sequence[Mission]) -> list[str]:
    """Assumptions of files for DJI Pilot 2, one sentence each."""
    found = reference_notes(missions)
    drone = machine(missions[0])
    camera = _camera_name(missions[0])
    if missions[0].settings.drone is None:
        found.insert(
            0,
            f"no drone is given, so the file is for the {drone.name}, to which the camera "
            f"{camera} belongs; for another drone, give --drone NAME",
        )
    if not camera.startswith(drone.carries):
        found.append(
            f"the camera {camera} is not one of {drone.carries}, so the file stores the "
            f"photos of the drone's lens '{_lens(missions[0], drone)}'"
        )
    return found


def machine(mission: Mission) -> Machine:
    """The drone and its payload with their numbers in DJI Pilot 2.

    If the user does not name a drone or payload, the camera of the plan determines them.
    """
    settings = mission.settings
    maker, _, rest = _camera_name(mission).partition("-")
    built_in = f"{maker}-{rest.partition('-')[0]}"
    name = settings.drone or (built_in if built_in in DRONES else None)
    if name is None:
        raise RequestError(f"{FORMAT.title} needs a drone", f"give --drone {', '.join(DRONES)}")
    own = settings.mission_formats
    other = f"; {name} flies {' and '.join(own)}" if own else "; try litchi:grid.csv"
    drone = _known(name, DRONES, "drone", other)
    carried = built_in if built_in in PAYLOADS and built_in not in DRONES else None
    payload = settings.payload or drone.payload or carried
    if payload is None:
        raise RequestError(
            f"{FORMAT.title} needs the payload of the drone {name}",
            f"give --payload {', '.join(payload for payload in PAYLOADS if payload not in DRONES)}",
        )
    check_carried(name, payload)
    return Machine(name, drone, _known(payload, PAYLOADS, "payload", ""), payload)


PILOT = Dialect("http://www.dji.com/wpmz/1.0.2", machine)
"""Files for DJI Pilot 2 and FlightHub 2."""


def _known(name: str, known: Mapping[str, _Value], kind: str, other: str) -> _Value:
    if name not in known:
        raise RequestError(
            f"{FORMAT.title} has no code for the {kind} '{name}'",
            f"supported: {', '.join(known)}{other}",
        )
    return known[name]


def _camera_name(mission: Mission) -> str:
    camera = mission.summary.get("camera")
    return str(camera.get("name", "")) if isinstance(camera, dict) else ""


_ONE_COLOUR_TOKEN = {
    "dji-m3e",
    "dji-m3t",
    "dji-m3m",
    "dji-m4e",
    "dji-m4t",
    "dji-m4d",
    "dji-m4td",
}
"""Drones whose colour photos DJI Pilot 2 and FlightHub 2 store as ``visable`` (DJI's spelling)."""


def _lens(mission: Mission, machine: Machine) -> str:
    """Token of the lens whose photos are stored, as DJI's own files write it."""
    camera = _camera_name(mission)
    if camera.endswith("thermal"):
        return "ir"
    if camera.endswith("multispectral"):
        return "narrow_band"
    return "visable" if machine.carries in _ONE_COLOUR_TOKEN else "wide"


def _heading(yaw_deg: float, *, fly: bool) -> str:
    """Elements for a fixed yaw, which is a whole number of degrees from -180 to 180."""
    angle = round((yaw_deg + 180.0) % 360.0 - 180.0)
    return (
        "<wpml:waypointHeadingMode>smoothTransition</wpml:waypointHeadingMode>"
        f"<wpml:waypointHeadingAngle>{angle}</wpml:waypointHeadingAngle>"
        + (_wrap("waypointHeadingAngleEnable", 1) if fly else "")
        + "<wpml:waypointHeadingPathMode>followBadArc</wpml:waypointHeadingPathMode>"
    )


def _placemarks(
    mission: Mission, path: Sequence[PathPoint], heading: str, own: str, camera: tuple[str, str]
) -> Iterator[str]:
    """Placemarks of the waypoints.

    `own` has the elements that only one of the two documents contains, with placeholders for
    numbers.  `camera` has two actions: one tilts the camera, and one takes a photo.
    """
    groups = _actions(mission, path, *camera)
    for index, point in enumerate(path):
        alone = own.replace("HEIGHT", f"{point.height_m:.4f}").replace(
            "SPEED", f"{point.speed_mps:.4f}"
        )
        yield (
            f"<Placemark>\n<Point><coordinates>{point.longitude:.10f},{point.latitude:.10f}"
            f"</coordinates></Point>\n<wpml:index>{index}</wpml:index>\n{alone}"
            f"<wpml:waypointHeadingParam>{heading}</wpml:waypointHeadingParam>\n"
            f"<wpml:waypointTurnParam>{_STOP if point.stop else _THROUGH}"
            "</wpml:waypointTurnParam>\n<wpml:useStraightLine>1</wpml:useStraightLine>\n"
        )
        yield from (_group(*group) for group in groups.get(index, ()))
        yield "</Placemark>\n"


class ActionGroup(NamedTuple):
    """Actions that are executed at one waypoint, or by distance between two waypoints."""

    number: int
    first: int
    last: int
    spacing_m: float | None
    actions: tuple[str, ...]


def _actions(
    mission: Mission, path: Sequence[PathPoint], aim: str, shoot: str
) -> dict[int, list[ActionGroup]]:
    """Action groups by waypoint.  The gimbal is tilted at the first waypoint; photos are taken at
    waypoints or by distance.
    """
    settings = mission.settings
    hover: tuple[str, ...] = ()
    hold = f"{settings.hold_s:.3f}"
    if settings.trigger == "stop" and float(hold):
        hover = (_action("hover", _wrap("hoverTime", hold)),)
    wanted: list[tuple[int, int, float | None, tuple[str, ...]]] = []
    on = None
    for index, point in enumerate(path):
        here: tuple[str, ...] = (aim,) if index == 0 else ()
        if point.photo:
            here += (*hover, shoot)
        if here:
            wanted.append((index, index, None, here))
        if on is not None and point.switch is not None:
            wanted.append((on, index, settings.spacing_m, (shoot,)))
            on = None
        if point.switch:
            on = index
    groups: dict[int, list[ActionGroup]] = {}
    for number, group in enumerate(sorted(wanted, key=itemgetter(0, 1))):
        groups.setdefault(group[0], []).append(ActionGroup(number, *group))
    return groups


def _group(
    number: int, first: int, last: int, spacing_m: float | None, actions: tuple[str, ...]
) -> str:
    return (
        f"<wpml:actionGroup><wpml:actionGroupId>{number}</wpml:actionGroupId>"
        f"<wpml:actionGroupStartIndex>{first}</wpml:actionGroupStartIndex>"
        f"<wpml:actionGroupEndIndex>{last}</wpml:actionGroupEndIndex>{_work(spacing_m, actions)}"
    )


@lru_cache(maxsize=8)
def _work(spacing_m: float | None, actions: tuple[str, ...]) -> str:
    """Trigger and actions of a group.  The result is cached, because a mission has few kinds of
    groups.
    """
    trigger = _wrap("actionTriggerType", "reachPoint")
    if spacing_m is not None:
        trigger = _wrap("actionTriggerType", "multipleDistance")
        trigger += _wrap("actionTriggerParam", f"{spacing_m:.6f}")
    numbered = [
        action.replace("<wpml:action>", f"<wpml:action>{_wrap('actionId', place)}", 1)
        for place, action in enumerate(actions)
    ]
    return (
        f"{_wrap('actionGroupMode', 'sequence')}{_wrap('actionTrigger', trigger)}\n"
        + "\n".join(numbered)
        + "</wpml:actionGroup>\n"
    )


def _action(function: str, *parameters: str) -> str:
    return _wrap(
        "action",
        _wrap("actionActuatorFunc", function),
        _wrap("actionActuatorFuncParam", *parameters),
    )


def _take_photo(lens: str) -> str:
    """Action that takes a photo with one lens. The M30 and M3D families need the name of the lens
    in every action.
    """
    return _action(
        "takePhoto",
        _wrap("payloadPositionIndex", 0),
        _wrap("fileSuffix", "aos"),
        _wrap("payloadLensIndex", lens),
        _wrap("useGlobalPayloadLensIndex", 0),
    )


def _gimbal(pitch_deg: float, yaw_base: str) -> str:
    axes = {"Pitch": (1, f"{pitch_deg:g}"), "Roll": (0, "0"), "Yaw": (0, "0")}
    return _action(
        "gimbalRotate",
        _wrap("payloadPositionIndex", 0),
        _wrap("gimbalHeadingYawBase", yaw_base),
        _wrap("gimbalRotateMode", "absoluteAngle"),
        *(
            _wrap(f"gimbal{axis}RotateEnable", enabled) + _wrap(f"gimbal{axis}RotateAngle", angle)
            for axis, (enabled, angle) in axes.items()
        ),
        _wrap("gimbalRotateTimeEnable", 0),
        _wrap("gimbalRotateTime", 0),
    )
