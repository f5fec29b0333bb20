"""Location and direction of a plot, compared with pyproj."""

import numpy as np
import pytest
from support.clouds import stand, write_cloud

from aosplan.scenes.files.point_cloud import read_voxels
from aosplan.scenes.plot_frame import PlotFrame

pyproj = pytest.importorskip("pyproj")


@pytest.mark.parametrize("system", ["EPSG:32633", "EPSG:27700"])
def test_the_place_of_a_cloud_is_its_middle(tmp_path, system):
    east, north = (650_000.0, 5_300_000.0) if system == "EPSG:32633" else (250_000.0, 650_000.0)
    xyz, kind = stand()
    xyz = xyz + np.array([[east], [north], [0.0]])
    path = write_cloud(tmp_path / "a.laz", xyz, kind, offset=[east, north, 0.0], crs=system)
    volume = read_voxels(path)
    # The cloud is 20 x 12 m large. The scale of the projection is not 1.
    x, y = xyz[0].min() + 0.5 * np.ptp(xyz[0]), xyz[1].min() + 0.5 * np.ptp(xyz[1])
    project = pyproj.Transformer.from_crs(system, "EPSG:4326", always_xy=True)
    longitude, latitude = project.transform(x, y)
    metres = np.array([111_200.0, 111_200.0 * np.cos(np.radians(latitude))])
    assert (np.abs(np.array(volume.place) - [latitude, longitude]) * metres < 0.2).all()
    crs = pyproj.CRS(system)
    degrees = pyproj.Transformer.from_crs(crs, crs.geodetic_crs, always_xy=True).transform(x, y)
    convergence = pyproj.Proj(crs).get_factors(*degrees).meridian_convergence
    assert abs(convergence) > 1.0
    assert abs(volume.turn_deg) == pytest.approx(abs(convergence), abs=0.01)
    # From the middle of the plot, the direction of grid north is `turn_deg`.
    further = project.transform(x, y + 100.0)
    azimuth = pyproj.Geod(ellps="WGS84").inv(longitude, latitude, *further)[0]
    assert volume.turn_deg == pytest.approx(azimuth, abs=0.01)


def test_points_come_back_from_the_plot():
    frame = PlotFrame(12.0, -7.0, 33.0)
    points = np.random.default_rng(1).uniform(-50.0, 50.0, (20, 2))
    assert frame.from_plot(frame.onto_plot(points)) == pytest.approx(points)
    north = frame.onto_plot(
        np.array([[12.0 + np.sin(np.radians(33.0)), -7.0 + np.cos(np.radians(33.0))]])
    )
    assert north[0] == pytest.approx([0.0, 1.0], abs=1e-12)
