"""Simulated pictures for the page: a single photo, and the integral image of all photos of the
plan.
"""

from __future__ import annotations

from base64 import b64encode
from typing import TYPE_CHECKING, NamedTuple

from aosplan.errors import RequestError

if TYPE_CHECKING:
    from aosplan.planning.result import Plan
    from aosplan.scenes.occlusion import ViewKind

MOST_VIEWS = 500
"""Largest number of photos that are simulated.  They take a few seconds."""


class SimulatedPhotos(NamedTuple):
    """Pictures of a simulation as data URLs, or the reason why there are none.

    Attributes
    ----------
    seed
        Random seed.
    missing
        Reason why there are no pictures; empty if there are pictures.
    single, integral, endless
        Pictures of a resolution chart behind trees: in the middle photo, in the integral image of
        all photos, and in the integral image of infinitely many photos.
    size
        Number of columns and of rows of each picture.
    expected, single_visibility
        V of the integral image, and share of the targets that the middle photo sees, in this
        volume.
    predicted
        V that the model predicts for the same rays.
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


def simulated_photos(plan: Plan, seed: int | None) -> SimulatedPhotos:
    """Simulate a plan over one volume of the forest that corresponds to its scene."""
    if seed is None:
        return SimulatedPhotos(None, "left out, as requested")
    if plan.guided is not None:
        return SimulatedPhotos(
            seed,
            "left out: the picture shows another forest, but guided positions are chosen for one place",
        )
    if plan.solution.pattern.samples > MOST_VIEWS:
        return SimulatedPhotos(
            seed,
            f"left out: {plan.solution.pattern.samples} photos are too many to simulate "
            f"quickly (more than {MOST_VIEWS}); use aosplan simulate",
        )
    from aosplan.simulation.compare import Settings, experiment_of
    from aosplan.simulation.pictures import panels, png

    try:
        settings, experiment, predicted = experiment_of(plan, Settings(seed=seed, view=_view(plan)))
    except RequestError as error:
        return SimulatedPhotos(seed, f"left out: {error.message}")
    if experiment is None:
        return SimulatedPhotos(
            seed, "left out: no occluder is above the focal plane, so nothing is hidden"
        )
    every, one = experiment.images()
    seen = panels(every, one, plan.solution.pattern.samples)
    single, integral, endless = (
        "data:image/png;base64," + b64encode(png(image)).decode()
        for image in (seen.single, seen.integral, seen.endless)
    )
    rows, columns = seen.share.shape
    return SimulatedPhotos(
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
    """The view of the measured model. For other models, the view is perspective if all photos have
    ground in common, and telecentric otherwise.
    """
    if plan.inputs.view is not None:
        return "perspective" if plan.inputs.view == "perspective" else "telecentric"
    return "perspective" if min(plan.common_footprint_m) > 0.0 else "telecentric"
