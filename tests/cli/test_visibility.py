"""The `visibility` command."""

import shlex

import pytest
from support.command_line import check_refusal

from aosplan.grid.patterns import pattern_for
from aosplan.models.positions import pattern_shortfall


def test_the_calculator_computes_equation_2(document):
    result = document("visibility", "--density", "0.567", "--samples", "50", "--dhat", "1")
    v = result["visibility"]
    assert (result["schema"], result["samples"], result["dhat"]) == (1, 50, 1.0)
    assert v["normalized"] == pytest.approx(0.98)
    assert v["expected"] == pytest.approx(1 - 0.567**2 - 0.567 * 0.433 / 50)


def test_visibility_accepts_a_slice_density_and_height_ratio(document):
    result = document(
        *shlex.split("visibility --slice-density 0.0095 --height-ratio 87.69 --grid 7x7 --dhat 1")
    )
    assert result["visibility"]["density"] == pytest.approx(0.567, abs=5e-4)


@pytest.mark.parametrize("grid", ["7x8", "7X8", "7×8"])
def test_visibility_accepts_complete_grids(document, grid):
    result = document("visibility", "--density", "0.5", "--grid", grid, "--dhat", "0.25")
    assert result["samples"] == 56
    assert result["visibility"]["normalized"] < 1 - 1 / 56


def one_disparity(planned, spacing):
    """V̂ of a plan's grid with a single d̂, as in the command `visibility`.  Plans use slices
    instead.
    """
    pattern = pattern_for("trimmed", planned["samples"])
    return 1.0 - pattern_shortfall(pattern, planned["baseline_m"] / spacing)


def test_visibility_accepts_the_waypoints_of_a_plan(folder, document, command):
    planned = document("plan", "--altitude", "40", "--baseline", "1.9", "--out", "a.csv")
    # At the optimal baseline an occluder moves by its own size.
    spacing = planned["baseline_m"] / planned["disparity"]["normalized"]
    density = planned["visibility"]["density"]
    line = ["visibility", "--positions", "a.csv", "--spacing", spacing, "--density", density]
    result = document(*line)
    assert result["samples"] == planned["samples"]
    # Positions in files are rounded to 0.1 mm.
    assert result["visibility"]["normalized"] == pytest.approx(
        one_disparity(planned, spacing), abs=1e-5
    )


@pytest.mark.parametrize(("heading", "ending"), [(30, "csv"), (-75.5, "geojson"), (360, "plan")])
def test_visibility_rotates_waypoints_to_the_heading(folder, document, heading, ending):
    where = ["--origin", "48.3358,14.3261", f"--heading={heading}", "--out", f"a.{ending}"]
    planned = document("plan", "--altitude", "40", "--baseline", "1.9", *where)
    spacing = planned["baseline_m"] / planned["disparity"]["normalized"]
    line = ["visibility", "--positions", f"a.{ending}", "--spacing", spacing, "--density", "0.5"]
    wanted = pytest.approx(one_disparity(planned, spacing), abs=1e-5)
    assert document(*line, f"--heading={heading}")["visibility"]["normalized"] == wanted
    assert (document(*line)["visibility"]["normalized"] == wanted) == (heading == 360)


def test_visibility_omits_vhat_if_nothing_is_hidden(command):
    # With p = 0, V̂ is 0/0, which is null in JSON.
    status, out, _ = command("visibility", "--density", "0", "--samples", "50", "--dhat", "1")
    assert status == 0
    assert "0.98" not in out


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("x,y\n0,0\n1\n", "line 3"),
        ("x,y\n0,a\n", "line 2"),
        ("x,y\n0,nan\n", "line 2"),
        ("x;y\n0;1\n", "has no columns"),
        ("", "has no columns"),
        ("x,y\n", "contains no positions"),
        ("x,y\n1e308,1e308\n-1e308,0\n", ""),
    ],
)
def test_invalid_positions_are_refused_with_their_line(folder, command, content, words):
    (folder / "p.csv").write_text(content)
    refused = command("visibility", "--density", "0.5", "--positions", "p.csv", "--spacing", "1")
    check_refusal(*refused)
    assert words in refused[2]


@pytest.mark.parametrize("header", ["x,y", "east_m,north_m", "index,EAST_M , north_m", "y,x"])
def test_positions_are_found_by_their_columns(folder, document, header):
    row = {"x": "0", "y": "3", "east_m": "0", "north_m": "3", "index": "9"}
    names = [name.strip().lower() for name in header.split(",")]
    other = dict.fromkeys(names, "0")
    lines = [header, ",".join(row[n] for n in names), ",".join(other[n] for n in names)]
    (folder / "p.csv").write_text("\ufeff" + "\n".join(lines) + "\n\n", encoding="utf-8")
    result = document("visibility", "--density", "0.5", "--positions", "p.csv", "--spacing", "4")
    # For two samples that are three quarters of a spacing apart, K = (1 + 1/4) / 2.
    assert result["samples"] == 2
    assert result["visibility"]["shortfall"] == pytest.approx(0.625)
