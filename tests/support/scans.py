"""A scan of a generated stand of leaves with a location, for plans of one place."""

from functools import lru_cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest

from aosplan.simulation.leaf_stands import crowned_stand, laser_scan
from support.leaf_clouds import write_scan

pyproj = pytest.importorskip("pyproj")

SIDE_M, CORNER = 16.0, (650_000.0, 5_300_000.0)


@lru_cache
def leaves():
    """The generated stand of leaves."""
    return crowned_stand(
        np.random.default_rng(3), SIDE_M, leaf_area_index=2.5, crowns=14, base_m=3.0, top_m=9.0
    )


@lru_cache
def scan():
    """Path of the scan of the stand."""
    returns = laser_scan(np.random.default_rng(4), leaves(), pulses_a_m2=120.0)
    path = Path(mkdtemp()) / "scan.laz"
    return str(write_scan(path, returns, crs=pyproj.CRS.from_epsg(32633), corner=CORNER))


def place(x_m, y_m):
    """Latitude and longitude of a point of the plot, from its south-western corner."""
    project = pyproj.Transformer.from_crs("EPSG:32633", "EPSG:4326", always_xy=True)
    longitude, latitude = project.transform(CORNER[0] + x_m, CORNER[1] + y_m)
    return latitude, longitude


def true_visibility(middle, radius_m, sites_m, altitude_m, pitch_m=0.1):
    """V of a disc, computed by casting rays through the leaves. Positions are relative to the
    corner of the plot.
    """
    line = np.arange(-radius_m, radius_m + 1e-9, pitch_m)
    away = np.stack(np.meshgrid(line, line)).reshape(2, -1)
    targets = away[:, np.hypot(*away) <= radius_m] + np.array(middle)[:, np.newaxis]
    hidden = np.zeros(targets.shape[1])
    for site in sites_m:
        hidden += leaves().first_hits(targets, (site[:, np.newaxis] - targets) / altitude_m) > 0.0
    return 1.0 - float(((hidden / len(sites_m)) ** 2).mean())
