"""`plan --within`, compared with a brute-force search over all options that it may choose.

    python benchmarks/within.py

There are ten requests for areas and for a single place, with several presets, cameras, batteries
and winds. The brute-force search makes a request for each combination of coarse values of the
options that `--within` may choose: altitudes, triggers, headings, kinds of grid (square, rectangle,
line, lanes with several numbers and pitches), samples and spacings. The test is passed if no
combination within the time has a probability of detection that is more than 2 % higher than the
probability of the plan. To save time, a flight is planned completely only if its probability is
more than the probability of the plan minus 0.05, and if its photos alone do not take too long.  The
benchmark takes some minutes and writes the table to benchmarks/results/within.csv.
"""

from __future__ import annotations

import csv
import itertools
import json
import math
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan import PlanRequest, plan
from aosplan.errors import AosplanError
from aosplan.grid.patterns import Pattern
from aosplan.planning.loaded_scene import load_scene
from aosplan.planning.plan_detection import detection_model
from aosplan.planning.resolve import resolve_inputs
from aosplan.planning.sites import layout_of, route_of
from aosplan.planning.solved_plan import solve_inputs

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.planning.loaded_scene import LoadedScene
    from aosplan.planning.resolve import PlanInputs

RESULTS = Path(__file__).parent / "results"
SHARES = (1.0, 0.6, 0.25)
"""Shares of the largest spacing that the footprint allows."""

AREAS = {
    "field, 4 ha": [[14.3255, 48.3350], [14.3282, 48.3350], [14.3282, 48.3368], [14.3255, 48.3368]],
    "strip, 3 ha": [[14.3255, 48.3350], [14.3295, 48.3362], [14.3293, 48.3371], [14.3253, 48.3359]],
    "bent, 2 ha": [
        [14.3255, 48.3350], [14.3275, 48.3350], [14.3275, 48.3357],
        [14.3264, 48.3357], [14.3264, 48.3368], [14.3255, 48.3368],
    ],
}  # fmt: skip

PERSON = {"find": "person", "optimize": "detection"}

CASES: dict[str, tuple[str | None, dict[str, Any]]] = {
    "field, spruce, hot canopy": (
        "field, 4 ha",
        {"scene": "conifer-forest", "within": 25, "altitude": "40..80", "drone": "dji-m3t",
         "contrast": 2, "canopy_offset": 1, "crown_share": 0.2},
    ),
    "field, dense forest": (
        "field, 4 ha",
        {"scene": "dense-forest", "within": 25, "altitude": "40..80", "drone": "dji-m3t"},
    ),
    "field, dense forest, little time": (
        "field, 4 ha",
        {"scene": "dense-forest", "within": 9, "altitude": "60..100", "drone": "dji-m3t"},
    ),
    "strip, broadleaf, little contrast": (
        "strip, 3 ha",
        {"scene": "broadleaf-forest", "within": 15, "altitude": "50..90", "drone": "dji-m3e",
         "contrast": 1, "canopy_offset": 1, "crown_share": 0.3},
    ),
    "strip, batteries of 8 min": (
        "strip, 3 ha",
        {"scene": "dense-forest", "within": 20, "altitude": "60..80", "drone": "dji-m3t",
         "flight_time": 8},
    ),
    "bent, wind": (
        "bent, 2 ha",
        {"scene": "dense-forest", "within": 15, "altitude": "50..70", "drone": "dji-m3t",
         "wind_speed": 9, "wind_from": 250},
    ),
    "bent, tropical": (
        "bent, 2 ha",
        {"scene": "tropical-forest", "within": 8, "altitude": "60..90", "drone": "dji-m30t",
         "contrast": 2.5, "canopy_offset": -1, "crown_share": 0.4},
    ),
    "place, dense forest": (
        None, {"scene": "dense-forest", "within": 1.5, "altitude": "40..70", "drone": "dji-m3t"}
    ),
    "place, dense forest, stops": (
        None,
        {"scene": "dense-forest", "within": 2, "altitude": 45, "drone": "dji-m3t",
         "trigger": "stop"},
    ),
    "place, mixed forest, hot canopy": (
        None,
        {"scene": "mixed-forest", "within": 1, "altitude": "40..60", "drone": "dji-m30t",
         "contrast": 2, "canopy_offset": 2, "crown_share": 0.3},
    ),
}  # fmt: skip


class Tried(NamedTuple):
    """Result of the brute-force search: the number of combinations, the number of flights that were
    planned completely, and the best combination.
    """

    combinations: int
    laid_out: int
    best: float
    description: str


def main() -> None:
    wanted = sys.argv[1:]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name, (area, values) in CASES.items():
            if wanted and name not in wanted:
                continue
            row = compared(name, request_of(area, values, folder))
            rows.append(row)
            print(json.dumps(row), flush=True)
    if not wanted:
        with (RESULTS / "within.csv").open("w", newline="", encoding="utf-8") as file:
            table = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
            table.writeheader()
            table.writerows(rows)


def request_of(area: str | None, values: dict[str, Any], folder: str) -> PlanRequest:
    """The request of a case."""
    if area is None:
        return PlanRequest(**PERSON, **values)
    path = Path(folder) / "area.geojson"
    ring = [*AREAS[area], AREAS[area][0]]
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}), encoding="utf-8")
    return PlanRequest(**PERSON, area=str(path), **values)


def compared(name: str, request: PlanRequest) -> dict[str, Any]:
    """A row of the table: the plan, and the best combination of the brute-force search."""
    start = time.process_time()
    found = plan(request)
    seconds = time.process_time() - start
    assert found.detection is not None
    assert found.within is not None
    start = time.process_time()
    tried = brute_force(request, found.detection.probability)
    return {
        "request": name,
        "within_min": request.within,
        "time_min": round(found.route.total_time_s / 60.0, 2),
        "probability": round(found.detection.probability, 4),
        "seconds": round(seconds, 2),
        "predicted": found.within.predicted,
        "laid_out": found.within.laid_out,
        "brute_force": round(tried.best, 4) if tried.description else "",
        "brute_seconds": round(time.process_time() - start, 1),
        "combinations": tried.combinations,
        "brute_laid_out": tried.laid_out,
        "brute_grid": tried.description,
    }


def brute_force(request: PlanRequest, floor: float) -> Tried:
    """The best combination within the time, among those whose predicted probability exceeds `floor`
    - 0.05.
    """
    scene = load_scene(request)
    assert request.within is not None
    allowed_s = 60.0 * request.within
    combinations = laid_out = 0
    best, description = max(floor - 0.05, 0.0), ""
    headings = [0.0, 45.0, 90.0, 135.0, "auto"] if request.area else [0.0, 90.0]
    triggers = ["distance", "stop"] if request.trigger == "best" else [request.trigger]
    for altitude in altitudes_of(request):
        opened = replace(
            request, within=None, optimize="samples", vhat=0.5, grid="line", altitude=altitude,
            trigger="stop", heading=0.0,
        )  # fmt: skip
        inputs = resolve_inputs(opened, load=lambda _: scene)
        area_m2 = inputs.area.whole.area if inputs.area is not None else 0.0
        model = detection_model(inputs).for_search()
        for (grid, rows, columns, pitch), share in itertools.product(kinds(), SHARES):
            baseline = share * widest_m(inputs, rows, columns, pitch)
            combinations += len(triggers) * len(headings)
            probability = model.predict(Pattern(rows, columns, pitch), baseline).probability
            if probability <= best:
                continue
            for trigger, heading in itertools.product(triggers, headings):
                # The photos themselves also take time. An area has about one photo per cell of the
                # grid.
                photos = max(area_m2 / (baseline**2 * pitch), rows * columns) - rows
                each_s = request.hold if trigger == "stop" else request.photo_interval
                if photos * (each_s or 0.0) > allowed_s or probability <= best:
                    continue
                pitched = {"lane_pitch": pitch} if grid == "lanes" or request.area else {}
                fixed = replace(
                    opened, grid=grid, samples=rows * columns, baseline=baseline, heading=heading,
                    trigger=trigger, lanes=rows if grid == "lanes" else None,
                    **(pitched if grid in ("lanes", "line") else {}),
                )  # fmt: skip
                laid_out += 1
                if time_s(fixed, scene) <= allowed_s:
                    best = probability
                    description = (
                        f"{grid} {rows} x {columns}, {baseline:.2f} m, pitch {pitch:g}, "
                        f"{altitude:g} m, {trigger}, heading {heading}"
                    )
    return Tried(combinations, laid_out, best if description else 0.0, description)


def time_s(request: PlanRequest, scene: LoadedScene) -> float:
    """Time of the flights of a request; infinite if it cannot be flown."""
    try:
        inputs = resolve_inputs(request, load=lambda _: scene)
        solved = solve_inputs(inputs, count_required=False, seek_remedy=False)
        layout = layout_of(solved)
        return route_of(solved.inputs, layout, solved.solution.baseline_m).total_time_s
    except AosplanError:
        return math.inf


def altitudes_of(request: PlanRequest) -> list[float]:
    """Lowest and highest altitude of a range."""
    if not isinstance(request.altitude, str):
        assert request.altitude is not None
        return [request.altitude]
    low, high = (float(part) for part in request.altitude.split(".."))
    return [low, high]


def widest_m(inputs: PlanInputs, rows: int, columns: int, pitch: float) -> float:
    """Largest spacing at which a target is inside the images of all sites around it."""
    x, y = inputs.footprint_m
    if inputs.area is not None:
        return min(x / columns, y / (rows * pitch))
    return min((x - 1.7) / max(columns - 1, 1), (y - 1.7) / max((rows - 1) * pitch, 1e-9))


def kinds() -> Iterator[tuple[str, int, int, float]]:
    """Kinds of grid, with their rows, columns, and pitch across the heading in units of the
    spacing.
    """
    for side in (2, 3, 4, 5, 6, 8, 10, 14):
        yield "square", side, side, 1.0
        yield "rectangle", side, side + 1, 1.0
    for columns in (2, 3, 4, 6, 8, 12, 18, 30):
        for pitch in (1.0, 1.5, 2.0, 3.0, 5.0, 8.0):
            yield "line", 1, columns, pitch
            for lanes in (2, 3, 4, 6):
                if lanes * columns <= 400:
                    yield "lanes", lanes, columns, pitch


if __name__ == "__main__":
    main()
