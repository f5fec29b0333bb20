"""What one photo and the integral of all would show: a quick simulation of the very plan."""

from __future__ import annotations

from base64 import b64encode
from typing import TYPE_CHECKING, NamedTuple

from aosplan.errors import RequestError

if TYPE_CHECKING:
    from aosplan.planning.result import Plan
    from aosplan.scenes.occlusion import ViewKind

MOST_VIEWS = 500
"""More photos than these take longer than the few seconds that a page is worth."""


class Views(NamedTuple):
    """Pictures of a simulation as addresses that hold them, or why there are none.

    Attributes
    ----------
    seed
        Of everything random.
    missing
        Why there are no pictures, or empty.
    single, integral, endless
        A resolution chart through the trees: in the middle photo, in all, in endless ones.
    size
        Columns and rows of each.
    expected, single_visibility
        V of the integral, and share of the targets that the middle photo shows, in this volume.
    predicted
        The model's V for rays such as these.
    view
        ``perspective`` or ``telecentric``.
    """

    seed: int | None
    missing: str = ""
    single: str = ""
    integral: str = ""
    endless: str = ""
    size: tuple[int, int] = (0, 0)
    expected: float = 0.0
    single_visibility: float = 0.0
    predicted: float = 0.0
    view: str = ""


def views_of(plan: Plan, seed: int | None) -> Views:
    """Fly a plan over one volume of the forest that its scene describes."""
    if seed is None:
        return Views(None, "left out on request")
    if plan.solution.pattern.samples > MOST_VIEWS:
        return Views(
            seed,
            f"left out: {plan.solution.pattern.samples} photos, and more than {MOST_VIEWS} are too "
            "many to simulate quickly; use aosplan simulate",
        )
    from aosplan.simulation.compare import Settings, posed
    from aosplan.simulation.pictures import panels, png

    try:
        settings, experiment, predicted = posed(plan, Settings(seed=seed, view=_view(plan)))
    except RequestError as error:
        return Views(seed, f"left out: {error.message}")
    if experiment is None:
        return Views(seed, "left out: no occluder is above the focal plane, so nothing is hidden")
    every, one = experiment.images()
    seen = panels(every, one, plan.solution.pattern.samples)
    single, integral, endless = (
        "data:image/png;base64," + b64encode(png(image)).decode()
        for image in (seen.single, seen.integral, seen.endless)
    )
    rows, columns = seen.share.shape
    return Views(
        seed,
        "",
        single,
        integral,
        endless,
        size=(columns, rows),
        expected=1.0 - float((seen.share**2).mean()),
        single_visibility=1.0 - float(one.mean()),
        predicted=predicted.expected,
        view=settings.view,
    )


def _view(plan: Plan) -> ViewKind:
    """The measured model's own view; else all the ground in all photos, where there is any."""
    if plan.inputs.view is not None:
        return "perspective" if plan.inputs.view == "perspective" else "telecentric"
    return "perspective" if min(plan.common_footprint_m) > 0.0 else "telecentric"
