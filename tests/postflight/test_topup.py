"""The flight that takes missing photos within a given time."""

import json
import math

import numpy as np
import pytest

from aosplan.cli.app import run
from aosplan.errors import InfeasibleError
from aosplan.geodesy import to_wgs84
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.postflight.review import review
from aosplan.postflight.topup import topup_within
from aosplan.postflight.views import read_views

MIDDLE = (48.3358, 14.3261)


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A plan over a square of 60 m, and the photos of a flight without its last 40 sites."""
    folder = tmp_path_factory.mktemp("flown")
    side = [-30.0, 30.0, 30.0, -30.0, -30.0]
    latitude, longitude = to_wgs84(MIDDLE, side, [-30.0, -30.0, 30.0, 30.0, -30.0])
    ring = [list(point) for point in zip(longitude, latitude, strict=True)]
    area = folder / "square.geojson"
    area.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    request = PlanRequest(altitude=40, baseline=5.0, samples=12, area=str(area))
    planned = plan(request)
    ways = planned.waypoints
    photos = folder / "photos.csv"
    rows = zip(ways.latitude[:-40], ways.longitude[:-40], strict=True)
    photos.write_text("latitude,longitude\n" + "".join(f"{a!r},{b!r}\n" for a, b in rows))
    return request, planned, str(photos)


def topped_up(flown, longest_s=math.inf):
    request, _, photos = flown
    return review(request, read_views(photos, on_earth=True), longest_s=longest_s)


def test_a_top_up_within_a_time_lands_within_it_and_closes_part_of_the_gaps(flown):
    whole = topped_up(flown)
    all_s = whole.topup.route.total_time_s
    part = topped_up(flown, 0.6 * all_s)
    assert 0.4 * all_s < part.topup.route.total_time_s <= 0.6 * all_s
    assert whole.after.gap_share == 0.0
    assert 0.0 < part.after.gap_share < part.coverage.gap_share
    assert "topup_is_part" in {message.code for message in part.warnings}
    assert "topup_is_part" not in {message.code for message in whole.warnings}
    assert part.document()["coverage"]["gap_share_completed"] == part.after.gap_share


def test_the_photos_with_the_largest_gain_are_taken(flown):
    """If only a few sites in the middle of the path have a gain, the flight contains these sites."""
    _, planned, _ = flown
    sites = list(range(len(planned.waypoints) - 40, len(planned.waypoints)))
    gains = np.zeros(40)
    gains[18:22] = 1.0
    all_s = topup_within(planned, sites, gains).all_s
    found = topup_within(planned, sites, gains, 0.6 * all_s)
    assert set(sites[18:22]) <= set(found.sites)
    assert found.plan.route.total_time_s <= 0.6 * all_s


def test_a_too_short_time_is_refused_with_a_sufficient_one(flown):
    with pytest.raises(InfeasibleError, match=r"within 0\.05 min") as refused:
        topped_up(flown, 3.0)
    enough = float(refused.value.hint.split()[1])
    assert len(topped_up(flown, 60.0 * enough).topup.waypoints) >= 1


def test_the_within_option_of_review_is_in_minutes(flown, capsys, tmp_path):
    _, planned, photos = flown
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(planned.document()))
    longest = 0.01 * topped_up(flown).topup.route.total_time_s
    assert run(["review", photos, str(path), "--within", f"{longest}", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["topup"]["time_s"] < 60.0 * longest
    assert document["request"].get("within") is None
