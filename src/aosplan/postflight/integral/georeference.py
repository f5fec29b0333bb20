"""Location of a recording's world on earth."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from aosplan.geodesy import local_crs

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


class Georeference(NamedTuple):
    """Location of the world: map coordinates are x and y of the plane plus an offset.

    Parameters
    ----------
    crs
        Coordinate reference system of the map in metres, in a form that PROJ reads.
    x_m, y_m
        Map coordinates of the world's origin.
    """

    crs: str
    x_m: float = 0.0
    y_m: float = 0.0

    @classmethod
    def around(cls, latitude: float, longitude: float) -> Georeference:
        """The location of a world in metres east and north of a place (azimuthal equidistant, as in
        `aosplan.geodesy`).
        """
        return cls(local_crs(latitude, longitude))

    def places(self, x_m: ArrayLike, y_m: ArrayLike) -> tuple[NDArray, NDArray]:  # type: ignore[type-arg]
        """Latitudes and longitudes of points of the plane."""
        import numpy as np
        from pyproj import Transformer

        to_earth = Transformer.from_crs(self.crs, "EPSG:4326", always_xy=True)
        longitude, latitude = to_earth.transform(
            np.asarray(x_m) + self.x_m, np.asarray(y_m) + self.y_m
        )
        return np.asarray(latitude), np.asarray(longitude)

    def to_world(self, latitude: ArrayLike, longitude: ArrayLike) -> tuple[NDArray, NDArray]:  # type: ignore[type-arg]
        """Points of the plane at the given latitudes and longitudes: the inverse of `places`."""
        import numpy as np
        from pyproj import Transformer

        to_map = Transformer.from_crs("EPSG:4326", self.crs, always_xy=True)
        x, y = to_map.transform(np.asarray(longitude), np.asarray(latitude))
        return np.asarray(x) - self.x_m, np.asarray(y) - self.y_m
