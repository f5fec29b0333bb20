"""Maps of the share of a target area that cameras at each position see, compared with rays through
the leaves of a scanned stand.
"""

import numpy as np
import pytest
from support.scans import CORNER, leaves, place, pyproj, scan

from aosplan.cli.app import run
from aosplan.maps.reciprocal_map import reciprocal_map
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest

rasterio = pytest.importorskip("rasterio")

ALTITUDE_M, MIDDLE = 30.0, (8.0, 8.5)


@pytest.fixture(scope="module")
def found():
    made = plan(
        PlanRequest(
            altitude=ALTITUDE_M, scene=scan(), origin=place(*MIDDLE), around_radius=1.0, samples=4,
            baseline=2.0,
        )
    )  # fmt: skip
    return reciprocal_map(made)


@pytest.mark.slow
def test_map_shares_equal_rays_through_known_leaves(found):
    with rasterio.io.MemoryFile(found.geotiff()) as memory, memory.open() as file:
        band = file.read(1)
        rows, columns = np.nonzero(np.isfinite(band))
        x, y = rasterio.transform.xy(file.transform, rows, columns)
        project = pyproj.Transformer.from_crs(file.crs, "EPSG:32633", always_xy=True)
    cameras = np.column_stack(project.transform(x, y)) - np.array(CORNER)
    line = np.arange(-1.0, 1.001, 0.1)
    away = np.stack(np.meshgrid(line, line)).reshape(2, -1)
    targets = away[:, np.hypot(*away) <= 1.0] + np.array(MIDDLE)[:, np.newaxis]
    some = np.random.default_rng(1).choice(len(cameras), 60, replace=False)
    true = np.array(
        [
            (
                leaves().first_hits(targets, (camera[:, np.newaxis] - targets) / ALTITUDE_M) == 0.0
            ).mean()
            for camera in cameras[some]
        ]
    )
    shown = band[rows, columns][some]
    assert np.ptp(true) > 0.3
    assert np.abs(shown - true).mean() < 0.08  # The map only knows the leaves from the pulses.
    assert np.corrcoef(shown, true)[0, 1] > 0.9


@pytest.mark.slow
def test_the_document_names_the_best_position(found):
    document = found.document()
    assert document["most"] == pytest.approx(np.nanmax(found.transparency))
    assert 0.0 <= document["mean"] < document["most"] <= 1.0
    assert document["positions"] == np.isfinite(found.transparency).sum()


@pytest.mark.slow
def test_the_command_writes_the_map_and_its_numbers(folder, capsys):
    latitude, longitude = place(*MIDDLE)
    status = run(
        ["plan", "--altitude", "30", "--scene", scan(), "--origin", f"{latitude},{longitude}",
         "--around-radius", "1", "--samples", "4", "--baseline", "2", "--reciprocal-map",
         "seen.tif", "--report", "page.html", "--no-report-picture", "--json"]
    )  # fmt: skip
    out = capsys.readouterr().out
    assert status == 0
    assert '"reciprocal_map"' in out
    with rasterio.open("seen.tif") as file:
        assert file.descriptions == ("share of the target area that a camera here sees",)
    assert "Positions above the target area" in (folder / "page.html").read_text()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--scene", "dense-forest"], "needs the voxels of the place"),
        (["--scene", "SCAN", "--reciprocal-map", "seen.png"], "does not end in .tif"),
    ],
)
def test_other_scenes_and_files_are_refused(folder, capsys, arguments, said):
    latitude, longitude = place(*MIDDLE)
    given = [scan() if each == "SCAN" else each for each in arguments]
    status = run(
        ["plan", "--altitude", "30", "--origin", f"{latitude},{longitude}", "--reciprocal-map",
         "seen.tif", *given]
    )  # fmt: skip
    error = capsys.readouterr().err
    assert status == 2
    assert said in error
    assert not (folder / "seen.tif").exists()


def test_a_map_needs_a_location(folder, capsys):
    status = run(["plan", "--altitude", "30", "--reciprocal-map", "seen.tif"])
    assert status == 2
    assert "--reciprocal-map needs a location" in capsys.readouterr().err
