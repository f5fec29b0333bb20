"""Predicted detection, compared with searches of forests that the model has not used."""

import json

import numpy as np
import pytest

from aosplan import PlanRequest, RequestError, plan
from aosplan.models.seen_share import SHARES
from aosplan.simulation.compare_search import compare_search

SCENE = {"integrated_density": 0.8, "occluder_size": 0.5, "volume_height": 3.0, "volume_base": 6.0}
FLOWN = {"altitude": 30.0, "samples": 16, "baseline": 2.0, "find": "person"}
OWN = {"contrast": 4.0, "canopy_offset": -0.5, "crown_share": 0.0}


@pytest.fixture(scope="module")
def compared():
    return compare_search(plan(PlanRequest(**SCENE, **FLOWN, **OWN)), forests=4)


def test_six_slices_are_found_as_predicted_at_the_same_threshold(compared):
    assert 0.2 < compared.predicted < 0.9
    assert compared.agree
    assert abs(compared.predicted - compared.simulated) < 0.05 + 2.5 * compared.standard_error
    assert compared.standard_error < 0.05
    assert compared.targets == 4 * 8 * 9


def test_simulated_seen_shares_agree_with_the_prediction(compared):
    for share, predicted, found, error in zip(
        SHARES, compared.seen_predicted, compared.seen, compared.seen_errors, strict=True
    ):
        assert abs(predicted - found) < 0.03 + 3.0 * error, share


def test_a_wrong_threshold_would_be_noticed(compared):
    """If the predicted probability is divided by two, the comparison fails."""
    assert not compared._replace(predicted=0.5 * compared.predicted).agree


def test_the_same_seed_gives_the_same_search_and_another_seed_does_not():
    planned = plan(PlanRequest(**SCENE, **FLOWN, **OWN))
    one, again, other = (compare_search(planned, seed=s, forests=2) for s in (3, 3, 4))
    assert one == again
    assert one.seen != other.seen


def test_plans_that_cannot_be_searched_are_refused():
    with pytest.raises(RequestError, match="has no target to find"):
        compare_search(plan(PlanRequest(altitude=30, **SCENE)))
    planned = plan(PlanRequest(**SCENE, **FLOWN, **OWN))
    with pytest.raises(RequestError, match="voxels of a point cloud"):
        compare_search(planned, forest="cloud")
    with pytest.raises(RequestError, match="because noise patterns have no ground"):
        compare_search(planned, forest="noise")


def test_the_command_prints_the_search(command, monkeypatch):
    monkeypatch.setattr("aosplan.simulation.compare_search.FORESTS", 2)
    options = ["--integrated-density", "0.8", "--occluder-size", "0.5", "--volume-height", "3"]
    flown = ["--altitude", "30", "--samples", "9", "--baseline", "2", "--find", "person"]
    own = ["--contrast", "4", "--canopy-offset", "0", "--crown-share", "0"]
    status, out, err = command("simulate", *options, *flown, *own, "--precision", "0.05", "--json")
    assert status == 0, err
    document = json.loads(out)
    search = document["search"]
    assert search["predicted"] == document["detection"]["probability"]
    assert 0.0 <= search["simulated"] <= 1.0
    assert np.isfinite(search["standard_error"])
    status, _, err = command("simulate", *options, *flown, *own, "--forest", "noise")
    assert status == 2
    assert "no ground on which targets could lie" in err
