"""The flight: the time that it takes, batteries, terrain and drones.

- `aosplan.flight.kinematics`: leg times with acceleration, turns and wind.
- `aosplan.flight.batteries`: the split of a path into flights.
- `aosplan.flight.track`: the path through sites that is flown.
- `aosplan.flight.terrain`: ground heights below the path.
- `aosplan.flight.photo_trigger`: the fastest speed at which photos are sharp and in time.
- `aosplan.flight.drones`: the built-in drones, each with its source.
"""
