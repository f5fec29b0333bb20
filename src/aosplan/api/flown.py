"""Functions for use after the flight: `review` and `thin`."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from aosplan.api.request import found_request
from aosplan.api.summarized import Summarized, warnings_text
from aosplan.postflight import review as reviews
from aosplan.postflight import thin as thinnings
from aosplan.units import percent

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Unpack

    from matplotlib.axes import Axes

    from aosplan.api.request import RequestLike
    from aosplan.api.request_options import RequestOptions
    from aosplan.models.model import Prediction


@dataclass(frozen=True, repr=False)
class Review(Summarized, reviews.Review):
    """Comparison of a flight with its plan.

    It has the attributes of `aosplan.postflight.review.Review`: `missing` (waypoints without a
    photo), `flown` and `completed` (predictions), `topup` (a plan for the missing sites, or None).
    """

    def summary(self) -> tuple[str, dict[str, str]]:
        """The result as text: a headline and named values."""
        sites = len(self.sites)
        headline = f"{sites - len(self.missing)} of {sites} sites have a photo"
        facts = {"Photos": f"{len(self.views)}, {len(self.strays)} of them far from every site"}
        if self.errors_m is not None:
            facts["Position error"] = "{:.2f} m root mean square, {:.2f} m at most".format(
                *self.errors_m
            )
        facts["Planned"] = _shown(self.plan.solution.prediction)
        if self.flown is not None:
            facts["Flown"] = _shown(self.flown)
        return headline, facts | warnings_text(self.warnings)

    def columns(self) -> dict[str, list[Any]]:
        """The photos as columns: name, position [m], waypoint of the nearest site, distance [m]."""
        return {
            "name": [self.views.name(index) for index in range(len(self.views))],
            "east_m": list(self.east_m),
            "north_m": list(self.north_m),
            "nearest_site": [self.sites[place] for place in self.site_of],
            "off_m": self.off_m.tolist(),
        }

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the plan, the photos (crosses) and the sites without a photo (rings).

        Parameters
        ----------
        ax
            Axes to draw on; a new figure by default.
        """
        from aosplan.show.figures.axes import plotted
        from aosplan.show.figures.draw import KINDS
        from aosplan.show.figures.sources import shown_of_plan

        grid = KINDS["grid"]
        panel: Axes = plotted(grid, shown_of_plan(grid, self.plan), ax)
        panel.plot(self.east_m, self.north_m, "x", color="tab:green", zorder=8, label="photos")
        if self.missing:
            ways = self.plan.waypoints
            panel.plot(
                [ways.east_m[index] for index in self.missing],
                [ways.north_m[index] for index in self.missing],
                "o",
                ms=14,
                mfc="none",
                mec="tab:red",
                zorder=8,
                label="no photo",
            )
        panel.legend(loc="upper right", fontsize="small")
        return panel


def review(
    positions: str | os.PathLike[str],
    plan: RequestLike | None = None,
    *,
    tolerance_m: float | None = None,
    progress: Callable[[int, int], None] | None = None,
    **options: Unpack[RequestOptions],
) -> Review:
    """Compare recorded positions of photos with a plan.

    Parameters
    ----------
    positions
        A folder of photos, or a mission, CSV or GeoJSON file (``.waypoints``, ``.plan``, ``.kmz``,
        ``.mavlink``, ``.csv``, ``.geojson``).
    plan
        A plan, a request, or the path of a saved plan or a request file.
    tolerance_m
        Largest distance between a photo and its site. The default is half of the smaller pitch of
        the grid.
    progress
        Function that is called with the number of points read and the total, while a point cloud
        is read.
    **options
        Options as for `aosplan.plan`; they override the options of `plan`. `within` is the longest
        time of the top-up from take-off to landing, in minutes. It does not change the `within` of
        the plan.

    Raises
    ------
    RequestError
        In the same cases as `aosplan.plan`, if the positions cannot be read or are far from the
        plan, or if no missing photo can be taken within the time.
    """
    from aosplan.postflight.views import read_views
    from aosplan.units import positive

    within = options.pop("within", None)
    found = found_request(plan, options)
    views = read_views(os.fspath(positions), on_earth=found.request.has_place)
    reviewed = reviews.review(
        found.request,
        views,
        tolerance_m=None if tolerance_m is None else positive(tolerance_m, "tolerance_m", "m"),
        folder=found.folder,
        progress=progress,
        longest_s=math.inf if within is None else 60.0 * positive(within, "within", "min"),
    )
    return Review(*(getattr(reviewed, field.name) for field in fields(reviewed)))


class Thinning(Summarized, thinnings.Thinning):
    """The views of a recording that share the fewest occluders.

    It has the attributes of `aosplan.postflight.thin.Thinning`: `chosen` (indices among all views),
    `every`, `kept` and `bound` (predictions).
    """

    __slots__ = ()

    def summary(self) -> tuple[str, dict[str, str]]:
        """The result as text: a headline and named values."""
        headline = f"{len(self.chosen)} of {len(self.views)} views"
        facts = {
            "All": _shown(self.every),
            "Kept": _shown(self.kept),
            "If independent": _shown(self.bound),
        }
        return headline, facts | warnings_text(self.warnings)

    def columns(self) -> dict[str, list[Any]]:
        """The kept views as columns: index among all views, name, position [m]."""
        return {
            "index": list(self.chosen),
            "name": [self.views.name(index) for index in self.chosen],
            "east_m": [self.east_m[index] for index in self.chosen],
            "north_m": [self.north_m[index] for index in self.chosen],
        }

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the positions of all views and of the kept views.

        Parameters
        ----------
        ax
            Axes to draw on; a new figure by default.
        """
        from aosplan.show.figures.axes import axes_or_new

        ax = axes_or_new(ax, (5.0, 5.0))
        kept = self.columns()
        ax.plot(self.east_m, self.north_m, ".", color="0.6", label=f"all {len(self.views)} views")
        ax.plot(kept["east_m"], kept["north_m"], "o", mfc="none", label=f"{len(self.chosen)} kept")
        ax.set(xlabel="east of the origin [m]", ylabel="north of the origin [m]", aspect="equal")
        ax.legend()
        return ax


def thin(
    views: str | os.PathLike[str],
    keep: int,
    request: RequestLike | None = None,
    *,
    best: str = "normalized",
    progress: Callable[[int, int], None] | None = None,
    **options: Unpack[RequestOptions],
) -> Thinning:
    """Choose the best views of a recording: those that share the fewest occluders.

    Parameters
    ----------
    views
        A folder of photos, a mission, a CSV or a ``.geojson`` file.
    keep
        Number of views to keep.
    request, **options
        Scene, altitude, camera and model, as for `aosplan.plan`.
    best
        Quantity to maximise: ``normalized`` (V̂), ``visibility`` (V), or ``similarity`` (to the
        integral of all views).
    progress
        Function that is called with the number of finished steps and the total number of steps.

    Raises
    ------
    RequestError
        In the same cases as `aosplan.plan`, or if there are too few or too many views.
    """
    from aosplan.postflight.views import read_views
    from aosplan.units import one_of, whole

    found = found_request(request, options)
    taken = read_views(os.fspath(views), on_earth=found.request.origin is not None)
    thinned = thinnings.thin_views(
        found.request,
        taken,
        whole(keep, "keep"),
        best=one_of(thinnings.QUANTITIES)(best, "best"),
        folder=found.folder,
        progress=progress,
    )
    return Thinning(*thinned)


def _shown(prediction: Prediction) -> str:
    return f"V̂ = {percent(prediction.normalized)}, V = {percent(prediction.expected)}"
