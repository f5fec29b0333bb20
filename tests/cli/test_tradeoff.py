"""`tradeoff` gives the same table in three formats."""

import csv

import pytest
from support.command_line import loads


def test_the_trade_off_is_the_same_table_in_three_formats(folder, document, command):
    line = ["tradeoff", "--altitude", "40", "--vhat", "0.9", "--max-samples", "30"]
    rows = document(*line, "--optimize", "aperture")["rows"]
    assert [row["samples"] for row in rows] == list(range(1, 31))
    chosen = document("plan", *line[1:], "--optimize", "aperture")
    (own,) = (row for row in rows if row["chosen"])
    assert (own["samples"], own["baseline_m"]) == (chosen["samples"], chosen["baseline_m"])
    assert own["time_s"] == pytest.approx(chosen["flight"]["time_s"], rel=1e-12)
    assert [own["extent_x_m"], own["extent_y_m"]] == chosen["grid"]["extent_m"]
    for name in ("table.csv", "table.json", "table.jsonl"):
        status, _, err = command(*line, "--optimize", "aperture", "--out", name)
        # There is one warning: the disparity is below one pixel.
        assert (status, err.count("\n")) == (0, 1)
    assert loads((folder / "table.json").read_text())["rows"] == rows
    lines = (folder / "table.jsonl").read_text().splitlines()
    assert [loads(line) for line in lines] == rows
    with open(folder / "table.csv", newline="") as file:
        table = list(csv.DictReader(file))
    assert [set(row) for row in table] == [set(row) for row in rows]
    for cells, row in zip(table, rows, strict=True):
        assert float(cells["baseline_m"]) == row["baseline_m"]
        assert cells["meets"] == str(row["meets"]).lower()


def test_the_trade_off_shows_the_front_and_the_plan_on_a_terminal(command):
    status, out, err = command(
        "tradeoff", "--altitude", "40", "--grid", "best", "--max-samples", "60"
    )
    assert (status, err) == (0, "")
    assert all(len(line) <= 80 for line in out.splitlines())
    # The mark is in the row of the plan and in the note.
    assert sum("◀" in line for line in out.splitlines()) == 2


def test_rows_of_a_trade_off_have_the_probability_of_detection(document, command):
    scene = ["--integrated-density", "0.8", "--occluder-size", "0.5", "--volume-height", "3"]
    own = ["--contrast", "3", "--canopy-offset", "0", "--crown-share", "0", "--find", "person"]
    line = ["--altitude", "40", "--vhat", "0.9", "--max-samples", "14", *scene]
    rows = document("tradeoff", *line, *own)["rows"]
    planned = document("plan", *line, *own)
    (chosen,) = (row for row in rows if row["chosen"])
    # The probabilities in the rows come from an interpolated table of offsets.
    assert chosen["detection"] == pytest.approx(planned["detection"]["probability"], abs=0.02)
    assert len({row["detection"] for row in rows}) > 5
    assert all("detection" not in row for row in document("tradeoff", *line)["rows"])
    _, out, _ = command("tradeoff", *line, *own)
    assert "found" in out
