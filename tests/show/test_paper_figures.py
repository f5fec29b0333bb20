"""Figures of the paper: their numbers compared with its equations and with earlier runs."""

import json
import math
from fractions import Fraction

import matplotlib as mpl
import numpy as np
import pytest
from approved.make import shown
from matplotlib.backends.backend_agg import FigureCanvasAgg
from reference import exact

import aosplan
from aosplan.cli.app import run
from aosplan.show.figures.canvas import FigureStyle, drawn
from aosplan.show.figures.paper.paper_figure import PaperValue, agreement
from aosplan.show.figures.paper.registry import FIGURES, checked_number, kind_of, numbers_of
from aosplan.show.figures.style import DARK, LONGEST, rules

QUICK = ("5", "6")
"""Figures that are computed in the quick tests, in addition to 2b."""

EVERY = [
    pytest.param(number, marks=[] if number in QUICK else pytest.mark.slow) for number in FIGURES
]


@pytest.fixture(scope="module")
def figure_of():
    """The numbers of a figure, computed once."""
    known = {"2b": shown("paper")}

    def found(number):
        if number not in known:
            known[number] = numbers_of(number)
        return known[number]

    return found


def projects(found):
    """The numbers that aosplan computes, by quantity, without units and standard errors."""
    return {value.quantity: float(value.project.split()[0]) for value in found.values}


# The numbers


def test_the_curves_of_density_are_exact():
    found = shown("paper")
    curves = found.where(part="curve")
    for d, ratio, p in zip(curves["D"], curves["l_over_o"], curves["p"], strict=True):
        assert p == pytest.approx(float(1 - (1 - Fraction(d)) ** int(ratio)), abs=1e-15)
    assert projects(found) == {
        "l/o at which D = 0.95 % gives p = 56.7 %": round(math.log(0.433) / math.log(0.9905), 2)
    }


def test_simulated_volumes_have_the_density_of_the_curves():
    points = shown("paper").where(part="point")
    away = (np.array(points["p_simulated"]) - points["p"]) / points["standard_error"]
    # The mean square of 16 standardised errors is 1 ± 0.35.
    assert 0.2 < np.mean(away**2) < 2.4


def test_the_limits_of_visibility_are_those_of_the_paper(figure_of):
    found = figure_of("5")
    for panel, model in (
        ("a", lambda p, n: 1 - p**2 - p * (1 - p) / n),
        ("b", lambda _, n: 1 - 1 / n),
    ):
        for part in (f"{panel} curve", f"{panel} point"):
            rows = found.where(part=part)
            wanted = [model(p, n) for p, n in zip(rows["p"], rows["N"], strict=True)]
            assert rows["model"] == pytest.approx(wanted, abs=1e-12)
    limit = found.where(part="a limit")
    assert limit["model"] == pytest.approx([1 - p**2 for p in limit["p"]], abs=1e-12)
    assert projects(found) == {"N that V̂ = 98 % requires": 50, "p at which V gains most": 0.5}


def test_the_stand_has_the_density_of_the_paper(figure_of):
    found = figure_of("6")
    assert projects(found) == {
        "p of the stand, which is generated with this p": 0.567,
        "p by Eq. 1 with the stand's mean D": 0.809,
        "b at which 98 % have d̂ ≥ 1, uniform": 3.5,
        "b at which 98 % have d̂ ≥ 1, stand": 3.05,
    }
    for panel in "ab":
        rows = found.where(panel=panel)
        for name in ("model", "stand"):
            assert np.diff(rows[name]).min() >= 0.0
            assert 0.0 <= min(rows[name]) <= max(rows[name]) <= 1.0


@pytest.mark.slow
@pytest.mark.parametrize("number", ["3", "4"])
def test_averaged_patterns_have_the_visibility_of_eq_2(figure_of, number):
    found = figure_of(number)
    points = found.where(part="point") if number == "3" else found.where()
    count = len(points["d_px"])
    densities = points["p"] if number == "3" else [0.25] * count
    samples = points["N"] if number == "3" else [100] * count
    for p, n, d_px, v in zip(densities, samples, points["d_px"], points["V"], strict=True):
        side = math.isqrt(n)
        k = exact.grid_shortfall(side, side, d_px / 5.0)
        assert v == pytest.approx(float(exact.visibility(p, k)), rel=1e-9)
    away = (np.array(points["V_simulated"]) - points["V"]) / points["standard_error"]
    # The errors are estimated from 16 patterns. The standardised errors have a Student's t
    # distribution with 15 degrees of freedom, whose variance is 15/13. At disparity 0, V is equal
    # for all N, so there are fewer points.
    assert np.mean(away**2) < 15 / 13 + 4 * math.sqrt(3.1 / (len(away) / 2))
    if number == "3":  # A model whose V is wrong by 0.02 is found.
        wrong = away + 0.02 * np.array(points["V"]) / points["standard_error"]
        assert abs(wrong.mean()) > 8 * math.sqrt(15 / 13 / len(away))


@pytest.mark.slow
def test_more_samples_and_wider_grids_are_never_much_worse(figure_of):
    found = figure_of("8").where()
    cells = dict(zip(zip(found["N"], found["b_m"], strict=True), found["vhat"], strict=True))
    for (n, b), vhat in cells.items():
        assert all(cells[m, c] >= vhat - 0.02 for m, c in cells if m >= n and c >= b)


@pytest.mark.slow
def test_the_similarity_to_all_images_increases_with_the_aperture_to_one(figure_of):
    found = figure_of("10").where(views="all, 2 m apart")
    assert min(np.diff(found["ssim"])) > -0.01
    assert found["ssim"][-1] == pytest.approx(1.0)


@pytest.mark.slow
def test_paper_figures_give_the_values_that_the_documentation_quotes(figure_of):
    """The values that docs/how_true.md quotes."""
    seven, eight, nine = (projects(figure_of(number)) for number in ("7", "8", "9"))
    assert seven["V̂ of 50 samples 3.5 m apart, each target below its own"] == 0.864
    assert seven["V̂ of 50 samples 3.5 m apart, 12 m below one aperture"] == pytest.approx(
        0.918, abs=0.002
    )
    assert list(eight.values()) == [0.037, -0.069]
    assert list(nine.values()) == [0.70, 0.83]
    ten = projects(figure_of("10"))
    assert [*ten.values()][:2] == [*nine.values()]


def test_another_seed_is_another_simulation_and_reported():
    one, same, other = (numbers_of("6", seed) for seed in (7, 7, 8))
    assert one.rows == same.rows != other.rows
    assert "Seed 7." in one.description()
    assert one.document()["seed"] == 7


def test_steps_are_counted_to_the_end():
    told = []
    numbers_of("2b", progress=lambda done, total: told.append((done, total)))
    assert told == [(k, 16) for k in range(1, 17)]


def test_agreement_counts_points_within_two_standard_errors():
    text = agreement("V", [0.1, -1.9, 2.5])
    assert "2 of 3 simulated points" in text
    assert "the farthest is 2.5 standard errors away" in text


# The drawing


@pytest.mark.parametrize("number", EVERY)
@pytest.mark.parametrize(
    "look",
    [
        pytest.param(FigureStyle(DARK, width_mm=140.0), id="narrow"),
        pytest.param(FigureStyle(), id="wide", marks=pytest.mark.slow),
    ],
)
def test_no_words_are_cut_or_on_others(figure_of, number, look):
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(rules(look.theme))
        figure = drawn(kind_of(number), figure_of(number), look)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        box, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
        assert min(box.x0, box.y0) >= -0.01
        assert (box.x1, box.y1) <= (width + 0.01, height + 0.01)
        upper, lower = figure.subfigs
        cells = [text.get_window_extent() for text in lower.texts]
        legends = [legend.get_window_extent() for legend in upper.legends]
        panels = [axes.get_tightbbox() for axes in upper.axes]
        parts = [*cells, *legends, *panels, upper._suptitle.get_window_extent()]
        for index, one in enumerate(parts):
            for other in parts[:index]:
                across = min(one.x1, other.x1) - max(one.x0, other.x0)
                along = min(one.y1, other.y1) - max(one.y0, other.y0)
                assert min(across, along) <= 1.0  # pixels


@pytest.mark.parametrize("number", EVERY)
def test_the_paper_and_the_project_are_side_by_side(figure_of, number):
    found = figure_of(number)
    figure = drawn(kind_of(number), found, FigureStyle())
    words = [text.get_text() for text in figure.subfigs[1].texts]
    assert words == [f"seed {found.seed}", "paper", "here", *(w for v in found.values for w in v)]
    assert all(len(value.quantity) <= LONGEST for value in found.values)
    assert all(isinstance(value, PaperValue) for value in found.values)


@pytest.mark.parametrize("number", EVERY)
def test_axes_have_names_and_pictures_have_titles(figure_of, number):
    figure = drawn(kind_of(number), figure_of(number), FigureStyle())
    for panel in figure.axes:
        if panel.images:
            assert panel.get_title(loc="center")
        else:
            assert panel.get_xlabel()
            assert panel.get_ylabel() or number == "3"


@pytest.mark.parametrize("number", EVERY)
def test_the_document_is_plain_json(figure_of, number):
    found = figure_of(number)
    assert json.loads(json.dumps(found.document(), allow_nan=False))["number"] == number
    assert len(found.names) == len(found.rows[0])
    assert found.description().startswith(f"Fig. {number} of the paper: ")


# The command and Python


@pytest.mark.parametrize(
    ("text", "number"), [("7", "7"), (7, "7"), ("Fig. 7a", "7"), ("2", "2b"), ("figure 3c", "3")]
)
def test_numbers_of_figures_are_accepted_in_common_notations(text, number):
    assert checked_number(text) == number


@pytest.mark.parametrize(
    ("line", "error", "hint"),
    [
        ("paper 11", "the paper has no figure '11' that shows data", "one of 2b, 3, 4, 5, 6, 7,"),
        ("paper 2a", "the paper has no figure '2a' that shows data", "one of 2b,"),
        ("paper", "no figure of the paper is given", "one of 2b,"),
        ("paper 5 --seed -1", "--seed '-1' is not a whole number from 0", ""),
        ("paper 5 --altitude 40", "--altitude cannot be used with figures of the paper", ""),
        (
            "paper 5 --x N",
            "--x, --y, --value and --by cannot be used with the figure 'paper'",
            "give --x",
        ),
        (
            "grid --altitude 40 --seed 3",
            "--seed cannot be used with the figure 'grid'",
            "give --seed only with aosplan plot paper",
        ),
    ],
)
def test_invalid_paper_figure_commands_give_one_error_line(line, error, hint, capsys):
    assert run(["plot", *line.split()]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    first, *rest = err.splitlines()
    assert first == f"error: {error}"
    assert [text.startswith(f"hint: {hint}") for text in rest] == [True] * bool(hint)


def test_the_help_lists_the_figures(capsys):
    assert run(["plot", "paper", "--help"]) == 0
    listed = capsys.readouterr().out.partition("Figures of the paper:\n")[2]
    assert [line.split()[0] for line in listed.splitlines()[: len(FIGURES)]] == [*FIGURES]
    assert run(["plot", "--help"]) == 0
    assert "Figures of the paper" not in capsys.readouterr().out


def test_the_command_draws_a_paper_figure_and_prints_its_description(tmp_path, capsys):
    path = tmp_path / "figure.png"
    assert run(["plot", "paper", "2b", "--dark", "--out", str(path), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["kind"] == "paper"
    assert told["description"] == shown("paper").description()
    assert path.read_bytes().startswith(b"\x89PNG")


def test_pictures_need_their_extra_before_anything_is_computed(capsys, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    for number in ("8", "9", "10"):
        assert run(["plot", "paper", number]) == 2
        assert "extra 'pictures'" in capsys.readouterr().err


def test_python_has_the_numbers_and_the_axes():
    plt = pytest.importorskip("matplotlib.pyplot")
    plt.switch_backend("agg")
    found = aosplan.paper_figure(6, seed=2019)
    assert repr(found).splitlines()[0] == found.title
    assert len(repr(found).splitlines()) == 1 + len(found.values) <= 5
    assert "<caption>Fig. 6 of the paper" in found._repr_html_()
    assert [*found.columns()] == ["panel", "l_over_o or b_m", "model", "stand"]
    assert found.plot().shape == (2,)
    plt.close("all")
    with pytest.raises(aosplan.RequestError, match="no figure '1' that shows data"):
        aosplan.paper_figure(1)
