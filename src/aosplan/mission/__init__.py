"""The mission: waypoints in flight order, and the files that flight software loads.

- `aosplan.mission.mission`: waypoints, flight settings, and the split into flights.
- `aosplan.mission.limits`: checks of a mission against the limits of the program that reads its
  file.
- `aosplan.mission.mavlink`: the commands of MAVLink missions.
- `aosplan.mission.dji_models`: the numbers that identify drones and payloads in DJI's files.
- `aosplan.mission.export`: conversion of missions to the bytes of files.
- `aosplan.mission.formats`: one module per format.
- `aosplan.mission.flown_path`: the points of the path that a mission file needs.
- `aosplan.mission.format`: description of a format: its name, its limits, and what it can express.
"""
