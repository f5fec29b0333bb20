"""Sweeps with a target have the same detection in each row as `plan`."""

import csv
import json

import pytest

SWEEP = """[sweep]
altitude = 40
integrated_density = [0.6, 0.9]
occluder_size = 0.5
volume_height = 2
samples = 16
baseline = [1.0, 3.0]
"""
FIND = 'find = "person"\ncontrast = 3\ncanopy_offset = 0\ncrown_share = 0\n'
LINE = ["plan", "--altitude", "40", "--occluder-size", "0.5", "--volume-height", "2"]
LINE += ["--samples", "16", "--find", "person", "--contrast", "3", "--canopy-offset", "0"]
LINE += ["--crown-share", "0"]


@pytest.fixture
def swept(tmp_path, command):
    def run(text, *options):
        pytest.importorskip("polars")
        (tmp_path / "sweep.toml").write_text(text)
        out = tmp_path / "rows.csv"
        status, _, err = command(
            "sweep", tmp_path / "sweep.toml", "--out", out, "--force", *options
        )
        assert status == 0, err
        with open(out, newline="") as file:
            return list(csv.DictReader(file))

    return run


def test_rows_have_the_detection_of_their_plan(swept, command):
    rows = swept(SWEEP + FIND)
    assert len(rows) == 4
    for row in rows:
        given = ["--integrated-density", row["integrated_density"], "--baseline", row["baseline"]]
        planned = json.loads(command(*LINE, *given, "--json")[1])["detection"]
        assert float(row["detection_probability"]) == planned["probability"]
        unseen = 1.0 - planned["seen_share"]["at_least"]["0.01"]
        assert float(row["detection_unseen"]) == pytest.approx(unseen, abs=1e-12)
    (best,) = swept(SWEEP + FIND, "--best", "detection_probability")
    assert best["detection_probability"] == max(
        (row["detection_probability"] for row in rows), key=float
    )


def test_rows_without_a_target_have_no_detection(swept):
    assert all("detection_probability" not in row for row in swept(SWEEP))
    asked = swept(SWEEP, "--columns", "samples,detection_probability")
    assert [row["detection_probability"] for row in asked] == [""] * 4
