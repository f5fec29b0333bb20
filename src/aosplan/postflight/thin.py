"""Thinning of a recording: selects its best views for a scene, and compares them with all views."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan import __version__
from aosplan.errors import RequestError
from aosplan.messages import SCHEMA, Message
from aosplan.models.model import prediction_document
from aosplan.planning.options import SHOWING
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.postflight.best_views import check_count, choose_views
from aosplan.postflight.views import Views, in_axes, predicted

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from aosplan.models.model import Prediction
    from aosplan.planning.result import Plan

QUANTITIES = ("normalized", "visibility", "similarity")
"""Quantities that a selection can maximise: V̂, V, or the similarity to the integral of all
views.
"""

MORE_HIDDEN = 0.02
"""A selection with the largest V̂ can have a larger density p than all views. If p is larger by
more than this, there is a warning.
"""

ADDED = "original_index"
"""Name of the column with the index of a view among all views of the original recording."""


class Thinning(NamedTuple):
    """The indices of the chosen views in increasing order, and predictions for these views and for
    all views.

    The plan provides the scene and the model.  Its sites are not used.  If there is a target,
    `detection` has the probability of detection with all views and with the chosen views.
    """

    plan: Plan
    views: Views
    east_m: list[float]
    north_m: list[float]
    origin: tuple[float, float] | None
    chosen: list[int]
    best: str
    every: Prediction
    kept: Prediction
    warnings: tuple[Message, ...]
    detection: tuple[float, float] | None = None

    @property
    def bound(self) -> Prediction:
        """Prediction for the same number of views, if they did not share occluders: K = 1/N."""
        return self.kept._replace(shortfall=1.0 / len(self.chosen))

    def document(self) -> dict[str, Any]:
        """The selection as plain values: the output of ``thin --json``."""
        request = self.plan.request.document()
        return {
            "schema": SCHEMA,
            "version": __version__,
            "request": {name: value for name, value in request.items() if name in SHOWING},
            "model": self.plan.model,
            "origin": None if self.origin is None else list(self.origin),
            "positions": len(self.views),
            "samples": len(self.chosen),
            "best": self.best,
            "all": prediction_document(self.every),
            "kept": prediction_document(self.kept),
            "bound": prediction_document(self.bound),
            **(
                {}
                if self.detection is None
                else {"detection": dict(zip(("all", "kept"), self.detection, strict=True))}
            ),
            "views": [
                {
                    "index": index,
                    "name": self.views.name(index),
                    "east_m": self.east_m[index],
                    "north_m": self.north_m[index],
                    "latitude": None if self.views.places is None else self.views.places[index][0],
                    "longitude": None if self.views.places is None else self.views.places[index][1],
                }
                for index in self.chosen
            ],
            "warnings": [warning._asdict() for warning in self.warnings],
        }

    def render(self) -> bytes:
        """The chosen views in their original format, with their indices in the column `ADDED`.

        The result is a CSV file.  For a folder of photos, it has the name of one photo per line.
        If the file already has the column `ADDED`, the column is kept, because its indices refer to
        the original recording.
        """
        rows = [self.views.rows[index] for index in self.chosen]
        if self.views.is_folder:
            return "".join(f"{name}\n" for (name,) in rows).encode("utf-8", "surrogateescape")
        again = ADDED in self.views.header
        text = io.StringIO()
        out = csv.writer(text, lineterminator="\n")
        out.writerow(self.views.header if again else [ADDED, *self.views.header])
        for index, row in zip(self.chosen, rows, strict=True):
            out.writerow(row if again else [index, *row])
        return text.getvalue().encode()


def thin_views(
    wanted: PlanRequest,
    views: Views,
    samples: int,
    *,
    best: str = "normalized",
    folder: str = "",
    progress: Callable[[int, int], None] | None = None,
) -> Thinning:
    """Choose the views that share the fewest occluders.

    Parameters
    ----------
    wanted
        Scene, altitude, camera and model, and the origin if the views have latitude and longitude.
        The default of the origin is the centre of the views.
    views
        The recorded views.
    samples
        Number of views to choose.
    best
        Quantity to maximise, one of `QUANTITIES`.
    folder, progress
        As in `aosplan.planning.planner.plan`.

    Raises
    ------
    RequestError
        If there are too few or too many views, or if there are no occluders.
    """
    if not isinstance(wanted.heading, float):
        raise RequestError(
            f"--heading {wanted.heading} is not possible for photos that are already recorded",
            "give --heading DEG, the direction of the flight lines",
        )
    check_count(len(views), samples)
    origin = wanted.origin
    if views.places is not None and origin is None:
        origin = views.middle(wanted.heading)
    kept = {name: getattr(wanted, name) for name in SHOWING}
    # A plan with one photo is computed, because it provides the scene and the model, and checks
    # them.
    scene = plan(
        PlanRequest(**kept, samples=1, baseline=1.0),
        folder=folder,
        progress=progress,
    )
    if scene.problem is None:
        raise RequestError("no occluder is above the focal plane, so one photo shows everything")
    east, north = views.local_m(origin)
    points = in_axes(scene, east, north)
    model = scene.problem.model
    hidden = None if best == "normalized" else model.hidden_at(points)
    chosen = choose_views(points, samples, model.correlation, hidden, alike=best == "similarity")
    every, few = predicted(scene, points), predicted(scene, points[chosen])
    # The warning about few photos is removed, because it refers to this plan with one photo.
    notices = [notice for notice in scene.notices if notice.code != "detection_few_photos"]
    warnings = [*notices, *views.messages()]
    if hidden is None and few.density > every.density + MORE_HIDDEN:
        warnings.append(
            Message(
                "more_hidden",
                "photos that share few occluders are far apart, and their slanted rays cross "
                f"more foliage: V = {few.expected:.3g} for the selected photos and "
                f"{every.expected:.3g} for all; --best visibility maximises V",
            )
        )
    return Thinning(
        scene,
        views,
        east,
        north,
        origin,
        chosen.tolist(),
        best,
        every,
        few,
        tuple(warnings),
        _detections(scene, points, points[chosen]),
    )


def _detections(
    scene: Plan, every_m: NDArray[np.float64], chosen_m: NDArray[np.float64]
) -> tuple[float, float] | None:
    """Probability that the target is found with all views, and with the chosen views."""
    if scene.inputs.find is None:
        return None
    from aosplan.planning.plan_detection import detection_at

    every, few = (detection_at(scene.inputs, points).probability for points in (every_m, chosen_m))
    return every, few
