"""Ground heights from a GeoTIFF, and paths at a constant height above the ground.

Heights are read in windows of limited size and interpolated bilinearly between pixel centres.  The
file may have any vertical datum, because missions use only differences of heights.
"""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING, Any, NoReturn

from aosplan.crs import (
    Units,
    crs_of_wkt,
    ground_scale,
    height_unit_m,
    transformer,
    unit_m,
    vertical_unit_m,
)
from aosplan.errors import RequestError, needs_extra
from aosplan.files import check_input, decoding
from aosplan.flight.track import FlightPoints, Ground
from aosplan.geodesy import to_wgs84

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import TracebackType
    from typing import Self

    from numpy.typing import NDArray
    from pyproj import CRS


WINDOW_PX = 4_000_000
"""Largest number of pixels in a window (32 MB). If the points do not fit into one window, several
windows are read.
"""

GROUND_M = (-600.0, 9000.0)
"""Range of ground heights on earth [m].  Values outside of it are treated as missing, even if the
file does not mark them.
"""

METRES_PER_DEGREE = 111_320.0

MOST_LOOKS = 5_000_000
"""Largest number of places along the path of a plan at which the height of the ground is read."""


class Terrain:
    """Ground heights from a raster.  As a context manager, it keeps the file open.

    Parameters
    ----------
    path
        A GeoTIFF; the first band is read.
    units
        Unit of the heights, which replaces the unit that the file states (`aosplan.crs.unit_m`).

    Raises
    ------
    RequestError
        If the raster does not exist, or if it has no location or no unit.
    MissingExtraError
        If rasterio is not installed.
    """

    def __init__(self, path: str, units: str | None = None) -> None:
        with needs_extra(f"terrain '{path}'", "raster"):
            import rasterio
        from rasterio.errors import NotGeoreferencedWarning, RasterioError, RasterioIOError

        self.path = path
        # Such names would make GDAL open network resources or archives.
        if "://" in path or path.startswith("/vsi") or "\0" in path:
            raise RequestError(f"terrain {path!r} is not a file")
        check_input(path)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", NotGeoreferencedWarning)
                self._raster = rasterio.open(path, driver="GTiff")
        except (RasterioError, RasterioIOError):
            raise RequestError(
                f"terrain '{path}' is not a GeoTIFF that can be read",
                "give a raster of ground heights",
            ) from None
        try:
            with decoding("terrain", path):
                crs = self._coordinate_system()
                self._unit_m = self._height_unit_m(crs, units)
                self._to_raster = transformer("EPSG:4326", crs)
            self._transform = self._raster.transform[:6]
            a, b, left, d, e, _ = self._transform
            self._turn = 360.0 if crs.is_geographic else 0.0
            self._middle = left + 0.5 * (a * self._raster.width + b * self._raster.height)
            self._area = a * e - b * d
            if not (math.isfinite(self._area) and self._area):
                raise_unplaced(path)
        except BaseException:
            self._raster.close()
            raise
        self.datum = _datum(crs)
        self.pixel_m = max(self._pixel_m(crs), 1e-3)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._raster.close()

    def _coordinate_system(self) -> CRS:
        if self._raster.crs is None:
            raise_unplaced(self.path)
        return crs_of_wkt(self._raster.crs.to_wkt(), f"terrain '{self.path}'")

    def _height_unit_m(self, crs: CRS, units: str | None) -> float:
        """The length [m] of the unit of the heights. The unit is given by the user, by the band, or
        by the vertical axis.
        """
        if self._raster.dtypes[0].startswith("complex"):
            raise RequestError(f"terrain '{self.path}' contains complex numbers instead of heights")
        if units is not None:
            return unit_m(units) or 1.0
        stated = Units(
            None if crs.is_geographic else float(crs.axis_info[0].unit_conversion_factor),
            vertical_unit_m(crs, f"terrain '{self.path}'"),
        )
        return height_unit_m(
            self._raster.units[0],
            stated,
            f"terrain '{self.path}'",
            "give --terrain-units: m, ft or us-ft",
        )

    def _pixel_m(self, crs: CRS) -> float:
        """The shorter side of a pixel on the ground, at the centre of the raster."""
        a, b, left, d, e, top = self._transform
        rows, columns = 0.5 * self._raster.height, 0.5 * self._raster.width
        scale = ground_scale(crs, left + a * columns + b * rows, top + d * columns + e * rows)
        unit = METRES_PER_DEGREE if crs.is_geographic else crs.axis_info[0].unit_conversion_factor
        x_m, y_m = (scale.x_m, scale.y_m) if scale else (unit, unit)
        return min(math.hypot(a * x_m, d * y_m), math.hypot(b * x_m, e * y_m))

    def heights_m(self, latitudes: Sequence[float], longitudes: Sequence[float]) -> NDArray[Any]:
        """Height of the ground at each point [m], shape (N,), interpolated bilinearly between pixel
        centres.

        Raises
        ------
        RequestError
            If a point is outside the raster, or if its height needs a pixel without data.
        """
        import numpy as np

        lat, lon = np.asarray(latitudes, dtype=float), np.asarray(longitudes, dtype=float)
        x, y = self._to_raster.transform(lon.tolist(), lat.tolist())
        a, b, left, d, e, top = self._transform
        x = np.asarray(x)
        # The longitudes of a raster may be counted from 0 or from -180, and the raster may extend
        # beyond 360 or 180.
        if self._turn:
            x = (x - self._middle + 0.5 * self._turn) % self._turn + self._middle - 0.5 * self._turn
        along, down = x - left, np.asarray(y) - top
        columns, rows = (e * along - b * down) / self._area, (a * down - d * along) / self._area
        inside = (columns >= 0) & (columns <= self._raster.width)
        inside &= (rows >= 0) & (rows <= self._raster.height)  # The comparison is False for nan.
        if not inside.any():
            self._refuse("does not cover", lat, lon, ~inside, self._whereabouts())
        if not inside.all():
            self._refuse("does not cover", lat, lon, ~inside)
        found = np.empty(len(lat))
        self._read(columns - 0.5, rows - 0.5, found, slice(0, len(lat)))
        if np.isnan(found).any():
            self._refuse("has no height at", lat, lon, np.isnan(found))
        return found * self._unit_m

    def _whereabouts(self) -> str:
        """A hint with the latitude and longitude of the raster's centre."""
        a, b, left, d, e, top = self._transform
        column, row = 0.5 * self._raster.width, 0.5 * self._raster.height
        x, y = left + a * column + b * row, top + d * column + e * row
        longitude, latitude = self._to_raster.transform(x, y, direction="INVERSE")
        return f"the middle of the raster is at {latitude:.5f},{longitude:.5f}"

    def _refuse(
        self,
        what: str,
        lat: NDArray[Any],
        lon: NDArray[Any],
        where: NDArray[Any],
        hint: str = (
            "use a file without holes that covers the sites, the paths between the sites, "
            "and the take-off"
        ),
    ) -> None:
        first = int(where.argmax())
        raise RequestError(
            f"terrain '{self.path}' {what} {lat[first]:.6f},{lon[first]:.6f} "
            f"({int(where.sum())} of {len(lat)} points)",
            hint,
        )

    def _read(
        self, columns: NDArray[Any], rows: NDArray[Any], found: NDArray[Any], part: slice
    ) -> None:
        """Read the heights of some of the points.  If the points do not fit into one window, they
        are divided into two halves.
        """
        import numpy as np
        from rasterio.windows import Window

        x = np.clip(columns[part], 0, self._raster.width - 1)
        y = np.clip(rows[part], 0, self._raster.height - 1)
        left, top = int(x.min()), int(y.min())
        width = min(int(x.max()) + 2, self._raster.width) - left
        height = min(int(y.max()) + 2, self._raster.height) - top
        if width * height > WINDOW_PX and len(x) > 1:
            middle = (part.start + part.stop) // 2
            self._read(columns, rows, found, slice(part.start, middle))
            self._read(columns, rows, found, slice(middle, part.stop))
            return
        with decoding("terrain", self.path):
            band = self._raster.read(1, window=Window(left, top, width, height), masked=True)
        pixels = np.ma.filled(band.astype(float), np.nan)
        with np.errstate(over="ignore", invalid="ignore"):
            pixels = pixels * self._raster.scales[0] + self._raster.offsets[0]
        # Values outside this range mark pixels without data.
        low, high = (limit_m / self._unit_m for limit_m in GROUND_M)
        pixels[~((pixels >= low) & (pixels <= high))] = np.nan
        column, row = x.astype(int) - left, y.astype(int) - top
        u, v = x - x.astype(int), y - y.astype(int)
        # Neighbours with the weight zero are not needed. They may be outside the raster or without
        # data.
        right, below = (
            np.minimum(column + (u > 0), width - 1),
            np.minimum(row + (v > 0), height - 1),
        )
        upper = _between(pixels[row, column], pixels[row, right], u)
        lower = _between(pixels[below, column], pixels[below, right], u)
        found[part] = _between(upper, lower, v)


def raise_unplaced(path: str) -> NoReturn:
    """Refuse a raster that has no coordinate reference system."""
    raise RequestError(
        f"terrain '{path}' has no coordinate reference system",
        "add a coordinate system with gdal_edit.py -a_srs EPSG:CODE FILE",
    )


def _between(start: Any, stop: Any, share: Any) -> Any:
    return start + share * (stop - start)


def _datum(crs: CRS) -> str:
    """Name of the vertical datum, if the raster states one."""
    vertical = [sub.name for sub in crs.sub_crs_list if sub.is_vertical]
    if vertical:
        return str(vertical[0])
    return "ellipsoid" if len(crs.axis_info) == 3 else "the elevation model's datum"


def follow(
    terrain: Terrain, sites: FlightPoints, origin: tuple[float, float], *, tolerance_m: float
) -> Ground:
    """Add points to a path at a constant height above the ground. They are added if the drone would
    otherwise be too low between two sites.

    The height of the ground is read every half pixel along each leg. The ground is compared with
    the straight line between the ground at the two ends of the leg. If the ground is more than
    `tolerance_m` above this line, a point is added at the largest difference. Both parts of the leg
    are then checked again. If a path is longer than `MOST_LOOKS` half pixels, the ground is read at
    about `MOST_LOOKS` places at equal distances instead.
    """
    import numpy as np

    ground = heights_at(terrain, origin, sites.east_m, sites.north_m)
    east, north = np.array(sites.east_m), np.array(sites.north_m)
    lengths = np.hypot(np.diff(east), np.diff(north))
    step = max(0.5 * terrain.pixel_m, float(lengths.sum()) / MOST_LOOKS)
    counts = np.maximum(np.ceil(lengths / step).astype(int) - 1, 0)
    starts = np.concatenate([[0], np.cumsum(counts)])
    leg = np.repeat(np.arange(len(counts)), counts)
    shares = (np.arange(len(leg)) - starts[leg] + 1) / (counts[leg] + 1)
    at_east = _between(east[leg], east[leg + 1], shares)
    at_north = _between(north[leg], north[leg + 1], shares)
    below = heights_at(terrain, origin, at_east, at_north)

    rises = below - _between(ground[leg], ground[leg + 1], shares)
    humped = np.zeros(len(counts), dtype=bool)
    humped[leg[rises > tolerance_m]] = True
    plain = rises[~humped[leg]]
    closer, farther = float(plain.max(initial=0.0)), float((-plain).max(initial=0.0))
    found: list[tuple[float, float, bool, float]] = []
    points = zip(sites.east_m, sites.north_m, sites.photo, ground.tolist(), strict=True)
    for place, point in enumerate(points):
        found.append(point)
        if place == len(counts) or not humped[place]:
            continue
        part = slice(starts[place], starts[place + 1])
        profile = np.concatenate([[ground[place]], below[part], [ground[place + 1]]])
        along = np.concatenate([[0.0], shares[part], [1.0]])
        knots = raised(along, profile, tolerance_m)
        rise = profile - np.interp(along, along[knots], profile[knots])
        closer, farther = max(closer, float(rise.max())), max(farther, float(-rise.min()))
        for knot in knots[1:-1]:
            k = starts[place] - 1 + knot
            found.append((float(at_east[k]), float(at_north[k]), False, float(below[k])))
    columns = [list(column) for column in zip(*found, strict=True)]
    return Ground(FlightPoints(columns[0], columns[1], columns[2]), columns[3], closer, farther)


def raised(along: NDArray[Any], profile: NDArray[Any], tolerance_m: float) -> list[int]:
    """Indices of the vertices of a polyline that approximates a profile.

    The first and the last index are included.  Between consecutive indices the profile is at most
    `tolerance_m` above the straight line.
    """
    import numpy as np

    last = len(profile) - 1
    chosen, waiting = [0, last], [(0, last)]
    while waiting:
        start, stop = waiting.pop()
        inner = slice(start + 1, stop)
        share = (along[inner] - along[start]) / (along[stop] - along[start])
        closer = profile[inner] - _between(profile[start], profile[stop], share)
        if len(closer) and closer.max() > tolerance_m:
            worst = start + 1 + int(np.argmax(closer))
            chosen.append(worst)
            waiting += [(start, worst), (worst, stop)]
    return sorted(chosen)


def heights_at(
    terrain: Terrain,
    origin: tuple[float, float],
    east_m: Sequence[float] | NDArray[Any],
    north_m: Sequence[float] | NDArray[Any],
) -> NDArray[Any]:
    """Height of the ground [m] at points that are given in metres east and north of an origin."""
    if not len(east_m):
        import numpy as np

        return np.empty(0)
    return terrain.heights_m(*to_wgs84(origin, list(east_m), list(north_m)))


def ways_ground_m(
    terrain: Terrain,
    origin: tuple[float, float],
    start: tuple[float, float],
    east_m: Sequence[float],
    north_m: Sequence[float],
) -> tuple[list[float], list[float]]:
    """Heights of the lowest and the highest ground along the straight lines from one point to
    several others.

    Points are metres east and north of an origin. Heights are read every half pixel. If this would
    be more than `MOST_LOOKS` places in total, larger distances are used.
    """
    import numpy as np

    east, north = np.asarray(east_m, dtype=float), np.asarray(north_m, dtype=float)
    lengths = np.hypot(east - start[0], north - start[1])
    step = max(0.5 * terrain.pixel_m, float(lengths.sum()) / MOST_LOOKS)
    counts = np.ceil(lengths / step).astype(int) + 1
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    way = np.repeat(np.arange(len(counts)), counts)
    shares = (np.arange(len(way)) - starts[way]) / np.maximum(counts[way] - 1, 1)
    shares[starts[counts == 1]] = 1.0
    ground = heights_at(
        terrain,
        origin,
        _between(start[0], east[way], shares),
        _between(start[1], north[way], shares),
    )
    return np.minimum.reduceat(ground, starts).tolist(), np.maximum.reduceat(
        ground, starts
    ).tolist()
