"""Figures on axes of Matplotlib."""

import os
import subprocess
import sys

import pytest

import aosplan

plt = pytest.importorskip("matplotlib.pyplot")


@pytest.fixture(autouse=True)
def _no_window():
    plt.switch_backend("agg")
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def placed():
    return aosplan.plan(altitude=40, vhat=0.9, max_samples=20, origin=(48.3, 14.3))


def test_a_plan_is_drawn_on_new_axes_or_on_given_ones(placed):
    panel = placed.plot()
    assert panel.get_xlabel() == "east of the origin [m]"
    _, axes = plt.subplots(1, 2)
    assert placed.plot(axes[0]) is axes[0]
    assert axes[0].get_title() == "10 photos for The paper's LiDAR forest"
    assert axes[1].has_data() is False
    drawn = {round(x, 6) for line in axes[0].lines for x in line.get_xdata()}
    assert {round(x, 6) for x in placed.waypoints.east_m} <= drawn


def test_figures_of_several_panels_are_arrays_of_axes(placed):
    assert placed.plot(kind="visibility").shape == (4,)
    assert aosplan.tradeoff(placed).plot().shape == (4,)
    with pytest.raises(aosplan.RequestError, match="several panels"):
        placed.plot(plt.figure().subplots(), kind="visibility")
    with pytest.raises(aosplan.RequestError, match="kind"):
        placed.plot(kind="nonsense")


def test_results_other_than_plans_are_drawn(placed, tmp_path):
    placed.write(tmp_path / "grid.csv")
    rows = (tmp_path / "grid.csv").read_text().splitlines()
    (tmp_path / "flown.csv").write_text("\n".join(rows[:8]) + "\n")
    reviewed = aosplan.review(tmp_path / "flown.csv", placed).plot()
    labels = [text.get_text() for text in reviewed.get_legend().get_texts()]
    assert {"photos", "no photo"} <= {*labels}
    swept = aosplan.sweep({"altitude": [30, 40], "vhat": [0.9, 0.95]})
    assert swept.plot().get_xlabel() == "samples N"
    mapped = swept.plot(x="altitude", y="vhat", value="samples")
    assert mapped.get_ylabel() == "target V̂"
    assert aosplan.read_scene("paper-forest").plot(kind="baseline-curve").get_xscale() == "log"
    simulated = aosplan.simulate(placed, forest="noise", precision=0.05)
    heights = simulated.plot().get_legend_handles_labels()[1]
    assert heights == ["predicted", "simulated ± 2 s.e."]
    assert aosplan.thin(tmp_path / "flown.csv", 4, placed).plot().get_aspect() == 1.0


def test_a_backend_that_is_loaded_by_a_figure_stays_interactive(tmp_path):
    # The backend of notebooks turns the interactive mode on when the first figure loads it, and
    # displays figures only in this mode.
    (tmp_path / "notebook_backend.py").write_text(
        "import matplotlib\n"
        "from matplotlib.backends.backend_agg import FigureCanvas\n"
        "matplotlib.interactive(True)\n"
    )
    code = (
        "import aosplan, matplotlib\n"
        "aosplan.plan(altitude=40).plot()\n"
        "assert matplotlib.is_interactive()\n"
    )
    surroundings = os.environ | {
        "MPLBACKEND": "module://notebook_backend",
        "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path]),
    }
    subprocess.run([sys.executable, "-c", code], check=True, env=surroundings, timeout=120)
