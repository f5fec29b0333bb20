"""The figures of the paper: their stored numbers are compared with exact values, and are computed
again.
"""

import csv
import runpy
import sys

import numpy as np
import pytest
from reference import exact
from support.paths import ROOT

PAPER = ROOT / "examples" / "paper"
FIGURES = ("2b", "3", "4", "5", "6", "7", "8", "10")


def table(name, folder=PAPER / "results"):
    with (folder / f"figure_{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def figure_script(name, monkeypatch, folder):
    """Run a figure's script with another output folder."""
    pytest.importorskip("matplotlib")
    monkeypatch.syspath_prepend(str(PAPER))
    for module in ("common", *(f"figure_{each}" for each in FIGURES)):
        monkeypatch.delitem(sys.modules, module, raising=False)
    import common

    monkeypatch.setattr(common, "RESULTS", folder)
    runpy.run_path(str(PAPER / f"figure_{name}.py"), run_name="__main__")


@pytest.mark.parametrize("name", FIGURES)
def test_every_figure_has_a_script_a_picture_and_its_numbers(name):
    assert (PAPER / f"figure_{name}.py").exists()
    assert (PAPER / "results" / f"figure_{name}.png").read_bytes()[:4] == b"\x89PNG"
    assert len(table(name)) >= 8


@pytest.mark.parametrize(
    "name",
    [name if name == "2b" else pytest.param(name, marks=pytest.mark.slow) for name in FIGURES],
)
def test_made_again_the_numbers_are_the_committed_ones(name, tmp_path, monkeypatch, capsys):
    figure_script(name, monkeypatch, tmp_path)
    told = capsys.readouterr().out
    if name in ("2b", "4"):
        assert "within 2 standard errors" in told
    for made, kept in zip(table(name, tmp_path), table(name), strict=True):
        for column, value in kept.items():
            assert (made[column] == value) or float(made[column]) == pytest.approx(
                float(value), rel=1e-4
            )


def test_lines_of_figures_3_and_4_are_eq_2():
    for row in [*table("3"), *({"p": "0.25", "N": "100"} | row for row in table("4"))]:
        side = round(float(row["N"]) ** 0.5)
        k = exact.grid_shortfall(side, side, float(row["d_px"]) / 5.0)
        assert float(row["V"]) == pytest.approx(
            float(exact.visibility(float(row["p"]), k)), rel=1e-5
        )


def test_lines_of_figure_5_are_eq_3_and_4():
    for row in table("5"):
        p, n = float(row["p"]), float(row["N"])
        v = 1 - p**2 - p * (1 - p) / n if row["panel"] == "a" else 1 - 1 / n
        assert float(row["model"]) == pytest.approx(v, rel=1e-5)


@pytest.mark.parametrize(
    ("name", "model", "simulated"),
    [("2b", "p", "p_simulated"), ("3", "V", "V_simulated"), ("4", "V", "V_simulated"),
     ("5", "model", "simulated")],
)  # fmt: skip
def test_simulated_points_scatter_about_the_lines_as_their_errors_say(name, model, simulated):
    rows = [row for row in table(name) if row[simulated]]
    z = np.array(
        [(float(r[simulated]) - float(r[model])) / float(r["standard_error"]) for r in rows]
    )
    # Errors are from 16 patterns, so z has a Student's t distribution with 15 degrees of freedom.
    # Its variance is 15/13, and that of its square 3.45.
    assert abs(z.mean()) < 4 * np.sqrt(15 / 13 / len(z))
    assert (z**2).mean() < 15 / 13 + 4 * np.sqrt(3.45 / len(z))
    assert np.abs(z).max() < 5


def test_a_model_off_by_a_fiftieth_would_be_found():
    rows = table("3")
    z = [
        (float(r["V_simulated"]) - 0.98 * float(r["V"])) / float(r["standard_error"]) for r in rows
    ]
    assert abs(np.mean(z)) > 8 * np.sqrt(15 / 13 / len(z))


def test_wider_and_more_is_never_much_worse_in_the_matrix():
    cells = {(int(r["N"]), float(r["b_m"])): float(r["vhat"]) for r in table("8")}
    for (n, b), vhat in cells.items():
        assert all(cells[m, c] >= vhat - 0.02 for m, c in cells if m >= n and c >= b)


def test_similarity_of_the_recording_rises_with_the_aperture_to_one():
    rows = [row for row in table("10") if row["views"].startswith("all")]
    ssim = [float(row["ssim"]) for row in rows]
    assert (np.diff(ssim) > -0.01).all()
    assert rows[-1]["N"] == "504"
    assert ssim[-1] == pytest.approx(1.0)
