"""Rows of the tables of plans and scenes: flight, detection, search for the best flight in a given
time, guided positions and opacity.

Each row is a heading and a text.  The page of a plan shows some of the same texts.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from aosplan.planning.option_parsers import PERSON
from aosplan.show.text.gain_rows import gain_rows
from aosplan.units import duration, percent

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from aosplan.maps.detection_map import DetectionMap, SearchSuccess
    from aosplan.maps.reciprocal_map import ReciprocalMap
    from aosplan.planning.guided_result import GuidedResult, PlainFlight
    from aosplan.planning.result import Plan
    from aosplan.planning.within_result import WithinResult, WithinRow


def flight_rows(plan: Plan) -> Iterable[tuple[str, str]]:
    """Rows about the flight, each with a heading and a text."""
    route, flight = plan.route, plan.inputs.flight
    yield (
        "Flight",
        f"{route.length_m:,.0f} m, {duration(route.time_s)} (from the first photo to the last)",
    )
    if flight.trigger == "distance":
        yield (
            "",
            f"one photo every {plan.solution.baseline_m:.2f} m at "
            f"{route.timing.speed_mps:.3g} m/s, after a run-in of "
            f"{route.timing.run_in_m:.3g} m",
        )
    if flight.wind is not None and route.wind_delay_s is not None:
        said = f"{flight.wind.speed_mps:g} m/s from {flight.wind.from_deg:g}°: "
        photos_s, flights_s = route.wind_delay_s
        yield (
            "Wind",
            said
            + f"the flight takes {photos_s:.0f} s longer from the first photo to the last, and "
            f"{flights_s:.0f} s longer from take-off to landing"
            if max(route.wind_delay_s) >= 0.5
            else said
            + "the flight takes no longer, because the drone reaches the same speeds over "
            "ground",
        )
    if flight.autopilot is not None:
        triggered = {
            "outputs": ", which triggers the camera by its own outputs (--camera-control)",
            "mavlink": ", which triggers the camera by MAVLink (--camera-control)",
        }
        yield "Autopilot", flight.autopilot + triggered.get(flight.camera_control or "", "")
    known = (flight.drone, flight.takeoff, flight.flight_time_min, flight.resume_at)
    if any(value is not None for value in known) or len(route.flights) > 1:
        count = len(route.flights)
        each = f"{count}, the longest" if count > 1 else "1,"
        longest = max(flight.time_s for flight in route.flights)
        yield "Flights", f"{each} {duration(longest)} with take-off and return"
    if flight.flight_time_min is not None:
        endurance = flight.drone.endurance_min if flight.drone is not None else None
        of = "" if endurance is None else f" of {endurance:g} min in still air"
        yield "Battery", f"{flight.flight_time_min:g} min{of} are planned (--flight-time)"
    if route.datum is not None:
        low = plan.altitude_m + plan.inputs.focal_height_m - route.closer_by_m
        ground = plan.waypoints.ground_m
        assert ground is not None  # With a terrain file, this height is known.
        yield (
            "Terrain",
            f"{min(ground):.0f} to {max(ground):.0f} m above {route.datum}; the flight is at "
            f"least {low:.1f} m above ground",
        )


CURVE_SHOWN = (1.0, 2.0, 3.0, 5.0, 8.0)
"""Absolute contrasts for which the probability of detection is shown."""


def detection_rows(plan: Plan) -> Iterable[tuple[str, str]]:
    """Rows with the probability of detection: as a sentence, and for several contrasts."""
    found = plan.detection
    assert found is not None
    yield "Detection", detection_text(plan)
    if plan.layout.survey is not None:
        samples = plan.solution.pattern.samples
        yield (
            "",
            (
                f"this probability is for a place that is in {samples} photos; --detection-map "
                "computes the mean over the area"
            ),
        )
    contrast, offset, crowns = found.signature
    assumed = f"assumed signature {found.assumed}: " if found.assumed else ""
    yield "", f"{assumed}contrast {contrast:g}, canopy offset {offset:+g}, crown share {crowns:.0%}"
    curve = [f"{at:g}: {share:.0%}" for at, share in found.curve if abs(at) in CURVE_SHOWN]
    yield "", "share found at contrast " + ", ".join(curve)


def detection_text(plan: Plan) -> str:
    """The detection of a plan's target as one sentence."""
    detection, find = plan.detection, plan.inputs.find
    assert detection is not None  # The plan has a target to find.
    assert find is not None
    width, length = detection.target
    who = "people" if find.name == PERSON else f"targets of {width:g} x {length:g} m"
    alarms = detection.false_alarms
    rate = "one false alarm" if alarms == 1.0 else f"{alarms:g} false alarms"
    return (
        f"of 100 {who} lying there, {_of_a_hundred(detection.probability, 'about ')} would be found "
        f"at {rate} per hectare; {_of_a_hundred(detection.unseen)} of the 100 are almost completely hidden"
    )


def _of_a_hundred(share: float, about: str = "") -> str:
    """A share as a number out of a hundred. Shares above 0 are not rounded to 0, and shares below 1
    are not rounded to 100.
    """
    hundred = 100.0 * share
    if 0.0 < hundred < 0.5:
        return "fewer than 1" if hundred >= 0.05 else "0"
    return "more than 99" if 99.5 <= hundred < 99.95 else f"{about}{hundred:.0f}"


def map_rows(
    found: DetectionMap | None, success: SearchSuccess | None
) -> Iterable[tuple[str, str]]:
    """Rows with the results of a detection map."""
    if found is None:
        return
    yield "", ""
    for index, text in enumerate(search_map_texts(found, success)):
        yield "Search" if index == 0 else "", text.removesuffix(".")


def search_map_texts(found: DetectionMap, success: SearchSuccess | None) -> list[str]:
    """Results of a detection map in sentences."""
    document = found.document(success)
    ground = "area" if found.ground == "area" else "ground that the photos show"
    photos = document["photos"]
    lines = [
        (
            f"{found.mean:.1%} on average over the {ground} "
            f"({found.cells.area_m2 / 1e4:.3g} ha). A place is in {photos['mean']:.3g} photos on "
            f"average ({photos['least']} to {photos['most']})."
        )
    ]
    if document["unseen_share"] > 0.0:
        lines.append(f"No photo shows {document['unseen_share']:.1%} of this ground.")
    if found.sweep_width_m is not None:
        lines.append(f"The line has a sweep width of {found.sweep_width_m:.3g} m.")
    if success is not None:
        lines.append(
            f"The target is on this ground with a probability of {success.area:.1%} (POA).  "
            f"It is on this ground and is found with a probability of {success.success:.1%} "
            "(POS)."
        )
    return lines


OBJECTIVE_TEXTS = {
    "detection": "{:.1%} found",
    "visibility": "V = {:.1%}",
    "contrast": "contrast {:.3g}",
    "samples": "N = {:.0f}",
    "aperture": "extent {:.1f} m",
    "time": "{:.0f} s",
}
"""Text of each objective in the table."""


def search_rows(plan: Plan) -> Iterator[tuple[str, str]]:
    """Yield the heading and the text of each row about a flight in the order of gain, and about the
    best plans.
    """
    if plan.gain is not None:
        yield from gain_rows(plan.gain)
    if plan.within is not None:
        yield from within_rows(plan.within, "Within" if plan.gain is None else "Whole area")


def within_rows(answer: WithinResult, heading: str = "Within") -> Iterator[tuple[str, str]]:
    """Yield the heading and the text of each row.  The first row has the given heading."""
    for index, row in enumerate(answer.rows):
        first, second = row_text(row, answer.asked.optimize)
        yield heading if index == 0 else "", first
        if second:
            yield "", second


def row_text(row: WithinRow, objective: str) -> tuple[str, str]:
    """Text with the objective and the flight of the best plan for a given time."""
    start = f"{row.minutes:.4g} min: "
    if row.timed is None or row.value is None:
        return start + "no plan is possible", ""
    shape, way, _ = row.timed.candidate
    along_m, across_m = shape.along * way.altitude_m, shape.across * way.altitude_m
    value = OBJECTIVE_TEXTS[objective].format(abs(row.value))
    how = "while flying" if way.inputs.flight.trigger == "distance" else "at stops"
    flights = "" if row.timed.flights == 1 else f" and {row.timed.flights} flights"
    minutes = math.ceil(row.timed.time_s / 6.0) / 10.0
    apart = (
        f"{along_m:.1f}"
        if shape.samples == shape.columns and along_m == across_m
        else (f"{along_m:.1f} x {across_m:.1f}")
    )
    return (
        f"{start}{value} with {row.timed.sites:,} photos {how}, in {minutes:g} min{flights}",
        f"{shape.samples} photos of each point, {apart} m apart, from {way.altitude_m:.4g} m",
    )


def guided_rows(guided: GuidedResult) -> Iterator[tuple[str, str]]:
    """Yield the heading and the text of each row."""
    chosen, doubts, *plain = guided_texts(guided)
    yield "Guided", chosen.removesuffix(".")
    yield "", doubts.removesuffix(".")
    for index, text in enumerate(plain):
        yield "Plain grid" if index == 0 else "", text.removesuffix(".")


def guided_texts(guided: GuidedResult) -> list[str]:
    """Sentences about the choice of guided positions, about its uncertainty, and about
    plain grids.
    """
    return [
        "The positions were chosen with one half of the pulses, and V is predicted with the other "
        f"half (with the half used for the choice: {percent(guided.chosen_expected)}).",
        f"V = {percent(guided.least_expected)} if there is dense foliage wherever no pulse has "
        f"passed; {percent(guided.unseen_share)} of the area is in no photo.",
        *map(plain_text, guided.plain[:2]),
    ]


def plain_text(flight: PlainFlight) -> str:
    """Short description of a plain grid with the same flight time."""
    how = "while flying" if flight.trigger == "distance" else "at stops"
    pattern = flight.pattern
    shape = {
        "line": f"Line of {pattern.columns}",
        "lanes": f"Lanes of {pattern.rows} x {pattern.columns}",
        "square": f"Square of {pattern.rows} x {pattern.columns}",
        "trimmed": f"Trimmed grid of {pattern.samples}",
    }[flight.kind]
    return (
        f"{shape} {how}, {flight.time_s / 60.0:.1f} min: V = "
        f"{percent(flight.prediction.expected)}; {percent(flight.unseen_share)} of the area is in no photo."
    )


def position_rows(found: ReciprocalMap | None) -> Iterator[tuple[str, str]]:
    """Yield rows with the results of a map of camera positions."""
    if found is None:
        return
    east_m, north_m, most = found.best
    known = found.document()
    yield "", ""
    yield (
        "Positions",
        f"a camera sees {percent(known['mean'])} of the {found.target_area_m2:.3g} m² on average, and "
        f"{percent(most)} from the best position, {east_m:.3g} m east and {north_m:.3g} m north",
    )


def opacity_rows(opacity: dict[str, Any]) -> list[tuple[str, str]]:
    """Rows about the opacity of a point cloud, from the document of ``scene --json``."""
    if opacity["source"] != "pulses":
        return [("Opacity", "each voxel that contains a point is opaque (assumed, not measured)")]
    first, weighted, last, sampled = (
        f"{100.0 * opacity[name]:.1f} %"
        for name in ("gap_first", "gap_weighted", "gap_last", "sampled_share")
    )
    low, high = opacity["zenith_deg"]
    several = "s" if opacity["lines"] != 1 else ""
    energy = (
        "energies of the returns from calibrated intensities"
        if opacity["energy"] == "intensity"
        else "equal energies of all returns of a pulse"
    )
    return [
        (
            "Opacity",
            f"from {opacity['pulses']} pulses of {opacity['lines']} flight line{several}, "
            + (f"{low:.0f}° to {high:.0f}° off nadir" if high else "treated as vertical"),
        ),
        ("Gaps", f"{weighted} of the pulses' energy reaches the ground ({energy})"),
        (
            "",
            f"{first} if all energy of each pulse were in its first return, {last} if all energy were "
            "in its last return",
        ),
        (
            "Sampled",
            f"pulses cross {sampled} of the voxels below the top of the canopy; leaves are "
            f"cells of {opacity['leaf_size_m']:.2g} m",
        ),
    ]
