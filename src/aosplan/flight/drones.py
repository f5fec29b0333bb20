"""Presets of drones that are used for airborne optical sectioning.

Manufacturers publish top speeds, climb rates, and hovering or flight times in still air. Few
manufacturers publish an acceleration, and none publishes a cruise speed for missions. Values that
are not published are assumed, and the field `assumed` names them. Small quadcopters reach an
acceleration of 2 m/s² at a tilt of about 12 degrees. At a cruise speed of 10 m/s, the gimbal has
time to stabilise. After a flight of the published time, a new battery is empty. The flights of a
plan should therefore be shorter.

`source` names the manufacturer's page.  If a value comes from a single unverified reading,
`assumed` marks it as "unconfirmed".
"""

from __future__ import annotations

from typing import NamedTuple


class DronePreset(NamedTuple):
    """A drone, as specified by its manufacturer or by the defaults of its autopilot."""

    title: str
    """Name for output, for example "DJI Mavic 3T"."""
    speed_mps: float
    """Cruise speed in missions, which is the default of --speed."""
    acceleration_mps2: float
    climb_mps: float
    """Vertical speed that both climb and descent can reach."""
    airspeed_mps: float
    """Highest airspeed outside sport mode.  Missions do not use sport mode."""
    endurance_min: float | None
    """Longest flight time in still air, until the battery is empty. It is None for types of drones
    that are built in many versions.
    """
    most_waypoints: int | None
    """Greatest number of waypoints in a mission; None if it is not published."""
    camera: str | None
    """Name of the camera preset; None if the drone can carry different cameras."""
    photo_interval_s: float | None
    """Shortest time between two photos of that camera; None if it is not published."""
    mission_formats: tuple[str, ...]
    """Formats of mission files that the drone is known to fly."""
    source: str
    """Where the numbers are published."""
    assumed: str
    """Which numbers are derived or assumed, and how."""
    autopilot: str = "dji"
    """Type of flight controller, one of `AUTOPILOTS`. It determines which mission files can be
    used.
    """


AUTOPILOTS = ("px4", "ardupilot", "dji", "autel", "parrot")
"""Types of flight controllers, each with its own mission files."""

_CRUISE = "cruise speed and acceleration assumed"
_WPML = "waypoints of a mission: WPML specification, DJI Cloud API (indices up to 65,535)"
_SDK = (
    "waypoints: DJI Mobile SDK 4, DJIWaypointMission (2 to 99), which older versions of Litchi use"
)
_FLY = "waypoints: at most 99 in a mission of DJI Fly, which flies this drone (YLabs-FPV/YMapper, README)"

DRONES: dict[str, DronePreset] = {
    "dji-m3t": DronePreset(
        title="DJI Mavic 3T",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=6.0,
        airspeed_mps=15.0,
        endurance_min=45.0,
        most_waypoints=65_535,
        camera="dji-m3t-thermal",
        photo_interval_s=2.0,
        mission_formats=("kmz",),
        source=f"Mavic 3 Enterprise Series specifications, DJI (normal mode); {_WPML}",
        assumed=_CRUISE,
    ),
    "dji-m3e": DronePreset(
        title="DJI Mavic 3E",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=6.0,
        airspeed_mps=15.0,
        endurance_min=45.0,
        most_waypoints=65_535,
        camera="dji-m3e-wide",
        photo_interval_s=0.7,
        mission_formats=("kmz",),
        source=f"Mavic 3 Enterprise Series specifications, DJI (normal mode); {_WPML}",
        assumed=_CRUISE,
    ),
    "dji-m3m": DronePreset(
        title="DJI Mavic 3M",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=6.0,
        airspeed_mps=15.0,
        endurance_min=43.0,
        most_waypoints=65_535,
        camera="dji-m3m-wide",
        photo_interval_s=0.7,
        mission_formats=("kmz",),
        source=f"Mavic 3 Multispectral specifications, DJI (normal mode); {_WPML}",
        assumed=_CRUISE,
    ),
    "dji-m3d": DronePreset(
        title="DJI Matrice 3D",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=6.0,
        airspeed_mps=15.0,
        endurance_min=50.0,
        most_waypoints=65_535,
        camera="dji-m3d-wide",
        photo_interval_s=0.7,
        mission_formats=("kmz",),
        source=f"Matrice 3D Series specifications, DJI (normal mode); {_WPML}",
        assumed=f"{_CRUISE}; speeds and photo interval unconfirmed",
    ),
    "dji-m3td": DronePreset(
        title="DJI Matrice 3TD",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=6.0,
        airspeed_mps=15.0,
        endurance_min=50.0,
        most_waypoints=65_535,
        camera="dji-m3td-thermal",
        photo_interval_s=2.0,
        mission_formats=("kmz",),
        source=f"Matrice 3D Series specifications, DJI (normal mode); {_WPML}",
        assumed=f"{_CRUISE}; speeds unconfirmed; photo interval as for the Mavic 3T",
    ),
    "dji-m30": DronePreset(
        title="DJI Matrice 30",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=5.0,
        airspeed_mps=23.0,
        endurance_min=41.0,
        most_waypoints=65_535,
        camera="dji-m30t-wide",
        photo_interval_s=2.0,
        mission_formats=("kmz",),
        source=f"Matrice 30 Series specifications, DJI (climb 6, descent 5 m/s; timed photos from 2 s); {_WPML}",
        assumed=f"{_CRUISE}; wide camera as for the 30T",
    ),
    "dji-m30t": DronePreset(
        title="DJI Matrice 30T",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=5.0,
        airspeed_mps=23.0,
        endurance_min=41.0,
        most_waypoints=65_535,
        camera="dji-m30t-thermal",
        photo_interval_s=2.0,
        mission_formats=("kmz",),
        source=f"Matrice 30 Series specifications, DJI (climb 6, descent 5 m/s; timed photos from 2 s); {_WPML}",
        assumed=f"{_CRUISE}; photo interval as for the wide camera",
    ),
    "dji-m300": DronePreset(
        title="DJI Matrice 300 RTK with Zenmuse H20T",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=3.0,
        airspeed_mps=17.0,
        endurance_min=43.0,
        most_waypoints=65_535,
        camera="dji-h20t-thermal",
        photo_interval_s=2.0,
        mission_formats=("kmz",),
        source=(
            "Matrice 300 RTK specifications, DJI (positioning mode: 17 m/s, climb 5, descent 3 m/s;"
            f" 55 min without payload); {_WPML}"
        ),
        assumed=f"{_CRUISE}; speeds unconfirmed; flight time with the camera; photo interval as for "
        "the Mavic 3T",
    ),
    "dji-m350": DronePreset(
        title="DJI Matrice 350 RTK with Zenmuse H30T",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=5.0,
        airspeed_mps=23.0,
        endurance_min=43.0,
        most_waypoints=65_535,
        camera="dji-h30t-thermal",
        photo_interval_s=2.0,
        mission_formats=("kmz",),
        source=(
            "Matrice 350 RTK specifications, DJI (climb 6, descent 5 m/s; 55 min without payload);"
            f" {_WPML}"
        ),
        assumed=f"{_CRUISE}; climb unconfirmed; flight time with the camera; photo interval as for "
        "the Mavic 3T",
    ),
    "dji-m400": DronePreset(
        title="DJI Matrice 400 with Zenmuse H30T",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=8.0,
        airspeed_mps=25.0,
        endurance_min=45.0,
        most_waypoints=65_535,
        camera="dji-h30t-thermal",
        photo_interval_s=2.0,
        mission_formats=("kmz",),
        source=(
            "Matrice 400 specifications, DJI (climb 10, descent 8 m/s; 59 min of forward flight"
            f" without payload); {_WPML}"
        ),
        assumed=f"{_CRUISE}; speeds unconfirmed; flight time with the camera; photo interval as for "
        "the Mavic 3T",
    ),
    "dji-m4t": DronePreset(
        title="DJI Matrice 4T",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=6.0,
        airspeed_mps=15.0,
        endurance_min=49.0,
        most_waypoints=65_535,
        camera="dji-m4t-thermal",
        photo_interval_s=0.7,
        mission_formats=("kmz",),
        source=f"Matrice 4 Series specifications, DJI (normal mode); {_WPML}",
        assumed=f"{_CRUISE}; speeds unconfirmed",
    ),
    "dji-m4e": DronePreset(
        title="DJI Matrice 4E",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=6.0,
        airspeed_mps=15.0,
        endurance_min=49.0,
        most_waypoints=65_535,
        camera="dji-m4e-wide",
        photo_interval_s=0.5,
        mission_formats=("kmz",),
        source=f"Matrice 4 Series specifications, DJI (normal mode); {_WPML}",
        assumed=f"{_CRUISE}; speeds unconfirmed",
    ),
    "dji-m4d": DronePreset(
        title="DJI Matrice 4D",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=6.0,
        airspeed_mps=15.0,
        endurance_min=54.0,
        most_waypoints=65_535,
        camera="dji-m4d-wide",
        photo_interval_s=0.5,
        mission_formats=("kmz",),
        source=f"Matrice 4D Series specifications, DJI (normal mode); {_WPML}",
        assumed=f"{_CRUISE}; speeds unconfirmed",
    ),
    "dji-m4td": DronePreset(
        title="DJI Matrice 4TD",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=6.0,
        airspeed_mps=15.0,
        endurance_min=54.0,
        most_waypoints=65_535,
        camera="dji-m4td-thermal",
        photo_interval_s=0.7,
        mission_formats=("kmz",),
        source=f"Matrice 4D Series specifications, DJI (normal mode); {_WPML}",
        assumed=f"{_CRUISE}; speeds unconfirmed",
    ),
    "dji-m2ea": DronePreset(
        title="DJI Mavic 2 Enterprise Advanced",
        speed_mps=8.0,
        acceleration_mps2=2.0,
        climb_mps=3.0,
        airspeed_mps=13.9,
        endurance_min=31.0,
        most_waypoints=99,
        camera="dji-m2ea-thermal",
        photo_interval_s=2.0,
        mission_formats=("litchi",),
        source=(
            f"Mavic 2 Enterprise Advanced specifications, DJI (50 km/h outside sport mode); {_SDK}"
        ),
        assumed=f"{_CRUISE}; descent 3 m/s; speed and photo interval unconfirmed",
    ),
    "dji-mini-3-pro": DronePreset(
        title="DJI Mini 3 Pro",
        speed_mps=8.0,
        acceleration_mps2=2.0,
        climb_mps=3.0,
        airspeed_mps=10.0,
        endurance_min=34.0,
        most_waypoints=99,
        camera="dji-mini-3-pro",
        photo_interval_s=2.0,
        mission_formats=("litchi",),
        source=(
            "Mini 3 Pro specifications, DJI (normal mode); DJI Fly has no waypoint missions for "
            f"this drone, but Litchi Pilot has (YLabs-FPV/YMapper, README); {_SDK}"
        ),
        assumed=f"{_CRUISE}; Litchi Pilot (a beta version) is assumed to read Litchi's CSV",
    ),
    "dji-mini-4-pro": DronePreset(
        title="DJI Mini 4 Pro",
        speed_mps=8.0,
        acceleration_mps2=2.0,
        climb_mps=5.0,
        airspeed_mps=12.0,
        endurance_min=34.0,
        most_waypoints=99,
        camera="dji-mini-4-pro",
        photo_interval_s=2.0,
        mission_formats=("dji-fly",),
        source=f"Mini 4 Pro specifications, DJI (normal mode); {_FLY}",
        assumed=f"{_CRUISE}; speeds unconfirmed",
    ),
    "dji-mini-5-pro": DronePreset(
        title="DJI Mini 5 Pro",
        speed_mps=8.0,
        acceleration_mps2=2.0,
        climb_mps=5.0,
        airspeed_mps=15.0,
        endurance_min=36.0,
        most_waypoints=99,
        camera="dji-mini-5-pro",
        photo_interval_s=2.0,
        mission_formats=("dji-fly",),
        source=f"Mini 5 Pro specifications, DJI; speed as in dronnix-io/FlyPath, drones.json; {_FLY}",
        assumed=f"{_CRUISE}; all of its numbers unconfirmed",
    ),
    "dji-air-3": DronePreset(
        title="DJI Air 3",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=6.0,
        airspeed_mps=15.0,
        endurance_min=46.0,
        most_waypoints=99,
        camera="dji-air-3-wide",
        photo_interval_s=2.0,
        mission_formats=("dji-fly",),
        source=f"Air 3 specifications, DJI (normal mode); {_FLY}",
        assumed=f"{_CRUISE}; speeds and photo interval unconfirmed",
    ),
    "dji-air-3s": DronePreset(
        title="DJI Air 3S",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=6.0,
        airspeed_mps=15.0,
        endurance_min=45.0,
        most_waypoints=99,
        camera="dji-air-3s-wide",
        photo_interval_s=2.0,
        mission_formats=("dji-fly",),
        source=f"Air 3S specifications, DJI (normal mode); {_FLY}",
        assumed=f"{_CRUISE}; speeds and photo interval unconfirmed",
    ),
    "dji-mavic-3": DronePreset(
        title="DJI Mavic 3 (also Classic and Cine)",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=6.0,
        airspeed_mps=15.0,
        endurance_min=46.0,
        most_waypoints=99,
        camera="dji-mavic-3-wide",
        photo_interval_s=2.0,
        mission_formats=("dji-fly",),
        source=f"Mavic 3 specifications, DJI (normal mode); {_FLY}",
        assumed=f"{_CRUISE}; speeds and photo interval unconfirmed",
    ),
    "dji-mavic-3-pro": DronePreset(
        title="DJI Mavic 3 Pro",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=6.0,
        airspeed_mps=15.0,
        endurance_min=43.0,
        most_waypoints=99,
        camera="dji-mavic-3-wide",
        photo_interval_s=2.0,
        mission_formats=("dji-fly",),
        source=f"Mavic 3 Pro specifications, DJI (normal mode); {_FLY}, as for the Mavic 3",
        assumed=f"{_CRUISE}; speeds, photo interval and waypoint missions unconfirmed; camera as for "
        "the Mavic 3",
    ),
    "dji-mavic-4-pro": DronePreset(
        title="DJI Mavic 4 Pro",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=6.0,
        airspeed_mps=15.0,
        endurance_min=51.0,
        most_waypoints=99,
        camera="dji-mavic-4-pro-wide",
        photo_interval_s=2.0,
        mission_formats=("dji-fly",),
        source=f"Mavic 4 Pro specifications, DJI (51 min; 25 m/s in sport mode); {_FLY}",
        assumed=f"{_CRUISE}; speeds of the normal mode and photo interval unconfirmed",
    ),
    "dji-air-2s": DronePreset(
        title="DJI Air 2S",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=6.0,
        airspeed_mps=15.0,
        endurance_min=31.0,
        most_waypoints=99,
        camera="dji-air-2s",
        photo_interval_s=2.0,
        mission_formats=("litchi",),
        source=f"Air 2S specifications, DJI (normal mode); {_SDK}",
        assumed=_CRUISE,
    ),
    "dji-phantom-4-pro": DronePreset(
        title="DJI Phantom 4 Pro",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=3.0,
        airspeed_mps=13.9,
        endurance_min=30.0,
        most_waypoints=99,
        camera="dji-phantom-4-pro",
        photo_interval_s=2.0,
        mission_formats=("litchi",),
        source=f"Phantom 4 Pro specifications, DJI (positioning mode 50 km/h; climb 5, descent 3 m/s); {_SDK}",
        assumed=f"{_CRUISE}; climb unconfirmed; photo interval: the shortest of its timed photos",
    ),
    "dji-mavic-2-pro": DronePreset(
        title="DJI Mavic 2 Pro",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=3.0,
        airspeed_mps=13.9,
        endurance_min=31.0,
        most_waypoints=99,
        camera="dji-mavic-2-pro",
        photo_interval_s=2.0,
        mission_formats=("litchi",),
        source=f"Mavic 2 Pro specifications, DJI (climb 4, descent 3 m/s outside sport mode); {_SDK}",
        assumed=f"{_CRUISE}; climb unconfirmed; speed as for the Phantom 4 Pro; photo interval: the "
        "shortest of its timed photos",
    ),
    "autel-evo-2-dual-640t": DronePreset(
        title="Autel EVO II Dual 640T",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=3.0,
        airspeed_mps=15.0,
        endurance_min=38.0,
        most_waypoints=None,
        camera="autel-evo-2-dual-640t-thermal",
        photo_interval_s=2.0,
        mission_formats=(),
        source="EVO II Dual 640T specifications, Autel Robotics (standard mode)",
        assumed=f"{_CRUISE}; descent 3 m/s; speed unconfirmed; photo interval: the shortest of its time lapse",
        autopilot="autel",
    ),
    "autel-evo-max-4t": DronePreset(
        title="Autel EVO Max 4T",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=6.0,
        airspeed_mps=15.0,
        endurance_min=42.0,
        most_waypoints=65_535,
        camera="autel-evo-max-4t-thermal",
        photo_interval_s=2.0,
        mission_formats=("autel",),
        source=(
            "EVO Max 4T specifications, Autel Robotics (climb 8, descent 6 m/s); waypoints and flight"
            " time: Autel Payload SDK documentation (2 to 65,535; 42 min)"
        ),
        assumed=f"{_CRUISE}; speeds unconfirmed; photo interval as for the EVO II",
        autopilot="autel",
    ),
    "autel-evo-max-4n": DronePreset(
        title="Autel EVO Max 4N",
        speed_mps=10.0,
        acceleration_mps2=2.0,
        climb_mps=6.0,
        airspeed_mps=15.0,
        endurance_min=42.0,
        most_waypoints=65_535,
        camera=None,
        photo_interval_s=2.0,
        mission_formats=("autel",),
        source=(
            "waypoints and flight time of the EVO Max series: Autel Payload SDK documentation (2 to"
            " 65,535; 42 min); other values as for the EVO Max 4T"
        ),
        assumed=f"{_CRUISE}; speeds unconfirmed, as for the EVO Max 4T; photo interval as for the "
        "EVO II",
        autopilot="autel",
    ),
    "parrot-anafi-usa": DronePreset(
        title="Parrot ANAFI USA",
        speed_mps=8.0,
        acceleration_mps2=2.0,
        climb_mps=3.0,
        airspeed_mps=14.7,
        endurance_min=32.0,
        most_waypoints=None,
        camera="parrot-anafi-usa-thermal",
        photo_interval_s=1.0,
        mission_formats=("parrot",),
        source="ANAFI USA specifications, Parrot (climb 4, descent 3 m/s)",
        assumed=f"{_CRUISE}; photo interval",
        autopilot="parrot",
    ),
    "parrot-anafi-thermal": DronePreset(
        title="Parrot ANAFI Thermal",
        speed_mps=8.0,
        acceleration_mps2=2.0,
        climb_mps=4.0,
        airspeed_mps=15.0,
        endurance_min=26.0,
        most_waypoints=None,
        camera="parrot-anafi-thermal",
        photo_interval_s=1.0,
        mission_formats=("parrot",),
        source="ANAFI Thermal specifications, Parrot",
        assumed=f"{_CRUISE}; photo interval; flight time and speeds unconfirmed",
        autopilot="parrot",
    ),
    "ardupilot-copter": DronePreset(
        title="ArduCopter, any frame with default parameters",
        speed_mps=10.0,
        acceleration_mps2=2.5,
        climb_mps=1.5,
        airspeed_mps=15.0,
        endurance_min=None,
        most_waypoints=718,
        camera=None,
        photo_interval_s=None,
        mission_formats=("waypoints", "plan"),
        source=(
            "ArduPilot, libraries/AC_WPNav/AC_WPNav.h (10 m/s, 2.5 m/s², climb 2.5 and descent"
            " 1.5 m/s); waypoints: the number that small boards can store"
        ),
        assumed="airspeed",
        autopilot="ardupilot",
    ),
    "px4-multicopter": DronePreset(
        title="PX4, any multicopter with default parameters",
        speed_mps=5.0,
        acceleration_mps2=3.0,
        climb_mps=1.5,
        airspeed_mps=12.0,
        endurance_min=None,
        most_waypoints=None,
        camera=None,
        photo_interval_s=None,
        mission_formats=("plan",),
        source=(
            "PX4, MPC_XY_CRUISE 5 m/s, MPC_ACC_HOR 3 m/s², MPC_Z_V_AUTO_UP 3 and MPC_Z_V_AUTO_DN"
            " 1.5 m/s, MPC_XY_VEL_MAX 12 m/s"
        ),
        assumed="the largest commanded speed is assumed to be the largest airspeed",
        autopilot="px4",
    ),
}


TRUSTED_SHARE = 2.0 / 3.0
"""Share of the published flight time that a plan uses by default.

The rest is a reserve for wind, cold, an older battery, and the landing.
"""


def trusted_min(drone: DronePreset) -> float | None:
    """Default flight time per battery in minutes; None if no flight time is published."""
    endurance = drone.endurance_min
    return None if endurance is None else round(TRUSTED_SHARE * endurance, 1)
