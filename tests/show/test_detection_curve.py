"""If the plan has a target, the page has a section about detection with the numbers of the plan."""

import re

import pytest

from aosplan import PlanRequest, plan
from aosplan.show.page.charts import BOTTOM, LEFT, RIGHT, TOP
from aosplan.show.page.detection_curve import detection_curve

pytest.importorskip("jinja2")

SCENE = {"integrated_density": 0.8, "occluder_size": 0.5, "volume_height": 3.0, "altitude": 40.0}
OWN = {"find": "person", "contrast": -3.0, "canopy_offset": 0.0, "crown_share": 0.0}


def test_the_detection_curve_increases_and_passes_through_the_plan():
    planned = plan(PlanRequest(**SCENE, **OWN, samples=16, baseline=2.0))
    curve = detection_curve(planned)
    points = [tuple(map(float, point.split(","))) for point in curve.points.split()]
    assert points == sorted(points)
    assert [y for _, y in points] == sorted((y for _, y in points), reverse=True)
    assert all(LEFT <= x <= RIGHT and TOP <= y <= BOTTOM for x, y in points)
    # A colder target is shown at the absolute value of its contrast.
    chosen = tuple(round(place, 2) for place in curve.chosen)
    assert chosen in points


def test_a_page_has_a_detection_section_only_with_a_target():
    from aosplan.show.page.page import report_page

    with_target = report_page(
        plan(PlanRequest(**SCENE, **OWN, samples=9, baseline=2.0)), seed=None
    ).decode()
    assert '<h2 id="detection-title">' in with_target
    assert re.search(r"Of 100 people lying there", with_target)
    without = report_page(plan(PlanRequest(**SCENE, samples=9, baseline=2.0)), seed=None).decode()
    assert '<h2 id="detection-title">' not in without
