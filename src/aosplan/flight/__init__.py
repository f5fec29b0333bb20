"""Flights: flight time, batteries, terrain and drones.

- `aosplan.flight.kinematics`: leg times with acceleration, turns and wind; limits of the speed.
- `aosplan.flight.batteries`: splitting a path into flights.
- `aosplan.flight.track`: the flown path through the sites, with the turns before and after lines.
- `aosplan.flight.terrain`: ground heights below the path.
- `aosplan.flight.drones`: the drone presets, each with its source.
- `aosplan.flight.find`: finds a drone by the name of a preset or by the path of a file.
- `aosplan.flight.drone_file`: drones in files.
"""
