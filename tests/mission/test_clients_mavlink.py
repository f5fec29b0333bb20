"""Programs that use MAVLink load the files: pymavlink, MAVSDK and MAVProxy.

MAVProxy connects to a simulated vehicle on the loopback interface, and MAVSDK connects to its own
server.  If a program is not installed, its tests are skipped.
"""

import importlib.util
import os
import shutil
import socket
import subprocess
import sys
import time
import warnings

import pytest
from support.flights import grid

from aosplan.mission.export import formats, render
from aosplan.mission.flown_path import flown_path

SITES = grid(49, kind="square", baseline_m=4.5)
SOUTH = grid(10, origin=(-54.8, -68.3), trigger="distance", kind="line")
MISSIONS = {"stop": SITES, "through": SOUTH, "west": grid(9, origin=(0.0, -179.99999))}


def file_of(mission, name, folder, **settings):
    form = formats()[name]
    path = folder / f"mission{form.suffixes[0]}"
    path.write_bytes(render(mission._replace(settings=mission.settings._replace(**settings)), form))
    return path


def check_sites(found, mission):
    """Check latitude and longitude in 1e-7 degrees and altitude of the points, in order."""
    ways = flown_path(mission)
    assert len(found) == len(ways)
    for (latitude, longitude, altitude), site in zip(found, ways, strict=True):
        # A client that truncates instead of rounding has an additional error of one unit.
        assert abs(latitude - site.latitude * 1e7) <= 1.01
        assert abs(longitude - site.longitude * 1e7) <= 1.01
        assert abs(altitude - site.height_m) <= 1e-3


@pytest.fixture(scope="module")
def mavutil():
    """pymavlink with MAVLink 2."""
    os.environ["MAVLINK20"] = "1"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pytest.importorskip("pymavlink")
        from pymavlink import mavutil as module

        module.set_dialect("ardupilotmega")
    return module


@pytest.mark.parametrize("name", MISSIONS)
def test_pymavlink_loads_waypoints(mavutil, tmp_path, name):
    from pymavlink import mavwp

    mission = MISSIONS[name]
    loader = mavwp.MAVWPLoader()
    count = loader.load(str(file_of(mission, "waypoints", tmp_path)))
    items = [loader.wp(index) for index in range(count)]
    assert [item.seq for item in items] == list(range(count))
    assert items[0].frame == mavutil.mavlink.MAV_FRAME_GLOBAL
    sites = [item for item in items[1:] if item.command == mavutil.mavlink.MAV_CMD_NAV_WAYPOINT]
    check_sites([(site.x * 1e7, site.y * 1e7, site.z) for site in sites], mission)
    assert {site.frame for site in sites} == {mavutil.mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT}
    photos = [i for i in items if i.command == mavutil.mavlink.MAV_CMD_DO_DIGICAM_CONTROL]
    switches = [i for i in items if i.command == mavutil.mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST]
    assert (len(photos), len(switches)) == ((0, 2) if name == "through" else (len(sites), 0))


# It does not close files that it cannot read.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.parametrize(
    "spoil",
    [
        lambda text: text.replace("QGC WPL 110", "QGC WPL 111"),
        lambda text: text.replace("QGC WPL 110", "\ufeffQGC WPL 110"),
        lambda text: text.replace("\t1\n", "\n", 1),
        lambda text: text.replace("\t16\t", "\tsixteen\t", 1),
    ],
)
def test_pymavlink_refuses_a_damaged_file(mavutil, tmp_path, spoil):
    from pymavlink import mavwp

    path = file_of(SITES, "waypoints", tmp_path)
    path.write_text(spoil(path.read_text()), encoding="utf-8")
    with pytest.raises((mavwp.MAVWPError, ValueError)):
        mavwp.MAVWPLoader().load(str(path))


@pytest.fixture(scope="module")
def ground_station():
    """MAVSDK connected to its own server.  Returns the interface for raw missions, and the missions
    that arrived.
    """
    pytest.importorskip("mavsdk")
    from mavsdk import ComponentType, Configuration, Mavsdk
    from mavsdk.plugins.mission_raw import MissionRaw
    from mavsdk.plugins.mission_raw_server import MissionRawServer

    port = free_port()
    kinds = (ComponentType.GROUND_STATION, ComponentType.AUTOPILOT)
    station, autopilot = (Mavsdk(Configuration.create_with_component_type(kind)) for kind in kinds)
    station.add_any_connection(f"udpin://127.0.0.1:{port}")
    autopilot.add_any_connection(f"udpout://127.0.0.1:{port}")
    server = MissionRawServer(autopilot.server_component())
    arrived = []
    server.subscribe_incoming_mission(lambda _result, plan, _data=None: arrived.append(plan))
    system = station.first_autopilot(30.0)
    assert system is not None
    missions = MissionRaw(system)
    yield missions, arrived
    for part in (missions, server, station, autopilot):
        part.destroy()


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def upload(missions, items):
    """Upload as soon as the station knows the autopilot's capabilities, shortly after connecting."""
    from mavsdk.plugins.mission_raw.mission_raw import MissionRawError

    for _ in range(200):
        try:
            return missions.upload_mission(items)
        except MissionRawError as error:
            if "INT_MESSAGES_NOT_SUPPORTED" not in str(error):
                raise
        time.sleep(0.1)
    return missions.upload_mission(items)


def sites_of(items):
    return [(item.x, item.y, item.z) for item in items if item.command == 16]


@pytest.mark.parametrize("name", MISSIONS)
@pytest.mark.parametrize("autopilot", ["px4", "ardupilot"])
def test_mavsdk_imports_uploads_and_downloads_plans(ground_station, tmp_path, name, autopilot):
    missions, arrived = ground_station
    path = file_of(MISSIONS[name], "plan", tmp_path, autopilot=autopilot)
    plan = missions.import_qgroundcontrol_mission(str(path))
    check_sites(sites_of(plan.mission_items), MISSIONS[name])
    assert plan.geofence_items == plan.rally_items == []
    assert [item.seq for item in plan.mission_items] == list(range(len(plan.mission_items)))
    before = len(arrived)
    upload(missions, plan.mission_items)
    check_sites(sites_of(missions.download_mission()), MISSIONS[name])
    for _ in range(100):
        if len(arrived) > before:
            break
        time.sleep(0.05)
    check_sites(sites_of(arrived[-1].mission_items), MISSIONS[name])


@pytest.mark.parametrize("name", MISSIONS)
def test_mavsdk_imports_waypoints(ground_station, tmp_path, name):
    missions, _ = ground_station
    path = file_of(MISSIONS[name], "waypoints", tmp_path)
    items = missions.import_mission_planner_mission(str(path)).mission_items
    check_sites(sites_of(items)[1:], MISSIONS[name])


@pytest.mark.parametrize("key", ["mission", "geoFence", "params"])
def test_mavsdk_refuses_a_plan_without_required_keys(ground_station, tmp_path, key):
    missions, _ = ground_station
    path = file_of(SITES, "plan", tmp_path)
    path.write_text(path.read_text().replace(f'"{key}"', '"elsewhere"'))
    from mavsdk.plugins.mission_raw import MissionRawError

    with pytest.raises(MissionRawError):
        missions.import_qgroundcontrol_mission(str(path))


class Vehicle:
    """A minimal ArduCopter that sends a heartbeat and receives missions."""

    def __init__(self, mavutil, port):
        self.mavlink = mavutil.mavlink
        self.link = mavutil.mavlink_connection(f"udpout:127.0.0.1:{port}", source_system=1)
        self.items = []

    def serve(self, on_contact, seconds=30.0):
        """Answer until a complete mission has arrived; call `on_contact` when a station connects."""
        count, asked, end = None, False, time.monotonic() + seconds
        beat = 0.0
        while time.monotonic() < end:
            if time.monotonic() > beat:
                beat = time.monotonic() + 0.2
                self.link.mav.heartbeat_send(
                    self.mavlink.MAV_TYPE_QUADROTOR,
                    self.mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
                    0,
                    0,
                    self.mavlink.MAV_STATE_STANDBY,
                )
            message = self.link.recv_match(blocking=True, timeout=0.05)
            kind = message.get_type() if message is not None else None
            if kind == "HEARTBEAT" and not asked:
                asked = True
                on_contact()
            elif kind == "MISSION_COUNT":
                count = message.count
                self.link.mav.mission_request_int_send(255, 230, 0)
            elif kind == "MISSION_ITEM_INT" and message.seq == len(self.items):
                self.items.append(message)
                if len(self.items) == count:
                    accepted = self.mavlink.MAV_MISSION_ACCEPTED
                    self.link.mav.mission_ack_send(255, 230, accepted)
                    return
                self.link.mav.mission_request_int_send(255, 230, len(self.items))


@pytest.mark.skipif(
    importlib.util.find_spec("MAVProxy") is None or os.name != "posix", reason="needs MAVProxy"
)
@pytest.mark.parametrize("name", ["stop", "through"])
def test_mavproxy_loads_waypoints_and_sends_them_to_a_vehicle(mavutil, tmp_path, name):
    program = shutil.which("mavproxy.py", path=os.path.dirname(sys.executable))
    if program is None:
        pytest.skip("no mavproxy.py beside Python")
    path = file_of(MISSIONS[name], "waypoints", tmp_path)
    port = free_port()
    vehicle = Vehicle(mavutil, port)
    command = [sys.executable, program, f"--master=udpin:127.0.0.1:{port}", "--nowait"]
    command += [f"--state-basedir={tmp_path}", "--default-modules=wp", "--streamrate=-1"]
    environment = os.environ | {"HOME": str(tmp_path), "MAVLINK20": "1"}
    with subprocess.Popen(
        command,
        cwd=tmp_path,
        env=environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    ) as station:
        try:

            def load():
                station.stdin.write(f"wp load {path}\n".encode())
                station.stdin.flush()

            vehicle.serve(load)
        finally:
            vehicle.link.close()
            station.kill()
        said = station.stdout.read().decode(errors="replace")
    assert f"Loaded {len(vehicle.items)} waypoints" in said, said
    assert [item.seq for item in vehicle.items] == list(range(len(vehicle.items)))
    check_sites(sites_of(vehicle.items)[1:], MISSIONS[name])
