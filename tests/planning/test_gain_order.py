"""Lines over an area are flown in the order of their gain, which is the increase of the probability
of success per minute.
"""

from functools import cache

import numpy as np
import pytest
from support.paths import AREAS

from aosplan import PlanRequest, plan
from aosplan.errors import InfeasibleError, RequestError
from aosplan.maps.detection_map import detection_map
from aosplan.planning.gain_result import photo_times_s
from aosplan.planning.plan_schema import PlanDocument

rasterio = pytest.importorskip("rasterio")

FIELD = str(AREAS / "field.geojson")
CENTRE = (48.3314, 14.3224)
LINES = {
    "area": FIELD,
    "altitude": 60.0,
    "scene": "dense-forest",
    "drone": "dji-m3t",
    "grid": "lanes",
    "lanes": 4,
    "lane_pitch": 1.5,
    "samples": 20,
    "baseline": 7.5,
    "trigger": "distance",
    "takeoff": (48.3301, 14.3199),
    "find": "person",
}
"""A flight of parallel lines over four hectares."""


@pytest.fixture(scope="module")
def prior(tmp_path_factory):
    """A prior around a place in the east of the area, in steps of some metres."""
    latitude, longitude = CENTRE
    rows, columns = np.mgrid[0:60, 0:60]
    values = np.exp(-((rows - 30.0) ** 2 + (columns - 30.0) ** 2) / 50.0) + 0.01
    return written(tmp_path_factory.mktemp("prior") / "prior.tif", values, (latitude, longitude))


def written(path, values, centre, step=8e-5, **profile):
    latitude, longitude = centre
    high, wide = values.shape
    corner = longitude - 0.5 * wide * step, latitude + 0.5 * high * step
    profile = {"crs": "EPSG:4326", "dtype": "float64", "count": 1} | profile
    transform = rasterio.Affine(step, 0.0, corner[0], 0.0, -step, corner[1])
    with rasterio.open(
        path, "w", driver="GTiff", width=wide, height=high, transform=transform, **profile
    ) as file:
        file.write(values, 1)
    return str(path)


@cache
def made(prior, **more):
    return plan(
        PlanRequest(**{**LINES, **more}, **({"poa": prior, "order": "gain"} if prior else {}))
    )


def photos(planned):
    ways = planned.waypoints
    taken = ways.photo or [True] * len(ways)
    rows = zip(ways.east_m, ways.north_m, taken, strict=True)
    return [(round(east, 6), round(north, 6)) for east, north, photo in rows if photo]


@pytest.mark.slow
def test_all_photos_are_taken_and_the_likely_place_is_seen_early(prior):
    ordered, usual = made(prior), made(None)
    assert sorted(photos(ordered)) == sorted(photos(usual))
    assert ordered.gain.mean_s < 0.9 * ordered.gain.usual_mean_s
    places = np.array(photos(ordered))
    from aosplan.geodesy import to_local

    likely = np.array(to_local(ordered.origin, [CENTRE[0]], [CENTRE[1]])).T
    third = len(places) // 3
    off = np.hypot(*(places - likely).T)
    assert off[:third].mean() < 0.7 * off[-third:].mean()


@pytest.mark.slow
def test_success_is_that_of_the_detection_map(prior):
    ordered = made(prior)
    found = detection_map(ordered).success(prior)
    assert ordered.gain.success == pytest.approx(found.success, rel=1e-9)
    assert ordered.gain.probability_of_area == pytest.approx(found.area, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("takeoff", [LINES["takeoff"], None])
def test_the_mean_time_is_the_integral_of_the_curve(prior, takeoff):
    gain = made(prior, takeoff=takeoff).gain
    for curve, mean_s in ((gain.curve, gain.mean_s), (gain.usual_curve, gain.usual_mean_s)):
        times, values = np.array(curve).T
        assert (np.diff(times) >= 0.0).all()
        assert (np.diff(values) >= 0.0).all()
        left = 1.0 - values / values[-1]
        integral_s = float((np.diff(times) * 0.5 * (left[1:] + left[:-1])).sum())
        assert integral_s == pytest.approx(mean_s, rel=1e-6)
    assert gain.mean_s <= gain.usual_mean_s


@pytest.mark.slow
def test_the_last_photo_is_taken_just_before_the_return(prior):
    ordered = made(prior)
    times = photo_times_s(ordered.route, ordered.origin)
    assert len(times) == len(photos(ordered))
    assert times == sorted(times)
    back_s = ordered.route.total_time_s - times[-1]
    # The way back is a descent from 60 m and a path of at most 400 m.
    descent_s = ordered.route.timing.transit.leg_s(0.0, 0.0, 60.0)
    assert descent_s < back_s < descent_s + 60.0


@pytest.mark.slow
def test_each_battery_has_its_share_of_success(prior):
    ordered = made(prior, flight_time=9.0)
    document = ordered.document()
    PlanDocument.model_validate(document)
    flights = document["gain"]["flights"]
    assert len(flights) == len(ordered.route.flights) > 1
    total = sum(flight["probability_of_success"] for flight in flights)
    assert total == pytest.approx(document["gain"]["probability_of_success"])
    assert flights[-1]["landed_s"] == pytest.approx(ordered.route.total_time_s)
    assert ordered.gain.mean_s <= ordered.gain.usual_mean_s
    # The first flights find more.
    assert flights[0]["probability_of_success"] > flights[-1]["probability_of_success"]


@pytest.mark.slow
def test_a_short_time_is_used_for_the_likely_part(prior):
    search = {
        "area": FIELD, "scene": "dense-forest", "drone": "dji-m3t", "altitude": 80.0,
        "within": 10.0, "find": "person", "takeoff": LINES["takeoff"], "heading": 0.0,
        "trigger": "distance",
    }  # fmt: skip
    whole = plan(PlanRequest(**search))
    part = plan(PlanRequest(**search, poa=prior, order="gain"))
    assert part.route.total_time_s <= 600.0
    assert part.gain.success > 1.5 * detection_map(whole).success(prior).success
    assert part.gain.success == pytest.approx(detection_map(part).success(prior).success, rel=0.01)
    assert part.gain.success >= part.gain.usual_success
    assert part.gain.is_part
    assert part.layout.survey.sites == part.gain.photos == len(photos(part))
    assert 0.0 < part.layout.survey.covered_share < 1.0
    document = part.document()
    assert plan(PlanRequest(**document["request"])).document() == document


@pytest.mark.slow
def test_a_time_that_is_too_short_for_a_line_is_refused(prior):
    with pytest.raises(InfeasibleError, match="no line can be flown within") as refusal:
        plan(PlanRequest(**{**LINES, "within": 0.7}, poa=prior, order="gain"))
    assert "--within" in refusal.value.hint


def test_a_prior_elsewhere_is_refused(tmp_path):
    path = written(tmp_path / "away.tif", np.ones((4, 4)), (47.0, 14.0))
    with pytest.raises(RequestError, match="has no probability on the ground of the plan"):
        plan(PlanRequest(**LINES, poa=path, order="gain"))


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"order": "gain"}, "--order gain needs to know where the target is expected"),
        ({"order": "gain", "area": None}, "--order needs --area"),
        ({"order": "best"}, "'best' is not one of shortest, gain"),
    ],
)
def test_what_an_order_needs_is_said(more, message):
    kept = LINES if "area" not in more else {"altitude": 60.0}
    with pytest.raises(RequestError, match=message):
        PlanRequest(**{**kept, **more})


def test_an_order_by_gain_looks_for_a_person():
    values = {name: value for name, value in LINES.items() if name != "find"}
    assert PlanRequest(**values, poa="prior.tif", order="gain").find == "person"
