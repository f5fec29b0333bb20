"""Results of `plan` for a scenario, with the names of the columns of sweeps."""

import math

from aosplan.errors import AosplanError, InfeasibleError
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.sweeps.solve_rows import RESULTS


def results_of(result):
    """The numbers in a plan's JSON document, with the names in `RESULTS`.  A missing number is
    nan.
    """
    document = result.document()
    named = {name: document.get(name) for name in RESULTS}
    for part in ("visibility", "disparity", "camera", "flight"):
        named |= {f"{part}_{name}": value for name, value in document[part].items()}
    grid = document["grid"]
    named |= {f"grid_{name}": grid[name] for name in ("rows", "columns")}
    named["grid_extent_x_m"], named["grid_extent_y_m"] = grid["extent_m"]
    named["camera_footprint_x_m"], named["camera_footprint_y_m"] = document["camera"]["footprint_m"]
    return {name: math.nan if named[name] is None else named[name] for name in RESULTS}


def by_plan(values):
    """Status, reason and results of a scenario, computed by `plan`."""
    try:
        return "ok", "", results_of(plan(PlanRequest(**values)))
    except InfeasibleError as error:
        return "infeasible", error.message, {}
    except AosplanError as error:
        return "invalid", error.message, {}
