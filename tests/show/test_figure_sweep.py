"""Figures of sweeps: fronts and maps compared with brute force over any number of rows."""

import json
import math

import pytest

from aosplan.cli.app import run
from aosplan.errors import RequestError
from aosplan.show.figures.canvas import FigureStyle, drawn, rendered
from aosplan.show.figures.draw import KINDS
from aosplan.show.figures.sweep import (
    BINS,
    MOST_VALUES,
    Cell,
    MapFigure,
    ScatterFigure,
    results_of,
    ticked,
)

pl = pytest.importorskip("polars")

CAMPAIGN = """
[sweep]
altitude = [30, 50, 80]
vhat = [0.8, 0.98, 0.99]
max_aperture = [10, 30]
"""


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sweep")
    (folder / "campaign.toml").write_text(CAMPAIGN)
    for ending in ("parquet", "csv", "jsonl"):
        line = ["sweep", str(folder / "campaign.toml"), "--out", str(folder / f"r.{ending}")]
        assert run([*line, "--quiet"]) == 0
    return folder


def rows_of(path):
    return pl.read_parquet(path).to_dicts()


@pytest.mark.parametrize("ending", ["parquet", "csv", "jsonl"])
def test_a_front_is_that_of_all_pairs(campaign, ending):
    found = results_of(str(campaign / f"r.{ending}"))
    rows = rows_of(campaign / "r.parquet")
    met = [(r["samples"], r["flight_time_s"]) for r in rows if r["status"] == "ok"]
    assert (found.rows, found.met) == (len(rows), len(met))
    best = {a for a in met if not any(b != a and b[0] <= a[0] and b[1] <= a[1] for b in met)}
    assert list(found.front) == [(x, pytest.approx(y)) for x, y in sorted(best)]


def test_more_visibility_is_better(campaign):
    found = results_of(str(campaign / "r.parquet"), "aperture_m", "visibility_expected")
    met = [
        (r["aperture_m"], r["visibility_expected"])
        for r in rows_of(campaign / "r.parquet")
        if r["status"] == "ok"
    ]
    for x, y in found.front:
        assert not any(a <= x and b >= y and (a, b) != (x, y) for a, b in met)
    assert max(b for _, b in met) == max(y for _, y in found.front)


def test_a_map_has_the_means_of_the_rows(campaign):
    found = results_of(str(campaign / "r.csv"), "altitude", "vhat", "flight_time_s")
    assert found.x_values == (30.0, 50.0, 80.0)
    assert found.y_values == (0.8, 0.98, 0.99)
    for y, line in zip(found.y_values, found.cells, strict=True):
        for x, cell in zip(found.x_values, line, strict=True):
            here = [
                r for r in rows_of(campaign / "r.parquet") if (r["altitude"], r["vhat"]) == (x, y)
            ]
            met = [r["flight_time_s"] for r in here if r["status"] == "ok"]
            assert (cell.rows, cell.met) == (len(here), len(met))
            assert cell.value == (pytest.approx(math.fsum(met) / len(met)) if met else None)


@pytest.mark.parametrize(("most", "scale"), [(39.0, "linear"), (41.0, "log")])
def test_a_map_that_spans_much_has_logarithmic_colours(most, scale):
    cells = tuple(tuple(Cell(1, 1, value) for value in row) for row in ((2.0, 3.0), (5.0, most)))
    shown = MapFigure("altitude", "vhat", "samples", 4, 4, (30.0, 50.0), (0.8, 0.9), cells)
    figure = drawn(KINDS["sweep"], shown, FigureStyle())
    assert figure.axes[-1].get_yscale() == scale
    (mesh,) = figure.axes[0].collections
    low, place, high = ((math.log if scale == "log" else float)(end) for end in (2.0, 5.0, most))
    assert float(mesh.norm(5.0)) == pytest.approx((place - low) / (high - low))


def test_a_map_says_what_cannot_be_met_and_what_is_missing(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text(
        "scene,altitude,samples,status\na,40,10,ok\na,50,,infeasible\nb,40,20,ok\nb,40,,infeasible\n"
    )
    found = results_of(str(path), "altitude", "scene", "samples")
    assert [[cell and cell[:2] for cell in row] for row in found.cells] == [
        [(1, 1), (1, 0)],
        [(2, 1), None],
    ]
    from matplotlib import rc_context

    with rc_context():
        figure = drawn(KINDS["sweep"], found, FigureStyle())
    words = {text.get_text() for text in figure.legends[0].get_texts()}
    assert words == {"no feasible scenario", "some infeasible scenarios", "no scenario"}
    assert "cells without a feasible scenario: 1" in found.description()


def test_many_rows_become_few_points(tmp_path):
    import numpy as np

    rng = np.random.default_rng(1)
    x, y = rng.random(200_000), rng.random(200_000)
    path = tmp_path / "r.parquet"
    pl.DataFrame({"samples": x, "flight_time_s": y, "status": ["ok"] * len(x)}).write_parquet(path)
    found = results_of(str(path))
    assert len(found.points) <= BINS[0] * BINS[1]
    assert len(found.front) <= BINS[0]
    # Each point of the front is a row that no other row dominates.
    for a, b in found.front:
        assert not ((x <= a) & (y <= b) & ((x < a) | (y < b))).any()
        assert ((x == a) & (y == b)).any()


def test_a_map_of_too_many_cells_is_refused(tmp_path):
    path = tmp_path / "r.csv"
    rows = "".join(f"{k},1,5,ok\n" for k in range(2 * MOST_VALUES))
    path.write_text(f"altitude,vhat,samples,status\n{rows}")
    with pytest.raises(RequestError, match="different values, and a map at most"):
        results_of(str(path), "altitude", "vhat", "samples")


def test_a_sweep_draws_itself_as_plot_draws_its_results(campaign, tmp_path, capsys):
    names = ["altitude", "vhat", "samples"]
    line = ["sweep", str(campaign / "campaign.toml"), "--out", str(tmp_path / "r.csv")]
    flags = [
        word
        for pair in zip(("--plot-x", "--plot-y", "--plot-value"), names, strict=True)
        for word in pair
    ]
    assert run([*line, "--plot", str(tmp_path / "a.svg"), *flags]) == 0
    assert f"Wrote {tmp_path / 'a.svg'}" in capsys.readouterr().out
    flags = [word for pair in zip(("--x", "--y", "--value"), names, strict=True) for word in pair]
    line = ["plot", "sweep", str(tmp_path / "r.csv"), *flags]
    assert run([*line, "--out", str(tmp_path / "b.svg"), "--json"]) == 0
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    assert json.loads(capsys.readouterr().out)["data"]["value"] == "samples"


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("plot sweep", "no results are given"),
        ("plot sweep nothing.csv", "no file 'nothing.csv'"),
        ("plot sweep r.txt", "does not have one of the extensions .csv, .parquet, .jsonl"),
        ("plot sweep r.csv --x sample", "the results have no column 'sample'"),
        ("plot sweep r.csv --value samples", "--value without --x and --y"),
        ("plot sweep r.csv --altitude 40", "--altitude cannot be used with the results of a sweep"),
        ("plot sweep r.csv --x scene --y samples", "nothing to draw"),
        (
            "plot sweep r.csv --x scene --y samples --value scene",
            "no scenario has a number in 'scene'",
        ),
        ("plot sweep other.csv --x a --y b", "has no column 'status'"),
        ("plot sweep broken.parquet", "the results cannot be read"),
        ("plot sweep empty.csv", "the results cannot be read"),
        ("plot grid --altitude 40 --x samples", "--x, --y and --value are for sweep"),
        (
            "sweep c.toml --out o.csv --plot o.gif",
            "does not have one of the extensions .png, .svg, .pdf",
        ),
        ("sweep c.toml --out o.csv --plot-x altitude", "need --plot"),
        (
            "sweep c.toml --out o.csv --plot o.svg --plot-y nowhere",
            "--plot-y: the results have no column",
        ),
    ],
)
def test_wrong_requests_get_one_line_and_nothing_is_written(
    line, words, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "r.csv").write_text("scene,samples,flight_time_s,status\npine,5,12,ok\n")
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "broken.parquet").write_bytes(b"PAR1nonsense")
    (tmp_path / "c.toml").write_text(CAMPAIGN)
    before = sorted(tmp_path.iterdir())
    assert run(line.split()) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("error: ")
    assert words in err
    assert sorted(tmp_path.iterdir()) == before


def test_columns_may_have_any_name(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text('"$a_{x$","<b>",samples,status\n1,2,3,ok\n2,2,4,ok\n')
    found = results_of(str(path), "$a_{x$", "<b>", "samples")
    assert isinstance(found, MapFigure)
    assert b"&lt;b&gt;" in rendered(KINDS["sweep"], found, "svg")
    assert isinstance(results_of(str(path), "$a_{x$", "<b>"), ScatterFigure)


@pytest.mark.parametrize(
    ("values", "shown"),
    [
        (range(30, 111), ["30", "40", "50", "60", "70", "80", "90", "100", "110"]),
        (range(3), ["0", "1", "2"]),
        (range(17, 43), ["20", "25", "30", "35", "40"]),
        ([7], ["7"]),
    ],
)
def test_ticks_of_a_map_are_few_and_round(values, shown):
    labels = [str(value) for value in values]
    assert [labels[place] for place in ticked(labels)] == shown
