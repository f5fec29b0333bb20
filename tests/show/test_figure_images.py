"""Figures show the prepared data, and equal the approved pictures."""

import io
from functools import cache

import matplotlib as mpl
import numpy as np
import pytest
from approved.make import FIGURES, FOLDER, VERSION, paper_forest, pictures, shown, small
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection, QuadMesh
from matplotlib.patches import PathPatch
from PIL import Image

from aosplan.show.figures.canvas import FigureStyle, drawn, rendered
from aosplan.show.figures.coverage_curve import curve_of
from aosplan.show.figures.draw import KINDS
from aosplan.show.figures.style import DARK, rules

MOST_RMS = 1.0
"""Largest accepted root mean square difference from an approved picture, on a scale from 0 to 255,
for the same version of matplotlib.
"""


NARROW = FigureStyle(DARK, width_mm=140.0)


@pytest.fixture(scope="module")
def figure_of():
    """A function that draws a figure with the project's own settings and lays it out."""
    with mpl.rc_context():
        mpl.rcdefaults()

        @cache
        def draw(name, look=NARROW):
            mpl.rcParams.update(rules(look.theme))
            figure = drawn(KINDS[name.partition("-scatter")[0]], shown(name), look)
            FigureCanvasAgg(figure).draw()
            return figure

        yield draw


def points(line):
    return np.column_stack([line.get_xdata(), line.get_ydata()]).astype(float)


def has_line(panel, x, y):
    """Whether a panel has a line through exactly these points."""
    wanted = np.column_stack([x, y])
    return any(
        points(line).shape == wanted.shape and np.array_equal(points(line), wanted)
        for line in panel.lines
    )


# Drawn data


def test_visibility_draws_each_curve_and_the_plan(figure_of):
    panels, told = np.reshape(figure_of("visibility").axes, (2, 2)), shown("visibility")
    for row, name in zip(panels, ("normalized", "expected"), strict=True):
        for panel, curves, at in (
            (row[0], told.by_samples, told.samples),
            (row[1], told.by_baseline, told.baseline_m),
        ):
            assert all(has_line(panel, curve.x, getattr(curve, name)) for curve in curves)
            assert has_line(panel, [at], [getattr(told, name)])


def test_a_tradeoff_draws_every_row_and_marks_the_front(figure_of):
    told = shown("tradeoff").points
    for panel, (x, y) in zip(
        figure_of("tradeoff").axes,
        [
            ("samples", "baseline_m"),
            ("samples", "extent_m"),
            ("samples", "time_s"),
            ("extent_m", "time_s"),
        ],
        strict=True,
    ):
        at = {(getattr(p, x), getattr(p, y)) for p in told}
        lines = [points(line) for line in panel.lines]
        drawn_at = [line[~np.isnan(line).any(axis=1)].tolist() for line in lines]
        assert {tuple(place) for places in drawn_at for place in places} == at
        (front,) = [line for line in panel.lines if line.get_marker() == "o"]
        assert np.isfinite(front.get_ydata()).tolist() == [p.front for p in told]
        (star,) = [line for line in panel.lines if line.get_marker() == "*"]
        own = next(p for p in told if p.chosen)
        assert points(star).tolist() == [[getattr(own, x), getattr(own, y)]]


def test_a_grid_is_to_scale_and_in_order(figure_of):
    figure, told = figure_of("grid"), shown("grid")
    (panel,) = figure.axes
    assert has_line(panel, told.east_m, told.north_m)
    corners = panel.transData.transform([(0, 0), (10, 0), (0, 10)])
    assert corners[1][0] - corners[0][0] == pytest.approx(corners[2][1] - corners[0][1])
    numbers = [t for t in panel.texts if t.get_text().isdigit()]
    assert [int(t.get_text()) for t in numbers] == list(range(50))
    for k, text in enumerate(numbers):
        assert text.xy == (told.east_m[k], told.north_m[k])
    outlines = [
        patch.get_path().vertices for patch in panel.patches if isinstance(patch, PathPatch)
    ]
    for ring in (told.footprint, told.common):
        assert any(np.allclose(outline[: len(ring)], ring) for outline in outlines)
    bar = next(line for line in panel.lines if line.get_linewidth() == 3.0)
    label = next(t.get_text() for t in panel.texts if t.get_text().endswith(" m"))
    assert np.ptp(bar.get_xdata()) == pytest.approx(float(label[:-2]))


def test_numbers_are_drawn_above_the_common_footprint_with_the_takeoff(figure_of):
    (panel,) = figure_of("grid").axes
    home = [line for line in panel.lines if line.get_marker() == "P"]
    assert points(home[0]).tolist() == [list(shown("grid").takeoff)]


def test_densities_are_bars_and_lines(figure_of):
    (left, right), told = figure_of("density").axes, shown("density")
    assert [bar.get_width() for bar in left.patches] == list(told.density)
    assert [bar.get_y() for bar in left.patches] == list(told.bottom_m)
    edges = [*told.bottom_m, told.top_m[-1]]
    assert has_line(right, [*told.independent, 0.0], edges)
    assert has_line(right, [*told.measured, 0.0], edges)


def test_a_baseline_curve_runs_through_its_knots_and_has_both_axes(figure_of):
    panel, told = figure_of("baseline-curve").axes[0], shown("baseline-curve")
    assert has_line(panel, *zip(*told.knots, strict=True))
    assert has_line(panel, [told.ratio], [told.coverage])
    (above,) = panel.child_axes
    assert above.get_xlim() == pytest.approx(np.multiply(panel.get_xlim(), 40.0))


def test_a_correlogram_is_lines_and_a_map(figure_of):
    (left, right, _), told = figure_of("correlogram").axes, shown("correlogram")
    for direction in (0, 2, 4, 6):
        assert has_line(left, told.lags, told.rho[direction])
    (mesh,) = [each for each in right.collections if isinstance(each, QuadMesh)]
    assert np.array_equal(np.reshape(mesh.get_array(), (-1, len(told.lags)))[:-1], told.rho)


def test_a_map_of_a_sweep_has_its_values_and_its_hatch(figure_of):
    figure, told = figure_of("sweep"), shown("sweep")
    panel = figure.axes[0]
    (mesh,) = [each for each in panel.collections if isinstance(each, QuadMesh)]
    values = [np.nan if cell.value is None else cell.value for row in told.cells for cell in row]
    assert np.array_equal(
        np.ma.filled(mesh.get_array().astype(float), np.nan).ravel(), values, equal_nan=True
    )
    (hatched,) = [each for each in panel.collections if each.get_hatch()]
    assert isinstance(hatched, PolyCollection)
    (box,) = [path.get_extents() for path in hatched.get_paths()]
    assert (box.x0, box.y0, box.x1, box.y1) == (1.0, 1.0, 2.0, 2.0)
    assert [points(line).tolist() for line in panel.lines] == [[[1.5, 0.5]]]
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words == ["no feasible scenario", "some infeasible scenarios"]


def test_a_scatter_of_a_sweep_has_its_points_and_its_front(figure_of):
    panel, told = figure_of("sweep-scatter").axes[0], shown("sweep-scatter")
    assert has_line(panel, *zip(*told.points, strict=True))
    assert has_line(panel, *zip(*told.front, strict=True))


# Texts


@pytest.mark.parametrize(
    "look",
    [
        pytest.param(FigureStyle(), id="wide", marks=pytest.mark.slow),
        pytest.param(NARROW, id="narrow"),
    ],
)
@pytest.mark.parametrize("name", FIGURES)
def test_no_text_in_figures_is_cut(figure_of, name, look):
    figure = figure_of(name, look)
    box, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
    assert min(box.x0, box.y0) >= -0.01
    assert box.x1 <= width + 0.01
    assert box.y1 <= height + 0.01


@pytest.mark.parametrize("name", FIGURES)
def test_every_axis_is_named_with_its_unit_or_symbol(figure_of, name):
    for panel in figure_of(name).axes:
        shared_x = [
            other for other in panel.get_shared_x_axes().get_siblings(panel) if other.get_xlabel()
        ]
        shared_y = [
            other for other in panel.get_shared_y_axes().get_siblings(panel) if other.get_ylabel()
        ]
        if panel.get_label() == "<colorbar>":
            assert panel.get_ylabel()
        else:
            assert shared_x
            assert shared_y


# Appearance

SAME = VERSION.read_text().strip() == f"matplotlib {mpl.__version__}"


def rms(one, other):
    """Root mean square difference of two PNG files, on a scale from 0 to 255; inf if their sizes
    differ.
    """
    first, second = (
        np.asarray(Image.open(io.BytesIO(content)).convert("RGB"), dtype=float)
        for content in (one, other)
    )
    if first.shape != second.shape:
        return np.inf
    return float(np.sqrt(np.mean((first - second) ** 2)))


def test_there_is_a_picture_of_every_kind():
    names = {path.name for path in FOLDER.glob("*.png")}
    assert names == {*(f"{name}.png" for name in FIGURES), "grid-dark.png"}
    assert {name.removesuffix(".png") for name in names} >= set(KINDS)


@pytest.mark.skipif(not SAME, reason=f"approved pictures are of {VERSION.read_text().strip()}")
@pytest.mark.slow
def test_pictures_look_as_approved():
    for name, content in pictures():
        assert rms(small(content), (FOLDER / name).read_bytes()) <= MOST_RMS, name


@pytest.mark.skipif(not SAME, reason=f"approved pictures are of {VERSION.read_text().strip()}")
@pytest.mark.parametrize(
    "wrong",
    [
        lambda told: told._replace(coverage=0.95),
        lambda told: told._replace(ratio=1.03 * told.ratio),
        lambda told: told._replace(knots=tuple((k, 0.98 * share) for k, share in told.knots)),
    ],
    ids=["share", "star", "curve"],
)
def test_a_changed_figure_differs_from_the_approved_picture(wrong):
    from approved.make import SMALL

    told = wrong(curve_of(paper_forest().scene, 0.98, 40.0))
    content = rendered(KINDS["baseline-curve"], told, "png", SMALL)
    assert rms(small(content), (FOLDER / "baseline-curve.png").read_bytes()) > 2.0 * MOST_RMS
