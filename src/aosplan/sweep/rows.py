"""Scenarios solved one at a time: whatever `aosplan.sweep.columns` leaves.

What rows have in common, a scene and its voxels, is kept between them.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from aosplan.errors import InfeasibleError, RequestError
from aosplan.options import OPTIONS
from aosplan.planning import plan
from aosplan.request import PlanRequest
from aosplan.resolve import ResolvedScene, scene_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import numpy as np
    from numpy.typing import NDArray

    from aosplan.planning import Plan
    from aosplan.sweep.scenarios import Block

WHOLE = ("samples", "samples_required", "grid_rows", "grid_columns")
"""Results that are whole numbers."""

RESULTS = (
    "altitude_m",
    "baseline_m",
    "samples",
    "samples_required",
    "aperture_m",
    "grid_rows",
    "grid_columns",
    "grid_extent_x_m",
    "grid_extent_y_m",
    "visibility_density",
    "visibility_minimum",
    "visibility_maximum",
    "visibility_expected",
    "visibility_normalized",
    "visibility_shortfall",
    "visibility_effective_samples",
    "visibility_contrast",
    "disparity_normalized",
    "disparity_pixels",
    "camera_gsd_m",
    "camera_footprint_x_m",
    "camera_footprint_y_m",
    "flight_length_m",
    "flight_time_s",
)
"""Numbers of a plan's JSON document, by place and name."""

SCENE = (*(option.name for option in OPTIONS if option.panel == "Scene"), "model")
"""Options that decide what is read of a scene."""

MOST_SCENES = 16
"""Scenes kept; voxels may be large."""

_scenes: dict[tuple[Any, ...], ResolvedScene] = {}


def solve_rows(
    block: Block, rows: NDArray[np.intp], folder: str
) -> Iterator[tuple[str, str, dict[str, float]]]:
    """Status, reason and results of some scenarios of a block, in their order."""
    return (solve_row(block.request_values(row), folder) for row in rows.tolist())


def solve_row(values: Mapping[str, Any], folder: str) -> tuple[str, str, dict[str, float]]:
    """Status, reason and results of one scenario; a scenario that cannot be met is no error."""
    try:
        request = PlanRequest(**values)
        result = plan(request, folder=folder, found=_scene(request, folder))
    except InfeasibleError as error:
        return "infeasible", error.message, {}
    except RequestError as error:
        return "invalid", error.message, {}
    return "ok", "", results_of(result)


def _scene(request: PlanRequest, folder: str) -> ResolvedScene:
    """The scene of a request, read once for all rows that have it."""
    key = (folder, *(getattr(request, name) for name in SCENE))
    found = _scenes.get(key)
    if found is None:  # threads of a worker may both read it
        if len(_scenes) >= MOST_SCENES:
            _scenes.clear()
        found = scene_of(request, folder=folder)
        if (
            found.volume is not None
            and found.correlogram is None
            and request.model in (None, "measured")
        ):
            from aosplan.models.correlogram import correlogram

            found = found._replace(correlogram=correlogram(found.volume))
        _scenes[key] = found
    return found


def results_of(result: Plan) -> dict[str, float]:
    """The numbers of a plan by the names of `RESULTS`; nan where a plan has none."""
    document = result.document()
    grid, camera = document["grid"], document["camera"]
    named: dict[str, Any] = {name: document.get(name) for name in RESULTS}
    for part in ("visibility", "disparity", "camera", "flight"):
        named |= {f"{part}_{name}": value for name, value in document[part].items()}
    named |= {f"grid_{name}": grid[name] for name in ("rows", "columns")}
    named["grid_extent_x_m"], named["grid_extent_y_m"] = grid["extent_m"]
    named["camera_footprint_x_m"], named["camera_footprint_y_m"] = camera["footprint_m"]
    return {name: math.nan if named[name] is None else named[name] for name in RESULTS}
