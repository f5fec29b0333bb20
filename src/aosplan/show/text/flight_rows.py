"""Rows of a plan's table about its flight: speed, wind, autopilot, battery and terrain."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.units import duration

if TYPE_CHECKING:
    from collections.abc import Iterable

    from aosplan.planning.result import Plan


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
