"""Curve for the page: probability of detection against the contrast of the target."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from aosplan.show.page.charts import BOTTOM, LEFT, RIGHT, TICKS_Y, TOP, Tick, scale, ticks

if TYPE_CHECKING:
    from aosplan.planning.result import Plan


class DetectionCurve(NamedTuple):
    """The points of a curve in the units of the drawing, with a description.

    Attributes
    ----------
    text
        The probability of detection in a sentence.
    summary
        Description of the picture in one sentence.
    x_ticks, y_ticks
        Ticks along the axes.
    points
        Points of the curve in the format of SVG.
    chosen
        Position of the plan's contrast.
    """

    text: str
    summary: str
    x_ticks: list[Tick]
    y_ticks: list[Tick]
    points: str
    chosen: tuple[float, float]


def detection_curve(plan: Plan) -> DetectionCurve | None:
    """The curve of a plan with a target to find; None for other plans."""
    found = plan.detection
    if found is None:
        return None
    from aosplan.show.text.plan_rows import detection_text

    # The axis has absolute values, because negative contrasts are equivalent to positive contrasts.
    curve = sorted((abs(contrast), share) for contrast, share in found.curve)
    x, y = scale(curve[-1][0], LEFT, RIGHT), scale(1.0, BOTTOM, TOP)
    own = abs(found.signature.contrast)
    some = next((at for at, share in curve if share >= 0.5), None)
    half = (
        "It is below one half for all contrasts in the figure"
        if some is None
        else f"It reaches one half at {some:g}"
    )
    return DetectionCurve(
        text=detection_text(plan),
        summary=(
            f"The probability of detection is {curve[0][1]:.1%} at contrast "
            f"{curve[0][0]:g} and {curve[-1][1]:.1%} at contrast {curve[-1][0]:g}. {half}. The "
            f"signature of this plan has the contrast {own:g}, with a probability of {found.probability:.1%}."
        ),
        x_ticks=[Tick(x(value), f"{value:g}") for value in ticks(0.0, curve[-1][0])],
        y_ticks=[Tick(y(value), f"{value:.0%}") for value in TICKS_Y],
        points=" ".join(f"{x(at):.2f},{y(share):.2f}" for at, share in curve),
        chosen=(x(own), y(found.probability)),
    )
