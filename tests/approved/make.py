"""Make the approved pictures of all kinds of figures:  python tests/approved/make.py

Check each picture before you commit it, because the tests then require it.  Another version of
matplotlib may shift the layout by a pixel.  `VERSION` states the version that made the pictures.
"""

import io
import sys
from functools import cache
from pathlib import Path

import matplotlib as mpl
from PIL import Image

from aosplan.planning.loaded_scene import LoadedScene, load_scene
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.scenes.occluder_statistics import layered_scene
from aosplan.show.figures.canvas import FigureStyle, rendered
from aosplan.show.figures.correlogram import correlations_of
from aosplan.show.figures.coverage_curve import curve_of
from aosplan.show.figures.density import density_of
from aosplan.show.figures.draw import KINDS
from aosplan.show.figures.grid import grid_of
from aosplan.show.figures.paper.registry import numbers_of
from aosplan.show.figures.style import DARK
from aosplan.show.figures.sweep_results import Cell, Group, MapFigure, PanelsFigure, ScatterFigure
from aosplan.show.figures.tradeoff import tradeoff_of
from aosplan.show.figures.visibility import visibility_of

FOLDER = Path(__file__).parent
VERSION = FOLDER / "VERSION"
SMALL = FigureStyle(width_mm=140.0, dpi=72.0)
CELLS = ((Cell(2, 2, 31.5), Cell(3, 2, 40.25)), (Cell(1, 1, 120.0), Cell(1, 0, None)))


@cache
def planned(**changed):
    return plan(PlanRequest(**({"altitude": 40.0} | changed)))


@cache
def paper_forest():
    return load_scene(PlanRequest(altitude=40.0, scene="paper-forest"))


@cache
def stand():
    """A periodic plot of trees, as voxels."""
    sys.path.insert(0, str(FOLDER.parent))
    from support.forests import STANDS, clumped_forest

    volume = clumped_forest(STANDS["spruce"])
    return LoadedScene(layered_scene(volume, "a stand"), "cloud", volume=volume)


FIGURES = {
    "visibility": lambda: visibility_of(planned()),
    "tradeoff": lambda: tradeoff_of(planned(max_samples=80)),
    "grid": lambda: grid_of(planned(origin=(48.0, 14.0), takeoff=(48.0001, 14.0), heading=30.0)),
    "density": lambda: density_of(stand()),
    "baseline-curve": lambda: curve_of(paper_forest().scene, 0.98, 40.0),
    "correlogram": lambda: correlations_of(stand()),
    "sweep": lambda: MapFigure(
        "altitude", "vhat", "flight_time_s", 7, 5, (30, 50), (0.8, 0.98), CELLS
    ),
    "sweep-scatter": lambda: ScatterFigure(
        "samples",
        "flight_time_s",
        9,
        6,
        ((5.0, 50.0), (7.0, 44.0), (9.0, 60.0), (12.0, 30.0), (20.0, 29.0), (30.0, 33.0)),
        ((5.0, 50.0), (7.0, 44.0), (12.0, 30.0), (20.0, 29.0)),
    ),
    "sweep-scatter-groups": lambda: FIGURES["sweep-scatter"]()._replace(
        by="altitude",
        groups=(
            Group(30, ((5.0, 50.0), (7.0, 44.0), (9.0, 60.0))),
            Group(50, ((12.0, 30.0), (20.0, 29.0), (30.0, 33.0))),
        ),
    ),
    "sweep-scatter-shades": lambda: FIGURES["sweep-scatter"]()._replace(
        by="baseline_m", shades=(1.0, 1.5, 2.2, 2.8, 3.1, 4.0)
    ),
    "sweep-scatter-panels": lambda: PanelsFigure(
        "speed", (3, 8), tuple(FIGURES["sweep"]() for _ in range(2))
    ),
    "paper": lambda: numbers_of("2b"),
}


@cache
def shown(name):
    """The numbers of a figure, by its name."""
    return FIGURES[name]()


def pictures():
    """File name and PNG of each approved picture."""
    for name in FIGURES:
        kind = KINDS[name.partition("-scatter")[0]]
        yield f"{name}.png", rendered(kind, shown(name), "png", SMALL)
    yield "grid-dark.png", rendered(KINDS["grid"], shown("grid"), "png", SMALL._replace(theme=DARK))


def small(content):
    """A small PNG without metadata: 64 colours are sufficient for a comparison."""
    file = io.BytesIO()
    with Image.open(io.BytesIO(content)) as image:
        image.convert("RGB").quantize(64).save(file, "PNG", optimize=True)
    return file.getvalue()


if __name__ == "__main__":
    VERSION.write_text(f"matplotlib {mpl.__version__}\n")
    for file_name, drawn in pictures():
        (FOLDER / file_name).write_bytes(small(drawn))
        print(f"tests/approved/{file_name}")
