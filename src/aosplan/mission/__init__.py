"""The mission: waypoints in flight order, and the files that flight software loads.

- `aosplan.mission.mission`: waypoints, how they are flown, and the split into flights.
- `aosplan.mission.limits`: what a file of each target may hold.
- `aosplan.mission.mavlink`: the commands of MAVLink missions.
- `aosplan.mission.dji_models`: how DJI's files number drones and payloads.
- `aosplan.mission.export`: from missions to the bytes of files.
- `aosplan.mission.formats`: one file a format.
"""
