"""Plans, their trade-offs, and mission files: `plan`, `tradeoff` and `export`."""

from __future__ import annotations

import os
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.api.request import found_request
from aosplan.api.summarized import Summarized, columns_of, warnings_text
from aosplan.errors import RequestError
from aosplan.planning import planner, result
from aosplan.units import duration, percent

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Unpack

    from matplotlib.axes import Axes

    from aosplan.api.request import FoundRequest, RequestLike
    from aosplan.api.request_options import RequestOptions
    from aosplan.maps.reciprocal_map import ReciprocalMap
    from aosplan.solver.tradeoff import TradeoffRow


@dataclass(frozen=True, repr=False)
class Plan(Summarized, result.Plan):
    """A plan: the flight and the predicted visibility.

    `waypoints` are the sites in flight order.  `solution` has the baseline and the prediction.
    `document()` returns everything that ``aosplan plan --json`` prints.  The other attributes are
    those of `aosplan.planning.result.Plan`.
    """

    def summary(self) -> tuple[str, dict[str, str]]:
        """The result as text: a headline and named values."""
        solution, route = self.solution, self.route
        survey = self.layout.survey
        samples = solution.pattern.samples
        photos = len(self.waypoints) if survey is not None else samples
        apart = f", {solution.baseline_m:,.2f} m apart" if samples > 1 else ""
        headline = (
            f"{photos:,} photo{'s' if photos > 1 else ''}{apart}, from {self.altitude_m:.4g} m above "
            "the focal plane"
        )
        shown = solution.prediction
        x, y = self.extent_m
        seen = (
            f"V̂ = {percent(shown.normalized)}, V = {percent(shown.expected)}"
            if shown.density > 0.0
            else "V = 100 %, because nothing is hidden"
        )
        place = "no location" if self.origin is None else "{:.5f}, {:.5f}".format(*self.origin)
        facts = {
            "Scene": f"{self.scene.name} ({self.model} model); camera {self.camera.name}",
            "Visibility": seen,
            "Grid": f"{self.grid.name}, {x:,.1f} x {y:,.1f} m, heading {self.heading_deg:g}°; {place}",
            "Flight": f"{route.length_m:,.0f} m, {duration(route.time_s)}",
        }
        if self.detection is not None:
            facts["Detection"] = percent(self.detection.probability)
        return headline, facts | warnings_text(self.warnings)

    @property
    def __geo_interface__(self) -> dict[str, Any]:
        """The waypoints and the path as a GeoJSON FeatureCollection, for GeoPandas and others.

        Raises
        ------
        RequestError
            If the plan has no location.
        """
        if self.waypoints.latitude is None:
            raise RequestError(
                "a plan without a location has no geographic coordinates",
                "give origin=(LAT, LON) or area=FILE, or use plan.waypoints.east_m and north_m",
            )
        import json

        from aosplan.mission.formats.geojson import render

        found: dict[str, Any] = json.loads(render(self.mission()))
        return found

    def plot(self, ax: Axes | None = None, *, kind: str = "grid") -> Any:
        """Draw the plan with Matplotlib.

        Parameters
        ----------
        ax
            Axes to draw on; a new figure by default.
        kind
            ``grid`` (the waypoints on the ground), ``visibility`` or ``tradeoff``.  The last two
            have four panels and always make a new figure.

        Returns
        -------
        ax
            The axes; an array of them for figures with several panels.

        Raises
        ------
        RequestError
            If the kind is unknown, or has several panels and `ax` is given.
        MissingExtraError
            If Matplotlib is not installed.
        """
        from aosplan.show.figures.axes import plotted
        from aosplan.show.figures.draw import KINDS
        from aosplan.show.figures.sources import shown_of_plan
        from aosplan.units import one_of

        kinds = [name for name, each in KINDS.items() if each.source == "plan"]
        chosen = KINDS[one_of(kinds)(kind, "kind")]
        return plotted(chosen, shown_of_plan(chosen, self), ax)

    def reciprocal_map(self) -> ReciprocalMap:
        """Compute the share of the target area that is seen from each camera position at flight
        altitude.

        The target area is the area of the plan, or the disc around its origin whose radius is
        `around_radius`.

        Returns
        -------
        map
            `transparency` has the share of the area that each position sees, `cells` has the
            positions, and `geotiff()` returns the content of a GeoTIFF.

        Raises
        ------
        RequestError
            If the plan or its scene has no location, or the scene does not cover the area.
        """
        from aosplan.maps.reciprocal_map import reciprocal_map

        return reciprocal_map(self)


def plan(
    request: RequestLike | None = None,
    *,
    folder: str | os.PathLike[str] | None = None,
    progress: Callable[[int, int], None] | None = None,
    **options: Unpack[RequestOptions],
) -> Plan:
    """Compute a plan for a request: the number of photos, their positions, and the distance between
    neighbouring photos.

    Parameters
    ----------
    request
        A `PlanRequest`, an earlier `Plan`, or the path of a request file or a saved plan.
    folder
        Folder of the files that `request` and the options name. Files that are not in it are looked
        for in the current folder. The default is the folder of the request file or of the earlier
        plan.
    progress
        Function that is called with the number of points read and the total, while a point cloud
        is read.
    **options
        Options of ``aosplan plan`` with underscores, which are the fields of `PlanRequest`. They
        override the options of `request`. `scene` may also be a result of `aosplan.read_scene`;
        `origin` is a pair (latitude, longitude).

    Raises
    ------
    RequestError
        If a name, file or number is not valid, or if two options contradict each other.  An example
        is an altitude below the top of the canopy.
    InfeasibleError
        If no grid meets the target.

    Examples
    --------
    >>> import aosplan
    >>> grid = aosplan.plan(altitude=40, vhat=0.98)
    >>> grid.solution.pattern.samples, round(grid.solution.baseline_m, 2)
    (50, 2.8)
    """
    found = found_request(request, options, folder=None if folder is None else os.fspath(folder))
    return plan_of_request(found, progress=progress)


def plan_of_request(
    found: FoundRequest, *, progress: Callable[[int, int], None] | None = None
) -> Plan:
    """Compute the plan of a request."""
    plain = planner.plan(found.request, folder=found.folder, loaded=found.loaded, progress=progress)
    return Plan(**{field.name: getattr(plain, field.name) for field in fields(plain)})


class _Rows(NamedTuple):
    plan: Plan
    rows: tuple[TradeoffRow, ...]


class Tradeoff(Summarized, _Rows):
    """A table with one row for each number of photos: its cost and its benefit. `chosen` is true in
    the row of the plan.

    Attributes
    ----------
    plan
        The plan.
    rows
        `aosplan.solver.tradeoff.TradeoffRow` values, by increasing number of samples for each kind of grid.
    """

    __slots__ = ()

    def document(self) -> dict[str, Any]:
        """The rows as plain values, which ``aosplan tradeoff --json`` prints."""
        return self.plan.tradeoff_document(self.rows)

    def columns(self) -> dict[str, list[Any]]:
        """The rows as columns, which pandas and polars accept."""
        return columns_of(self.document()["rows"])

    def summary(self) -> tuple[str, dict[str, str]]:
        """The result as text: a headline and named values."""
        front = [row for row in self.rows if row.front]
        facts = {}
        for row in front[:: max(-(-len(front) // 3), 1)]:
            facts[f"{row.pattern.samples} photos"] = (
                f"{row.baseline_m:.2f} m apart, {duration(row.time_s)}, "
                f"V̂ = {percent(row.prediction.normalized)}"
            )
        return f"{len(self.rows)} rows, {len(front)} of them on the Pareto front", facts

    def plot(self) -> Any:
        """Draw baseline, extent and time against the number of photos; returns an array of four
        axes.
        """
        return self.plan.plot(kind="tradeoff")


def tradeoff(request: RequestLike | None = None, **options: Unpack[RequestOptions]) -> Tradeoff:
    """Compute cost and benefit for each number of photos: baseline, extent, time and visibility.

    Parameters
    ----------
    request, **options
        As for `aosplan.plan`; if an earlier plan is given, it is not solved again.

    Raises
    ------
    RequestError
        In the same cases as `aosplan.plan`, or if no occluder is above the focal plane.

    Examples
    --------
    >>> import aosplan
    >>> table = aosplan.tradeoff(altitude=40, vhat=0.9, max_samples=12)
    >>> table.columns()["samples"][-1]
    12
    """
    chosen = request if isinstance(request, Plan) and not options else plan(request, **options)
    return Tradeoff(chosen, tuple(chosen.tradeoff()))


def export(
    plan: Plan | str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    format: str | None = None,  # noqa: A002 (the option's name)
    force: bool = False,
) -> list[str]:
    """Write the waypoints of a plan, of a saved plan, or of a mission file to a file.

    The file is written completely or not at all.

    Parameters
    ----------
    plan
        A plan, a file with the output of ``aosplan plan --json``, or a mission file
        (``.waypoints``, ``.plan``, ``.kmz``, ``.mavlink``, ``.csv``).
    path
        Path of the output.  The extension selects the format.  A format name before a colon
        overrides the extension: ``litchi:grid.csv``.
    format
        Name of the format; it overrides the extension.
    force
        Whether an existing file is overwritten.

    Returns
    -------
    paths
        Paths of the written files: `path`, or several numbered files if one file cannot contain all
        waypoints.

    Raises
    ------
    RequestError
        If the format is unknown, if the format needs a location that the plan does not have, or if
        the file exists and `force` is false.
    SurroundingsError
        If the file cannot be written.
    """
    from aosplan.files import write_all
    from aosplan.mission.export import choose_format, mission_files
    from aosplan.postflight.saved_missions import read_saved_missions

    chosen, target = choose_format(os.fspath(path), format)
    if isinstance(plan, (str, os.PathLike)):
        missions = read_saved_missions(os.fspath(plan), [chosen])
    else:
        missions = plan.missions()
    contents = mission_files(missions, chosen, target)
    write_all(contents, force=force)
    return list(contents)
