"""Plans of the uniform scene for tests of planning."""

from aosplan import PlanRequest, plan


def planned(**values):
    return plan(PlanRequest(**({"altitude": 40} | values)))


def places_of(result):
    return [(w.east_m, w.north_m) for w in result.waypoints]
