"""Figures of sweeps: fronts and maps compared with brute force over any number of rows."""

import json
import math

import pytest

from aosplan.cli.app import run
from aosplan.errors import RequestError
from aosplan.show.figures.canvas import FigureStyle, drawn, rendered
from aosplan.show.figures.draw import KINDS
from aosplan.show.figures.sweep import ticked
from aosplan.show.figures.sweep_columns import ColumnChoice
from aosplan.show.figures.sweep_results import (
    BINS,
    MOST_GROUPS,
    MOST_PANELS,
    MOST_VALUES,
    Cell,
    MapFigure,
    ScatterFigure,
    frame_of,
    results_of,
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
    found = results_of(
        str(campaign / "r.parquet"), ColumnChoice("aperture_m", "visibility_expected")
    )
    met = [
        (r["aperture_m"], r["visibility_expected"])
        for r in rows_of(campaign / "r.parquet")
        if r["status"] == "ok"
    ]
    for x, y in found.front:
        assert not any(a <= x and b >= y and (a, b) != (x, y) for a, b in met)
    assert max(b for _, b in met) == max(y for _, y in found.front)


def test_a_map_has_the_means_of_the_rows(campaign):
    found = results_of(str(campaign / "r.csv"), ColumnChoice("altitude", "vhat", "flight_time_s"))
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


def test_a_map_describes_infeasible_and_missing_scenarios(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text(
        "scene,altitude,samples,status\na,40,10,ok\na,50,,infeasible\nb,40,20,ok\nb,40,,infeasible\n"
    )
    found = results_of(str(path), ColumnChoice("altitude", "scene", "samples"))
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
    with pytest.raises(RequestError, match="different values, but a map can have at most"):
        results_of(str(path), ColumnChoice("altitude", "vhat", "samples"))


def test_sweep_draws_the_same_figure_as_plot(campaign, tmp_path, capsys):
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
        ("plot sweep", "no results of a sweep are given"),
        ("plot sweep nothing.csv", "no file 'nothing.csv'"),
        ("plot sweep r.txt", "does not have one of the extensions .csv, .parquet, .jsonl"),
        ("plot sweep r.csv --x sample", "the results have no column 'sample'"),
        ("plot sweep r.csv --value samples", "--value needs --x and --y"),
        ("plot sweep r.csv --altitude 40", "--altitude cannot be used with the results of a sweep"),
        ("plot sweep r.csv --x scene --y samples", "nothing to draw"),
        (
            "plot sweep r.csv --x scene --y samples --value scene",
            "no scenario has a number in 'scene'",
        ),
        ("plot sweep other.csv --x a --y b", "has no column 'status'"),
        ("plot sweep broken.parquet", "the results cannot be read"),
        ("plot sweep empty.csv", "the results cannot be read"),
        (
            "plot grid --altitude 40 --x samples",
            "--x, --y, --value and --by cannot be used with the figure 'grid'",
        ),
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
    found = results_of(str(path), ColumnChoice("$a_{x$", "<b>", "samples"))
    assert isinstance(found, MapFigure)
    assert b"&lt;b&gt;" in rendered(KINDS["sweep"], found, "svg")
    assert isinstance(results_of(str(path), ColumnChoice("$a_{x$", "<b>")), ScatterFigure)


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


# A third column


@pytest.mark.parametrize("ending", ["parquet", "csv", "jsonl"])
def test_few_values_have_their_own_points(campaign, ending):
    found = results_of(str(campaign / f"r.{ending}"), ColumnChoice(by="altitude"))
    plain = results_of(str(campaign / f"r.{ending}"))
    assert found._replace(by=None, groups=()) == plain
    assert [group.value for group in found.groups] == [30.0, 50.0, 80.0]
    for group in found.groups:
        assert list(group.points) == sorted(
            {
                (r["samples"], r["flight_time_s"])
                for r in rows_of(campaign / "r.parquet")
                if r["status"] == "ok" and r["altitude"] == group.value
            }
        )
    assert "Colours: altitude [m] 30, 50, 80." in found.description()


def scattered(count=300, by=None):
    """Rows of a sweep with two random results and a third column, which by default depends on both."""
    import numpy as np

    rng = np.random.default_rng(3)
    x, y = rng.random((2, count))
    third = 1.0 + x + y if by is None else by
    return pl.DataFrame({"samples": x, "flight_time_s": y, "third": third, "status": "ok"})


def test_many_numbers_are_shades():
    frame = scattered()
    found = frame_of(frame.lazy(), ColumnChoice(by="third"))
    assert not found.groups
    # Few random points share a cell.
    alone = {
        (x, y): third for x, y, third in frame.select("samples", "flight_time_s", "third").rows()
    }
    same = [alone.get(point) for point in found.points]
    assert sum(each is not None for each in same) > 250
    for shade, own in zip(found.shades, same, strict=True):
        if own is not None and shade != pytest.approx(own, rel=1e-9):
            assert shade == pytest.approx(own, abs=0.01)  # The shade is the mean of a cell.
    figure = drawn(KINDS["sweep"], found, FigureStyle())
    (points,) = figure.axes[0].collections
    assert points.get_offsets().tolist() == [list(point) for point in found.points]
    assert points.get_array().tolist() == list(found.shades)
    assert figure.axes[1].get_ylabel() == "third"


def test_groups_differ_in_colour_and_marker(campaign):
    found = results_of(str(campaign / "r.csv"), ColumnChoice(by="altitude"))
    figure = drawn(KINDS["sweep"], found, FigureStyle())
    lines = {line.get_label(): line for line in figure.axes[0].lines}
    shown = [lines[f"altitude = {value} m"] for value in (30, 50, 80)]
    assert len({line.get_color() for line in shown}) == 3
    assert len({line.get_marker() for line in shown}) == 3
    for line, group in zip(shown, found.groups, strict=True):
        assert list(zip(*line.get_data(), strict=True)) == list(group.points)


def test_text_with_many_values_cannot_colour_points():
    words = [f"scene {k % (MOST_GROUPS + 1)}" for k in range(300)]
    with pytest.raises(RequestError, match="more than 4 different values, which are not numbers"):
        frame_of(scattered(by=words).lazy(), ColumnChoice(by="third"))
    few = [f"scene {k % MOST_GROUPS}" for k in range(300)]
    found = frame_of(scattered(by=few).lazy(), ColumnChoice(by="third"))
    assert [group.value for group in found.groups] == [f"scene {k}" for k in range(MOST_GROUPS)]


@pytest.mark.parametrize(
    "count",
    [
        1,
        2,
        *(pytest.param(count, marks=pytest.mark.slow) for count in range(3, MOST_PANELS)),
        MOST_PANELS,
    ],
)
def test_each_value_has_a_map_in_the_same_colours(count):
    rows = [
        {"a": a, "b": b, "c": c, "samples": 10.0 * c + a + b, "status": "ok"}
        for a in (1, 2)
        for b in (3, 4)
        for c in range(count)
    ]
    lazy = pl.DataFrame(rows).lazy()
    found = frame_of(lazy, ColumnChoice("a", "b", "samples", "c"))
    assert found.values == tuple(range(count))
    for c, each in zip(found.values, found.maps, strict=True):
        one = frame_of(lazy.filter(pl.col("c") == c), ColumnChoice("a", "b", "samples"))
        assert each == one
    figure = drawn(KINDS["sweep"], found, FigureStyle())
    *panels, scale = figure.axes
    assert [panel.get_title() for panel in panels] == [f"c = {c}" for c in range(count)]
    assert scale.get_ylabel().startswith("samples N")
    limits = {panel.collections[0].get_clim() for panel in panels}
    assert limits == {(4.0, 10.0 * (count - 1) + 6.0)}
    assert rendered(KINDS["sweep"], found, "png") == rendered(KINDS["sweep"], found, "png")


def test_a_figure_of_too_many_maps_is_refused():
    rows = [
        {"a": 1, "b": 2, "c": c, "samples": 1.0, "status": "ok"} for c in range(MOST_PANELS + 1)
    ]
    with pytest.raises(
        RequestError, match="more than 6 different values, but a figure can have at most 6"
    ):
        frame_of(pl.DataFrame(rows).lazy(), ColumnChoice("a", "b", "samples", "c"))


def test_plot_and_sweep_accept_a_third_column(campaign, tmp_path, capsys):
    results, own = campaign / "r.parquet", tmp_path / "own.svg"
    line = ["plot", "sweep", str(results), "--by", "altitude", "--out", str(own), "--json"]
    assert run(line) == 0
    assert [g["value"] for g in json.loads(capsys.readouterr().out)["data"]["groups"]] == [
        30.0,
        50.0,
        80.0,
    ]
    line = ["sweep", str(campaign / "campaign.toml"), "--out", str(tmp_path / "r.parquet")]
    assert run([*line, "--plot", str(tmp_path / "swept.svg"), "--plot-by", "altitude"]) == 0
    assert (tmp_path / "swept.svg").read_bytes() == own.read_bytes()
    capsys.readouterr()
    assert run(["plot", "sweep", str(results), "--by", "altitud"]) == 2
    assert "hint: did you mean altitude?" in capsys.readouterr().err


def test_in_python_several_maps_are_an_array_of_axes(campaign):
    import aosplan

    plt = pytest.importorskip("matplotlib.pyplot")
    plt.switch_backend("agg")
    swept = aosplan.sweep({"altitude": [30, 40], "vhat": [0.8, 0.9], "speed": [3, 8]})
    columns = {"x": "altitude", "y": "vhat", "value": "flight_time_s", "by": "speed"}
    assert swept.plot(**columns).shape == (2,)
    assert swept.plot(by="speed").get_legend() is not None
    with pytest.raises(RequestError, match="several maps do not fit into one axes"):
        swept.plot(plt.figure().subplots(), **columns)
    plt.close("all")
