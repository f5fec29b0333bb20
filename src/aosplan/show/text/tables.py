"""Printing of results as tables with at most 80 columns, with a drawing of the grid."""

from __future__ import annotations

import math
import re
import sys
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

from aosplan.grid.spiral import Spiral
from aosplan.show.text import plan_rows
from aosplan.show.text.grid_drawing import flight_picture, grid_picture
from aosplan.show.text.imperial import imperial, is_imperial
from aosplan.show.text.terminal import (
    is_coloured,
    is_styled,
    is_terminal,
    readable,
    speaks_unicode,
    written_text,
)
from aosplan.solver.solution import BEST
from aosplan.units import percent

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from rich.console import RenderableType

    from aosplan.areas.survey import Survey
    from aosplan.grid.patterns import AnyPattern
    from aosplan.maps.detection_map import DetectionMap, SearchSuccess
    from aosplan.maps.reciprocal_map import ReciprocalMap
    from aosplan.models.model import Prediction
    from aosplan.planning.result import Plan
    from aosplan.planning.sensitivity import Change
    from aosplan.scenes.scene import Scene
    from aosplan.simulation.compare import Simulation

WIDTH = 80
NARROWEST = 20
"""Smallest width that is assumed for a terminal. Narrower terminals wrap lines themselves."""

PADDING = re.compile(r" +((?:\x1b\[[0-9;]*m)*)$")
"""Matches spaces at the end of a line, and escape sequences after them."""

UNBROKEN = 20
"""Largest number of characters of a cell that is never wrapped."""

BANDS = 20
"""Largest number of bands of a density profile."""

MOST_NAMED = 60
"""Largest number of characters of a name that are shown."""


HEADLINES = ("Baseline", "Samples", "Visibility")
"""Rows of a plan with the main results.  They are coloured if the terminal has colours."""

ROW_STYLES = dict.fromkeys(HEADLINES, "bold cyan") | {"Limit": "yellow"}


def screen_width() -> int:
    """Width of the output: the width of the terminal, but at most 80.  It is 80 if the output is
    not a terminal.
    """
    return max(min(Console().width, WIDTH), NARROWEST) if is_terminal(sys.stdout) else WIDTH


def show(*parts: RenderableType) -> None:
    """Print to stdout with at most 80 columns.  The text is styled on a terminal, and plain
    otherwise.
    """
    screen = Console(
        width=screen_width(),
        highlight=False,
        color_system="standard" if is_styled(sys.stdout) else None,
        no_color=not is_coloured(sys.stdout),
        force_terminal=True,
        legacy_windows=False,
    )
    with screen.capture() as capture:
        screen.print(*parts, sep="\n")
    # rich pads tables with spaces on the right, which are removed here.
    print("\n".join(PADDING.sub(r"\1", line) for line in capture.get().splitlines()))


def print_plan(
    plan: Plan,
    written: Sequence[str],
    found: DetectionMap | None = None,
    success: SearchSuccess | None = None,
    positions: ReciprocalMap | None = None,
) -> None:
    """Print the summary of a plan, its maps if there are any, its grid, and the next steps."""
    table = _pairs(
        [
            *_plan_rows(plan),
            *plan_rows.map_rows(found, success),
            *plan_rows.position_rows(positions),
        ]
    )
    picture = _picture(plan)
    drawing = [Text(""), *(Text("  " + line) for line in picture)] if picture else []
    show(table, *drawing, Text(""), one_line(_next_step(plan, written)))


def _picture(plan: Plan) -> list[str]:
    """Drawing of the flight over an area, or of the grid of a plan."""
    plain, width = not speaks_unicode(), screen_width() - 2
    if plan.layout.survey is None and plan.guided is None:
        return grid_picture(plan.solution.pattern, plain=plain, width=width)
    flown = plan.waypoints
    return flight_picture(
        list(zip(flown.east_m, flown.north_m, strict=True)), plain=plain, width=width
    )


def _plan_rows(plan: Plan) -> Iterable[tuple[str, str]]:
    solution, prediction = plan.solution, plan.solution.prediction
    pattern, inputs = solution.pattern, plan.inputs
    yield "Scene", _scene_text(plan.scene, custom_base=inputs.request.scene is None)
    yield "Camera", _named(plan.camera.title, plan.camera.name)
    above = "ground" if inputs.focal_height_m == 0.0 else f"a plane {inputs.focal_height_m:g} m up"
    yield "Altitude", f"{plan.altitude_m:.4g} m above the focal plane ({above})"
    rule = f", with d̂ ≥ 1 for {100 * inputs.coverage:.4g} % of the occluders"
    near = f", approximated by the scene's {plan.approximation}" if plan.approximation else ""
    targets = {
        "interior": ", for targets whose rays stay on the plot",
        "wrapped": ", on a plot that is repeated beyond its edges",
    }
    if plan.guided is not None:
        targets["interior"] = f", of {plan.guided.target_area_m2:.3g} m² of ground"
    measured = f"{near}{targets.get(plan.edges or '', '')}"
    if plan.reading == "slices":
        rule = (
            ", in slices one occluder thick, because b is smaller than the coverage rule requires"
        )
    yield "Model", plan.model + {"uniform": rule, "measured": measured}.get(plan.model, "")
    yield "", ""
    x, y = plan.extent_m
    if plan.guided is None:
        yield "Baseline", f"b = {solution.baseline_m:,.2f} m"
        yield "Samples", f"N = {pattern.samples:,}, {_shape_text(pattern, plan.grid.name)}"
        yield (
            "Aperture",
            f"a = {plan.aperture_m:,.1f} m (Eq. 5); extent of the grid {x:,.1f} x {y:,.1f} m",
        )
    else:
        yield "Samples", f"N = {pattern.samples:,}, at guided positions"
        yield "Aperture", f"{x:,.1f} x {y:,.1f} m, along and across the heading"
    if prediction.density > 0.0:
        request = inputs.request
        asked = request.vhat if request.visibility is None else request.visibility
        target = f" (target {plan.requirement.symbol} = {asked})"
        target = "" if inputs.objective in BEST else target
        errors = plan.uncertainty
        yield (
            "Visibility",
            f"V̂ = {percent(prediction.normalized)}{_error(errors and errors.normalized)}, "
            f"V = {percent(prediction.expected)}{_error(errors and errors.expected)}{target}",
        )
        contrast = prediction.contrast
        one, mean = percent(plan.one_photo), percent(prediction.minimum)
        yield (
            "",
            "V of one photo "
            f"{one}{'' if one == mean else f' straight down, {mean} on average'}, of "
            f"infinitely many photos {percent(prediction.maximum)}"
            + (f"; contrast {contrast:.4g}" if math.isfinite(contrast) else ""),
        )
        if plan.ground is not None:
            yield "On ground", _ground_text(plan)
    else:
        yield "Visibility", "V = 100 %, because nothing is hidden"
    if plan.detection is not None:
        yield from plan_rows.detection_rows(plan)
    yield from plan_rows.search_rows(plan)
    yield from (() if plan.guided is None else plan_rows.guided_rows(plan.guided))
    yield "", ""
    yield from _camera_rows(plan)
    for limit in plan.limits:
        yield "Limit", limit.message
    if plan.sensitivity:
        yield "", ""
        yield from _sensitivity_rows(plan.sensitivity)


def _ground_text(plan: Plan) -> str:
    """Visibility over the ground of the plan, compared with the visibility below its centre."""
    ground = plan.ground
    assert ground is not None
    x, y = ground.size_m
    middle = "below the middle of the grid" if plan.model == "measured" else "for vertical rays"
    return (
        f"with slanted rays, V is {percent(ground.expected)} on average and "
        f"{percent(ground.worst_expected)} at least, over {x:.3g} x {y:.3g} m (the V above "
        f"is {middle})"
    )


def _sensitivity_rows(changes: Sequence[Change]) -> Iterable[tuple[str, str]]:
    """Rows with the visibility of the planned grid in changed scenes, and with the grids that would
    be planned for these scenes.
    """
    for index, change in enumerate(changes):
        name = change.quantity.removeprefix("occluder_")
        text = f"{name} {100.0 * (change.factor - 1.0):+.0f} %: "
        if change.visibility is not None:
            normalized = "" if change.normalized is None else f"V̂ = {percent(change.normalized)}, "
            text += f"{normalized}V = {percent(change.visibility)}"
            text += "; " if change.reason is None else "; no plan: "
        if change.reason is None:
            text += f"plan N = {change.samples}, b = {change.baseline_m:.2f} m"
        else:
            text += change.reason
        yield "Sensitivity" if index == 0 else "", text


def _error(standard_error: float | None) -> str:
    """Text of a standard error in per cent, which is printed after the value."""
    if standard_error is None:
        return ""
    percent = 100.0 * standard_error
    return f" ± {percent:.1f} %" if percent >= 0.05 or percent == 0.0 else f" ± {percent:.1g} %"


def _camera_rows(plan: Plan) -> Iterable[tuple[str, str]]:
    camera, altitude = plan.camera, plan.altitude_m
    footprint, common = camera.footprint_m(altitude), plan.common_footprint_m
    yield "Resolution", f"{100.0 * camera.gsd_m(altitude):.3g} cm per pixel"
    yield "Footprint", f"{footprint[0]:.1f} x {footprint[1]:.1f} m, along and across the heading"
    if min(common) > 0.0:
        yield "", f"{common[0]:.1f} x {common[1]:.1f} m of it is in all photos"
    else:
        yield "", "no ground is in all photos"
    disparity = plan.disparity
    if disparity["pixels"] is not None and plan.guided is None:
        yield (
            "Disparity",
            f"{disparity['pixels']:.3g} px for an occluder of "
            f"{disparity['occluder_pixels']:.3g} px (d̂ = {disparity['normalized']:.3g})",
        )
    if plan.layout.survey is not None:
        yield from _area_rows(plan.layout.survey)
    yield from plan_rows.flight_rows(plan)
    if plan.layout.continuous is not None:
        for integral in plan.layout.continuous.by_samples:
            yield (
                "Integral" if integral.samples == 1 else "",
                f"of {integral.samples} photos: {integral.length_m:.1f} m, "
                f"{integral.duration_s:.1f} s, V̂ = {percent(integral.normalized)}, V = "
                f"{percent(integral.expected)}",
            )


def _area_rows(survey: Survey) -> Iterable[tuple[str, str]]:
    covered = 100.0 * survey.covered_share
    yield (
        "Area",
        f"{survey.area_m2 / 1e4:.4g} ha, {covered if covered == 100.0 else min(covered, 99.99):.4g} % "
        f"of it covered from {survey.sites:,} sites",
    )
    over = (
        f"; the path is at most {survey.length_m / survey.shortest_m:.3g} times as long as the shortest path"
        if survey.shortest_m
        else ""
    )
    yield "", f"lines {survey.axis} the heading{over}"


def _scene_text(scene: Scene, *, custom_base: bool) -> str:
    low = min((slab.bottom_m for slab in scene.slabs()), default=0.0)
    base = f"base {low:.3g} m" if custom_base else f"occluders from {low:.3g}"
    joint = ", top" if custom_base else " to"
    return (
        f"{_named(scene.title, scene.name)}: p = {percent(scene.integrated_density)}, "
        f"{base}{joint} {scene.canopy_top_m:.3g} m"
    )


def one_line(text: str, style: str = "") -> Text:
    """Text without markup and control characters, in characters that the terminal supports."""
    return Text(readable(text), style=style)


def _named(title: str, name: str) -> str:
    return f"{_short(title)} ({_short(name)})" if title else _short(name)


def _short(name: str) -> str:
    """A shortened name.  Names from files may be long."""
    return name if len(name) <= MOST_NAMED else f"{name[: MOST_NAMED - 1]}…"


def _shape_text(pattern: AnyPattern, kind: str) -> str:
    if isinstance(pattern, Spiral):
        return f"spiral, turns {pattern.turn_pitch:g} baselines apart"
    text = f"{kind} grid of {pattern.rows} x {pattern.columns}"
    removed = getattr(pattern, "removed", ())
    return f"{text} without {len(removed)} sites" if removed else text


def _next_step(plan: Plan, written: Sequence[str]) -> str:
    if written:
        return written_text(written)
    if not plan.inputs.request.has_place:
        return "Next: add --origin LAT,LON --heading DEG --out plan.geojson for the waypoints."
    return "Next: add --out plan.geojson or --out plan.csv to write the waypoints."


def print_rows(header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table with a header.  If it is too wide for the terminal, each row is printed as a
    paragraph.
    """
    shown = [[readable(cell) for cell in row] for row in rows]
    names = [readable(name) for name in header]
    columns = list(zip(names, *shown, strict=True))
    short = [max(map(cell_len, column)) <= UNBROKEN for column in columns]
    least = sum(
        max(cell_len(word) for cell in column for word in ([cell] if whole else cell.split(" ")))
        for column, whole in zip(columns, short, strict=True)
    )
    if least + 2 * (len(names) - 1) > screen_width():
        first, *others = names
        for row in shown:
            pairs = (
                f"{name} {cell}" if name else cell
                for name, cell in zip(others, row[1:], strict=True)
            )
            text = Text(f"{row[0] or first}: {', '.join(filter(None, pairs))}")
            show(text)
        return
    table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False, header_style="bold")
    for name, whole in zip(names, short, strict=True):
        table.add_column(Text(name), overflow="fold", no_wrap=whole)
    for row in shown:
        table.add_row(*map(Text, row))
    show(table)


def print_pairs(rows: Iterable[tuple[str, str]]) -> None:
    """Print names and texts as two columns."""
    show(_pairs(rows))


def _pairs(rows: Iterable[tuple[str, str]]) -> Table:
    """Names and texts as two columns, in the units that the environment variable ``AOSPLAN_UNITS``
    gives.
    """
    table = Table.grid(padding=(0, 2))
    table.add_column(style="bold")
    table.add_column()
    convert = imperial if is_imperial() else str
    for name, text in rows:
        table.add_row(name, one_line(convert(text), ROW_STYLES.get(name, "")))
    return table


def print_predictions(columns: dict[str, tuple[int, Prediction]]) -> None:
    """Print predictions for several sets of samples side by side, with the numbers of samples."""
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="bold")
    for name in ("", *columns):
        table.add_column(one_line(name), justify="right" if name else "left", overflow="fold")
    table.add_row("N", *(str(count) for count, _ in columns.values()))
    found = [prediction for _, prediction in columns.values()]
    hidden = [each if each.density else None for each in found]
    table.add_row("p", *(percent(each.density) for each in found))
    table.add_row("V", *(percent(each.expected) for each in found))
    table.add_row(one_line("V̂"), *(percent(each.normalized) if each else "-" for each in hidden))
    table.add_row(
        "effective samples", *(f"{each.effective_samples:.4g}" if each else "-" for each in hidden)
    )
    table.add_row("contrast", *(f"{each.contrast:.4g}" if each else "-" for each in hidden))
    show(table)


def print_simulation(
    simulation: Simulation, similar: dict[str, Any], written: Sequence[str]
) -> None:
    """Print a prediction and its simulation, and whether they agree."""
    plan, found, settings = simulation.plan, simulation.simulated, simulation.settings
    pattern = plan.solution.pattern
    view = "" if settings.forest == "noise" else f", {settings.view} view"
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="bold")
    for name in ("", "planned", "predicted", "simulated", "standard error"):
        table.add_column(one_line(name), justify="right" if name else "left", overflow="fold")
    for symbol, name in (("p", "density"), ("V", "expected"), ("V̂", "normalized")):
        value, error = getattr(found, name), getattr(found, f"{name}_standard_error")
        if math.isnan(value):
            continue
        models = (plan.solution.prediction, simulation.predicted)
        numbers = [*(getattr(model, name) for model in models), value]
        # Very small numbers are replaced by 0. Otherwise, they could be printed as -0.
        shown = [percent(number if abs(number) > 5e-5 else 0.0) for number in numbers]
        table.add_row(one_line(symbol), *shown, f"{100 * error:.2f} %")
    agree = "agree." if simulation.agree else "disagree:"
    verdict = [f"Predicted and simulated {agree}"]
    verdict += [f"  {difference}" for difference in simulation.differences]
    if simulation.as_flown:
        verdict += ["Some values of the plan are not valid for the slanted rays of the photos:"]
        verdict += [f"  {difference}" for difference in simulation.as_flown]
    if similar:
        single, integral = similar["similarity"].values()
        verdict.append(
            f"SSIM to the image of infinitely many photos: one photo {single:.3f}, integral "
            f"{integral:.3f}"
        )
    if written:
        verdict.append(written_text(written))
    of = " of leaves" if simulation.occluders == "leaves" else ""
    kind = "blocks of the plot" if settings.forest == "cloud" else "volumes"
    show(
        one_line(
            f"{plan.model} model against a {settings.forest} forest{of}{view}: N = "
            f"{pattern.samples}, b = {plan.solution.baseline_m:.2f} m"
        ),
        one_line(
            f"{simulation.samples} {kind}, {simulation.targets} targets, seed {settings.seed}"
        ),
        Text(""),
        table,
        Text(""),
        *map(one_line, verdict),
    )


def print_scene(document: dict[str, Any]) -> None:
    """Print occluder statistics: the summary, and a profile of the layers."""
    rows = [
        ("Scene", _named(document["title"], document["name"])),
        ("Density", f"p = {percent(document['integrated_density'])} of the ground is hidden"),
        ("", f"on average, occluders fill {percent(document['mean_density'])} of a slice"),
        ("Canopy", f"top {document['canopy_top_m']:.1f} m above ground"),
    ]
    if document["assumed"]:
        rows.append(("Assumed", document["assumed"]))
    if document.get("points"):
        rows.append(
            (
                "Points",
                f"{document['points']} ({document['points_per_m2']:.0f} per m²), voxels of "
                f"{document['voxel_m']:g} m, ground method {document['ground']}",
            )
        )
    if "opacity" in document:
        rows += plan_rows.opacity_rows(document["opacity"])
    if "plot_m" in document:
        width, depth = document["plot_m"]
        rows.append(("Plot", f"{width:.4g} x {depth:.4g} m"))
    if "density_by_angle" in document:
        rows.append(("p off nadir", _by_angle(document["density_by_angle"])))
    for share in (0.5, 0.9, 0.98):
        over_altitude = next(
            (b for b, covered in document["baseline_curve"] if covered >= share), None
        )
        if over_altitude is not None:
            rows.append(
                (f"b for {100 * share:g} %", f"{over_altitude:.4g} times the altitude above ground")
            )
    profile = density_profile(document["layers"])
    show(_pairs(rows), *([Text(""), *profile] if profile else []))


def _by_angle(pairs: Sequence[Sequence[float]]) -> str:
    """The density at a few angles, interpolated between the computed angles."""
    shown = []
    for wanted in (0.0, 10.0, 20.0, 30.0, 40.0):
        for (low, before), (high, after) in pairwise(pairs):
            if low <= wanted <= high:
                between = before + (after - before) * (wanted - low) / (high - low)
                shown.append(f"{wanted:.0f}° {percent(between)}")
                break
    return ", ".join(shown)


def density_profile(layers: Sequence[dict[str, float]]) -> list[Text]:
    """Bars of density by height, from the top down, in at most twenty bands."""
    if not layers:
        return []
    top = max(layer["top_m"] for layer in layers)
    band = max(top / BANDS, 1.0)
    filled = [0.0] * (int(top / band - 1e-9) + 1)
    for layer in layers:
        low, high = layer["bottom_m"] / band, layer["top_m"] / band
        for index in range(int(low), min(math.ceil(high), len(filled))):
            within = max(min(high, index + 1) - max(low, index), 0.0)
            filled[index] += layer["density"] * within
    densest = max(filled) or 1.0
    bar = "█" if speaks_unicode() else "#"
    return [
        Text(f"{index * band:6.1f} m  {percent(density):>7}  {bar * round(40 * density / densest)}")
        for index, density in reversed(list(enumerate(filled)))
    ]
