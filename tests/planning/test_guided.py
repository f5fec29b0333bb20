"""Guided positions above a scanned stand of leaves, judged by rays through these leaves."""

import numpy as np
import pytest
from support.scans import CORNER, SIDE_M, place, pyproj, scan, true_visibility

from aosplan.errors import AosplanError, InfeasibleError, RequestError
from aosplan.planning.plan_schema import PlanDocument
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest

ALTITUDE_M, RADIUS_M, MIDDLE = 30.0, 1.5, (8.0, 8.5)
ASKED = {"altitude": ALTITUDE_M, "around_radius": RADIUS_M, "grid": "guided"}


def request(**more):
    return PlanRequest(**{**ASKED, "scene": scan(), "origin": place(*MIDDLE), **more})


@pytest.fixture(scope="module")
def guided():
    return plan(request(within=1.5, photo_interval=1.0))


def on_plot(made):
    """Waypoints in the coordinates of the cloud, relative to the corner of the plot. They are
    projected by pyproj.
    """
    project = pyproj.Transformer.from_crs("EPSG:4326", "EPSG:32633", always_xy=True)
    x, y = project.transform(made.waypoints.longitude, made.waypoints.latitude)
    return np.column_stack([np.array(x) - CORNER[0], np.array(y) - CORNER[1]])


@pytest.mark.slow
def test_the_prediction_of_guided_positions_agrees_with_known_leaves(guided):
    true = true_visibility(MIDDLE, RADIUS_M, on_plot(guided), ALTITUDE_M)
    assert guided.solution.prediction.expected == pytest.approx(true, abs=0.05)
    assert guided.guided.chosen_expected >= guided.solution.prediction.expected - 0.02


@pytest.mark.slow
def test_guided_positions_show_more_than_plain_grids_of_the_same_time(guided):
    sites = on_plot(guided)
    true = true_visibility(MIDDLE, RADIUS_M, sites, ALTITUDE_M)
    kinds = {(each.kind, each.trigger) for each in guided.guided.plain}
    assert {kind for kind, _ in kinds} == {"lanes", "line", "square", "trimmed"}
    assert len(kinds) == len(guided.guided.plain)
    for each in guided.guided.plain:
        assert each.time_s <= 90.0 * (1.0 + 1e-9)
        offsets = np.array(list(each.pattern.offsets()))
        grid = np.array(MIDDLE) + each.pitch_m[0] * offsets[:, ::-1]
        assert true > true_visibility(MIDDLE, RADIUS_M, grid, ALTITUDE_M)


@pytest.mark.slow
def test_the_plan_is_flown_within_the_time_and_within_reach(guided):
    assert guided.route.total_time_s <= 90.0
    footprint = guided.inputs.footprint_m
    east, north = np.array(guided.waypoints.east_m), np.array(guided.waypoints.north_m)
    assert len(set(zip(east.tolist(), north.tolist(), strict=True))) == len(east)
    # At heading 0, the size of a photo is `footprint` along north and east. Every photo shows the
    # whole disc.
    assert np.abs(north).max() + RADIUS_M <= 0.5 * footprint[0] + 1e-9
    assert np.abs(east).max() + RADIUS_M <= 0.5 * footprint[1] + 1e-9
    # The path is at most as long as a path that always continues to the nearest remaining site.
    legs = np.hypot(np.diff(east), np.diff(north))
    left, here, greedy = list(range(1, len(east))), 0, 0.0
    while left:
        next_one = min(left, key=lambda k: np.hypot(east[k] - east[here], north[k] - north[here]))
        greedy += np.hypot(east[next_one] - east[here], north[next_one] - north[here])
        left.remove(next_one)
        here = next_one
    assert legs.sum() <= greedy + 1e-9


@pytest.mark.slow
def test_the_document_is_valid_and_the_same_every_time(guided):
    document = guided.document()
    PlanDocument.model_validate(document)
    assert document["request"]["optimize"] == "visibility"
    assert document["visibility"]["view"] == "perspective"
    assert document["guided"]["predicted_with"] == "second half of the pulses"
    again = plan(request(within=1.5, photo_interval=1.0)).document()
    assert again == document


@pytest.mark.slow
def test_more_positions_than_fit_are_refused():
    with pytest.raises(InfeasibleError, match="more than --within 1"):
        plan(request(samples=30, within=1.0))
    with pytest.raises(InfeasibleError, match="not even one"):
        plan(request(within=0.1))


@pytest.mark.slow
def test_the_number_of_positions_can_be_given_over_an_area(tmp_path):
    import json

    corners = [place(MIDDLE[0] + x, MIDDLE[1] + y) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    ring = [[longitude, latitude] for latitude, longitude in [*corners, corners[0]]]
    path = tmp_path / "area.geojson"
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    made = plan(request(origin=None, around_radius=None, area=str(path), samples=9))
    assert made.solution.pattern.samples == len(made.waypoints) == 9
    assert made.guided.target_area_m2 == pytest.approx(4.0, rel=0.01)
    true = true_visibility(MIDDLE, 1.0, on_plot(made), ALTITUDE_M)
    assert made.solution.prediction.expected == pytest.approx(true, abs=0.07)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"origin": place(0.5, 8.0)}, "reaches 1 m beyond the edge"),
        ({"opacity": "voxels"}, "opacity from the pulses"),
        ({"around_radius": 30.0}, "beyond the edge"),
        ({"origin": None, "around_radius": None}, "needs a location"),
        ({"trigger": "distance"}, "--trigger distance cannot be used with --grid guided"),
        ({"find": "person"}, "--find person cannot be used with --grid guided"),
        ({"optimize": "time"}, "--optimize time cannot be used with --grid guided"),
        ({"heading": "best"}, "--heading best cannot be used with --grid guided"),
        ({"samples": 2000}, "candidate positions for 2000 samples"),
        ({"baseline": 0.01}, "more than 2500"),
        ({"scene": "dense-forest"}, "needs the voxels"),
    ],
)
def test_contradictory_guided_options_are_refused_with_a_hint(more, said):
    with pytest.raises(AosplanError, match=said) as caught:
        plan(request(**more))
    assert caught.value.hint


@pytest.mark.slow
def test_a_sweep_and_a_trade_off_are_refused(guided):
    from aosplan.sweeps.scenarios import crossing_of

    with pytest.raises(RequestError, match="a trade-off is not possible"):
        guided.tradeoff()
    with pytest.raises(RequestError, match="does not choose positions"):
        crossing_of({"altitude": 40, "grid": "guided"})


@pytest.mark.slow
def test_the_plot_is_as_large_as_its_scan(guided):
    assert guided.volume.size_m == pytest.approx((SIDE_M, SIDE_M), abs=0.3)
    assert guided.volume.halves is not None
    dense = [half.dense.mean() for half in guided.volume.halves]
    measured = [half.measured.mean() for half in guided.volume.halves]
    assert all(more >= less for more, less in zip(dense, measured, strict=True))
    assert measured == pytest.approx([guided.volume.occupied.mean()] * 2, rel=0.05)
