"""The flight: flight time, batteries, terrain and drones.

- `aosplan.flight.kinematics`: leg times with acceleration, turns and wind.
- `aosplan.flight.batteries`: splitting a path into flights.
- `aosplan.flight.track`: the flown path through the sites.
- `aosplan.flight.terrain`: ground heights below the path.
- `aosplan.flight.photo_trigger`: the highest speed at which photos are sharp and the camera keeps
  up.
- `aosplan.flight.drones`: the drone presets, each with its source.
"""
