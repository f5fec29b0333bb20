"""Computation of the numbers of a figure from a plan or a scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from aosplan.planning.loaded_scene import LoadedScene
    from aosplan.planning.result import Plan
    from aosplan.show.figures.draw import FigureData, FigureKind


def shown_of_plan(kind: FigureKind, plan: Plan) -> FigureData:
    """The numbers of a figure of a plan."""
    if kind.name == "visibility":
        from aosplan.show.figures.visibility import visibility_of

        return visibility_of(plan)
    if kind.name == "tradeoff":
        from aosplan.show.figures.tradeoff import tradeoff_of

        return tradeoff_of(plan)
    from aosplan.show.figures.grid import grid_of

    return grid_of(plan, plan.layout.area)


def shown_of_scene(
    kind: FigureKind,
    loaded: LoadedScene,
    *,
    focal_height_m: float = 0.0,
    coverage: float = 0.98,
    altitude_m: float | None = None,
) -> FigureData:
    """The numbers of a figure of a scene.

    Parameters
    ----------
    kind
        A kind of figure with the source ``scene``.
    loaded
        The scene.
    focal_height_m, coverage, altitude_m
        For the baseline curve: height of the focal plane, requested share of occluders, and
        altitude for an additional axis of baselines.
    """
    if kind.name == "density":
        from aosplan.show.figures.density import density_of

        return density_of(loaded)
    if kind.name == "correlogram":
        from aosplan.show.figures.correlogram import correlations_of

        return correlations_of(loaded)
    from aosplan.show.figures.coverage_curve import curve_of

    return curve_of(loaded.scene.above(focal_height_m), coverage, altitude_m)
