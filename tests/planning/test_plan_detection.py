"""Detection in a plan: tests of the numbers of the model, the text, the errors and the warnings."""

import pytest

from aosplan import PlanRequest, RequestError, plan
from aosplan.models.detection import DetectionModel
from aosplan.models.signatures import PERSON_M, Signature
from aosplan.models.target_window import Target
from aosplan.planning.request import request_from
from aosplan.show.text.plan_rows import detection_text

OWN = {"contrast": 1.0, "canopy_offset": 0.0, "crown_share": 0.0}


def codes(planned):
    return {code for code, _ in planned.warnings}


def test_a_plan_without_a_target_has_no_detection():
    planned = plan(PlanRequest(altitude=40))
    assert planned.detection is None
    assert "detection" not in planned.document()


def test_a_uniform_plan_counts_its_volume_as_slices():
    planned = plan(PlanRequest(altitude=40, find="person", **OWN))
    model = DetectionModel(
        planned.scene.slices(), 40.0, Target(*PERSON_M), Signature(1.0, 0.0, 0.0)
    )
    alone = model.predict(planned.solution.pattern, planned.solution.baseline_m)
    assert planned.detection.probability == alone.probability
    document = planned.document()["detection"]
    assert document["target_m"] == [0.5, 1.7]
    assert document["assumed"] is None
    assert document["uncertainty"] is None
    assert document["seen_share"]["mean"] == pytest.approx(planned.scene.transparency)
    assert [1.0, document["probability"]] in document["probability_by_contrast"]


def test_a_signature_is_named_as_assumed_and_in_the_request():
    planned = plan(PlanRequest(altitude=40, find="person"))
    assert planned.document()["detection"]["assumed"] == "thermal-dawn"
    assert planned.request.document()["signature"] == "thermal-dawn"
    assert planned.request.document()["false_alarms"] == 1.0
    assert "detection_crown_clutter" in codes(planned)


def test_the_text_of_a_plan_states_its_detection():
    planned = plan(PlanRequest(altitude=40, find="person", samples=9, baseline=1.0, **OWN))
    hundred = round(100 * planned.detection.probability)
    words = detection_text(planned)
    assert words.startswith(f"of 100 people lying there, about {hundred} would be found at one ")
    several = plan(PlanRequest(altitude=40, find="2x3", false_alarms=0.5, **OWN))
    assert "100 targets of 2 x 3 m lying there" in detection_text(several)
    assert "at 0.5 false alarms per hectare" in detection_text(several)


def test_few_photos_and_targets_below_a_pixel_give_warnings():
    few = plan(PlanRequest(altitude=40, find="person", samples=4, baseline=1.0, **OWN))
    assert "detection_few_photos" in codes(few)
    coarse = plan(PlanRequest(altitude=110, find="0.1x0.2", **OWN))
    assert "target_below_pixel" in codes(coarse)
    plain = plan(PlanRequest(altitude=40, find="person", **OWN))
    assert not {code for code in codes(plain) if code.startswith("detection")} - {
        "detection_independent_occluders"
    }


def test_on_bare_ground_every_target_is_found():
    bare = plan(
        PlanRequest(
            altitude=40,
            integrated_density=0.0,
            occluder_size=0.2,
            volume_height=10,
            find="person",
            contrast=3.0,
            canopy_offset=0.0,
            crown_share=0.0,
        )
    )
    assert bare.detection.probability == pytest.approx(1.0, abs=1e-3)
    assert bare.detection.unseen == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"signature": "colour"}, "--signature needs --find"),
        ({"find": "person", "contrast": 2.0}, "a signature by numbers needs --canopy-offset"),
        ({"find": "person", "signature": "colour", **OWN}, "have the same meaning"),
        ({"find": "dog"}, "is neither person nor WxL"),
        ({"find": "99x100"}, "is not between"),
        ({"find": "person", **OWN, "contrast": 0.0}, "cannot be found"),
    ],
)
def test_invalid_search_options_are_refused(options, message):
    with pytest.raises(RequestError, match=message):
        PlanRequest(altitude=40, **options)


def test_a_signature_of_flags_overrides_that_of_a_file():
    named = PlanRequest(altitude=40, find="person").document()
    assert named["signature"] == "thermal-dawn"
    numbers = request_from(named, overrides=OWN)
    assert (numbers.signature, numbers.contrast) == (None, OWN["contrast"])
    again = request_from(numbers.document(), overrides={"signature": "colour"})
    assert (again.signature, again.contrast, again.crown_share) == ("colour", None, None)


def test_a_target_is_read_back_from_its_request():
    request = PlanRequest(altitude=40, find="1.7 x 0.5", **OWN)
    assert request.find == "0.5x1.7"
    assert PlanRequest(**request.document()) == request
