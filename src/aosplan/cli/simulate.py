"""The command ``aosplan simulate``."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from aosplan import units as q
from aosplan.cli.options import (
    command,
    defaults_option,
    flag_option,
    json_option,
    request_argument,
    request_options,
    text_option,
)
from aosplan.cli.output import print_json, print_warnings, progress_bar, waiting_bar
from aosplan.errors import RequestError
from aosplan.planning.loaded_scene import without_simulated_view
from aosplan.planning.planner import plan
from aosplan.planning.user_defaults import request_of

if TYPE_CHECKING:
    from aosplan.planning.request import PlanRequest
    from aosplan.planning.result import Plan
    from aosplan.simulation.compare import Settings, Simulation
    from aosplan.simulation.compare_search import SearchComparison

LARGEST_SEED = 2**63 - 1


def run(
    *,
    request: str | None,
    seed: str | None,
    precision: str | None,
    forest: str | None,
    occluders: str | None,
    max_targets: str | None,
    picture: str | None,
    occlusion_map: str | None,
    force: bool,
    quiet: bool,
    as_json: bool,
    defaults: str | None,
    **flags: Any,
) -> None:
    """Simulate a plan over a forest and compare the result with its prediction."""
    wanted = request_of(request, flags, defaults=defaults)
    chosen = _settings(wanted, seed, precision, forest, occluders, max_targets)
    if wanted.find is not None and chosen.forest == "noise":
        raise RequestError(
            "--forest noise has no ground on which targets could lie",
            "leave out --find or --forest noise",
        )
    outputs = _outputs(picture, occlusion_map, force=force)
    with progress_bar(quiet=quiet) as bar:
        folder = os.path.dirname(request or "")
        result = plan(
            without_simulated_view(wanted), folder=folder, progress=bar, on_trial=bar.on_trial
        )
    print_warnings(result.warnings, quiet=quiet)
    from aosplan.simulation.compare import simulate

    with waiting_bar("simulating", quiet=quiet) as progress:
        simulation = simulate(result, chosen, progress=progress)
    searched = _search(result, chosen, quiet=quiet)
    similar = _draw(simulation, outputs, force=force) if outputs else {}
    if not (simulation.precise or simulation.settings.forest == "cloud" or quiet):
        _warn_if_imprecise(simulation)
    if as_json:
        found = {} if searched is None else {"search": searched.document()}
        print_json(simulation.document() | similar | found)
    elif not quiet:
        from aosplan.show.text.tables import print_simulation

        print_simulation(simulation, similar, [path for _, path in outputs])
        if searched is not None:
            from aosplan.show.text.search_table import print_search

            print_search(searched)


def _search(result: Plan, settings: Settings, *, quiet: bool) -> SearchComparison | None:
    """Simulate the search for the target of a plan; None if there is no target or if there are no
    occluders.
    """
    if result.detection is None or result.coverage is None:
        return None
    from aosplan.simulation.compare_search import compare_search

    with waiting_bar("searching", quiet=quiet) as progress:
        return compare_search(result, seed=settings.seed, forest=settings.forest, progress=progress)


def _settings(
    wanted: PlanRequest,
    seed: str | None,
    precision: str | None,
    forest: str | None,
    occluders: str | None,
    max_targets: str | None,
) -> Settings:
    from aosplan.simulation.compare import FORESTS, OCCLUDERS, Settings
    from aosplan.simulation.experiments import check_views

    # This is checked first, because planning many samples takes seconds.
    check_views(wanted.samples)

    given: dict[str, Any] = {"view": wanted.view or "perspective"}
    if forest is not None:
        given["forest"] = q.one_of(FORESTS)(forest, "--forest")
    if occluders is not None:
        given["occluders"] = q.one_of(OCCLUDERS)(occluders, "--occluders")
    if max_targets is not None:
        given["most_targets"] = q.whole(max_targets, "--max-targets")
    return read_settings(Settings(**given), seed, precision)


def read_settings(settings: Settings, seed: str | None, precision: str | None) -> Settings:
    """Settings updated by ``--seed`` and ``--precision``."""
    if seed is not None:
        settings = settings._replace(seed=_seed(seed))
    if precision is not None:
        settings = settings._replace(precision=q.positive(precision, "--precision"))
        if settings.precision > 1.0:
            raise RequestError(f"--precision {precision} is not a standard error of at most 1")
    return settings


def _seed(value: str) -> int:
    if not value.isascii() or not value.isdigit() or int(value) > LARGEST_SEED:
        raise RequestError(f"--seed {value} is not a whole number from 0 to {LARGEST_SEED}")
    return int(value)


def _outputs(
    picture: str | None, occlusion_map: str | None, *, force: bool
) -> list[tuple[str, str]]:
    """Names and paths of the pictures, which are checked here before any work is done."""
    outputs = [
        (name, path)
        for name, path in (("picture", picture), ("occlusion_map", occlusion_map))
        if path is not None
    ]
    if outputs:
        from aosplan.files import check_output
        from aosplan.simulation.pictures import check_extra

        for _, path in outputs:
            if not path.lower().endswith(".png"):
                raise RequestError(f"picture '{path}' does not end in .png")
            check_output(path, force=force)
        if len({os.path.realpath(path) for _, path in outputs}) < len(outputs):
            raise RequestError(f"output '{outputs[0][1]}' is given twice")
        check_extra()
    return outputs


def _draw(simulation: Simulation, outputs: list[tuple[str, str]], *, force: bool) -> dict[str, Any]:
    """Write the pictures. Returns the similarity of each picture to the image of infinitely many
    views.
    """
    from aosplan.files import write_all
    from aosplan.simulation.compare import pictures

    drawn = pictures(simulation)
    contents = {path: getattr(drawn, name) for name, path in outputs}
    write_all(contents, force=force)
    return {"similarity": {"single": drawn.single, "integral": drawn.integral}}


def _warn_if_imprecise(simulation: Simulation) -> None:
    from aosplan.messages import Message

    print_warnings(
        [
            Message(
                "imprecise",
                f"the simulation stopped after {simulation.targets} targets, but the standard "
                f"errors are still above {simulation.settings.precision:g}; give a larger "
                "--max-targets",
            )
        ]
    )


COMMAND = command(
    "simulate",
    run,
    summary="Check a plan against a simulated forest: compare the simulated visibility with the prediction.",
    examples=(
        "aosplan simulate --altitude 40\n"
        "aosplan simulate plan.json --forest clumped --seed 7 --picture forest.png"
    ),
    common=frozenset({"altitude", "vhat", "scene"}),
    parameters=[
        request_argument(),
        *request_options(),
        defaults_option(),
        text_option("--seed", "N", "Random seed.  [1]", "Simulation"),
        text_option(
            "--precision",
            "X",
            "Standard error of V and V̂ at which the simulation stops.  [0.005]",
            "Simulation",
        ),
        text_option(
            "--forest",
            "NAME",
            "Simulated forest: noise, uniform, layered, clumped (trees) or cloud (the scene's own "
            "voxels).  [by scene]",
            "Simulation",
        ),
        text_option(
            "--occluders",
            "KIND",
            "Occluders of a uniform or layered forest: cubes (their side faces also block "
            "slanted rays), or leaves (in random directions).  [cubes]",
            "Simulation",
        ),
        text_option(
            "--max-targets",
            "N",
            "Number of simulated targets at which the simulation stops, even if it has not "
            "reached --precision.  [100000000]",
            "Simulation",
        ),
        text_option(
            "--picture",
            "PATH.png",
            "Draw a resolution chart below the forest, as it looks in one photo, in the "
            "integral, and in infinitely many photos.",
            "Output",
        ),
        text_option(
            "--occlusion-map",
            "PATH.png",
            "Draw which share of the photos sees each target.",
            "Output",
        ),
        flag_option("--force", "Overwrite existing files."),
        flag_option("--quiet", "Print no table and no hints."),
        json_option(),
    ],
)
