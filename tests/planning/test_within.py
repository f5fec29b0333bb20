"""The options that ``--within`` chooses so that a flight fits into a given time."""

import itertools
from dataclasses import replace

import pytest
from support.command_line import FIELD

from aosplan import PlanRequest, plan
from aosplan.errors import InfeasibleError, RequestError
from aosplan.planning.loaded_scene import load_scene
from aosplan.planning.within import WithinSearch
from aosplan.planning.within_altitude import NEARLY

HARD = {"scene": "dense-forest", "find": "person", "optimize": "detection", "drone": "dji-m3t"}
"""Options of a search in which not all targets can be found."""


def searched(**values):
    return plan(PlanRequest(**({"altitude": 60.0} | HARD | values)))


@pytest.fixture(scope="module")
def over_field():
    return searched(area=FIELD[1], within=10.0, altitude="40..80")


def test_a_search_keeps_the_time_and_reports_half_and_twice_the_time(over_field):
    half, this, double = over_field.within.rows
    assert over_field.route.total_time_s == pytest.approx(this.timed.time_s)
    assert this.timed.time_s <= 600.0
    assert half.timed.time_s <= 300.0
    assert double.timed.time_s <= 1200.0
    assert half.value <= this.value <= double.value
    assert over_field.detection.probability == pytest.approx(this.value, abs=1e-3)


def test_the_time_is_used(over_field):
    assert over_field.route.total_time_s > 0.85 * 600.0


def test_a_search_lays_out_few_flights(over_field):
    assert over_field.within.laid_out <= 20
    assert over_field.within.predicted < 400


def test_the_document_runs_again_to_the_same_plan(over_field):
    document = over_field.document()
    assert document["request"]["within"] == 10.0
    assert document["request"]["altitude"] == "40.0..80.0"
    again = plan(PlanRequest(**document["request"]))
    assert again.document() == document


def test_the_plan_of_a_search_has_values_for_all_options(over_field):
    request = over_field.request
    assert not request.searches
    assert plan(request).waypoints == over_field.waypoints


def test_every_photo_of_the_window_sees_a_place_of_the_area(over_field):
    assert over_field.layout.survey.covered_share == 1.0
    assert over_field.layout.survey.fewest_looks >= over_field.solution.pattern.samples


@pytest.mark.parametrize("trigger", ["stop", pytest.param("distance", marks=pytest.mark.slow)])
def test_no_grid_of_the_same_options_is_better_at_one_place(trigger):
    """The plan is compared with those lanes that fit into the time, for several rows, columns and
    spacings.
    """
    best = searched(within=0.7, trigger=trigger)
    assert best.route.total_time_s <= 42.0
    assert min(best.common_footprint_m) >= 1.7 - 1e-9  # All photos show the target.
    x, y = best.camera.footprint_m(60.0)
    for rows, columns, pitch in itertools.product((1, 2, 4), (3, 6, 10), (1.0, 2.0)):
        width = max((rows - 1) * pitch, 1e-9)
        baseline = 0.98 * min((x - 1.7) / (columns - 1), (y - 1.7) / width)
        for share in (1.0, 0.5):
            lanes = {"grid": "lanes", "lanes": rows, "lane_pitch": pitch}
            request = PlanRequest(
                altitude=60.0,
                **(HARD | {"trigger": trigger}),
                **(lanes if rows > 1 else {"grid": "line"}),
                baseline=baseline * share,
                samples=rows * columns,
            )
            other = plan(request)
            if other.route.total_time_s <= 42.0:
                assert other.detection.probability <= best.detection.probability + 0.02


@pytest.mark.slow
def test_of_nearly_equal_flights_the_shorter_is_flown():
    easy = plan(PlanRequest(altitude=60, optimize="detection", within=60, drone="dji-m3t"))
    assert easy.detection.probability > 0.998
    assert easy.route.total_time_s < 600.0


@pytest.mark.slow
def test_without_a_time_the_search_ends_when_more_time_gains_little():
    found = plan(PlanRequest(altitude=60, optimize="detection", drone="dji-m3t"))
    _, this, double = found.within.rows
    assert double.value <= this.value + 0.006
    assert found.request.find == "person"


@pytest.mark.parametrize("objective", ["samples", "aperture", "time"])
def test_other_objectives_meet_their_target_within_the_time(objective):
    request = PlanRequest(altitude=40, optimize=objective, within=5, vhat=0.9, drone="dji-m3t")
    found = plan(request)
    assert found.solution.prediction.normalized >= 0.9 - 1e-9
    assert found.route.total_time_s <= 300.0


@pytest.mark.parametrize("objective", ["visibility", "contrast"])
def test_more_time_shows_more(objective):
    def shown(minutes):
        found = plan(PlanRequest(altitude=40, optimize=objective, within=minutes, drone="dji-m3t"))
        return getattr(
            found.solution.prediction, "expected" if objective == "visibility" else objective
        )

    assert shown(0.7) < shown(1.5)


@pytest.mark.slow
def test_a_search_within_a_time_takes_batteries_into_account():
    whole = searched(area=FIELD[1], within=12.0)
    split = searched(area=FIELD[1], within=12.0, flight_time=5.0)
    assert len(split.route.flights) >= 2
    assert split.route.total_time_s <= 720.0
    assert split.detection.probability <= whole.detection.probability + 1e-9


def test_fixed_quantities_keep_their_values():
    found = searched(within=2.0, grid="line", trigger="stop", heading=30.0, samples=12)
    assert found.grid.name == "line"
    assert found.request.trigger == "stop"
    assert found.heading_deg == 30.0
    assert found.solution.pattern.samples == 12
    found = searched(within=2.0, grid="line", baseline=3.0)
    assert found.solution.baseline_m == pytest.approx(3.0)


def test_too_little_time_is_refused_with_how_much_is_enough():
    with pytest.raises(InfeasibleError, match=r"within 0\.1 min") as refused:
        searched(within=0.1)
    minutes = float(refused.value.hint.split()[1])
    assert searched(within=minutes).route.total_time_s <= 60.0 * minutes


def test_an_assumed_photo_interval_gives_a_notice():
    found = plan(PlanRequest(altitude=40, optimize="detection", within=1.0, grid="line"))
    assert "photo_interval_assumed" in {warning.code for warning in found.warnings}


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"altitude": "40..80"}, "is a range"),
        ({"altitude": "80..40", "within": 5}, "is not an increasing range"),
        ({"altitude": 40, "trigger": "best"}, "--trigger best needs --within"),
        ({"altitude": 40, "within": 5, "grid": "spiral"}, "the search does not include spirals"),
        ({"altitude": 40, "within": 5, "resume_at": 3}, "--resume-at cannot be used with --within"),
        ({"altitude": "40..80", "within": 5, "baseline": 3}, "--baseline"),
        ({"altitude": 40, "within": 0}, "within"),
    ],
)
def test_options_that_do_not_fit_are_refused(values, message):
    with pytest.raises(RequestError, match=message):
        plan(PlanRequest(**values))


def test_a_request_without_a_search_is_as_it_was():
    request = PlanRequest(altitude=40)
    assert (request.grid, request.trigger, request.heading) == ("trimmed", "stop", 0.0)
    assert not replace(request, vhat=0.9).searches


def test_no_small_step_from_what_is_flown_is_better_within_the_time():
    request = PlanRequest(area=FIELD[1], within=6.0, **(HARD | {"altitude": 60.0}))
    loaded = load_scene(request)
    (search,) = WithinSearch(request, "", lambda _: loaded).levels
    best = search.best(360.0)
    score = search.score(best.candidate.shape)
    for shape in search.space.neighbours(best.candidate.shape):
        timed = search.time(search.least(shape))
        if timed is not None and timed.time_s <= 360.0:
            assert search.score(shape) <= score * (1.0 + NEARLY)
