"""Conversion of boundaries in other coordinate reference systems to WGS 84."""

from __future__ import annotations

import warnings
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.errors import RequestError
from aosplan.messages import Message
from aosplan.units import shown

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from pyproj import Transformer

PROJECTED_WITHIN_M = 5.0
"""A projected system is accepted if the uncertainty of its datum is at most this. The uncertainty
of NAD 83 is 4 m.
"""

DEGREES_WITHIN_M = 1.0
"""A system in degrees, such as ETRS89, is accepted if the uncertainty of its datum is at
most this.
"""


class Reprojection(NamedTuple):
    """Conversion from the coordinates of a file to longitude and latitude, with a description for
    messages.
    """

    transformer: Transformer
    is_projected: bool
    path: str
    name: str
    notice: Message

    def degrees(self, points: NDArray[np.float64], place: str) -> NDArray[np.float64]:
        """Longitudes and latitudes of points, shape (n, 2).

        Raises
        ------
        RequestError
            If the points look like degrees although the system is in metres, or if they are outside
            of the domain of the system.
        """
        if self.is_projected and len(points) and (np.abs(points) <= (180.0, 90.0)).all():
            raise RequestError(
                f"{place}: crs {shown(self.name)} is not WGS 84, but the coordinates look like "
                "degrees",
                "give the coordinate reference system of the coordinates",
            )
        # Lists are passed instead of arrays, because older versions of pyproj treat an array with
        # one value as a number.
        found = np.column_stack(self.transformer.transform(*points.T.tolist()))
        if not np.isfinite(found).all():
            raise RequestError(f"{place}: the coordinates do not fit {self.name}")
        found[:, 0] = (found[:, 0] + 180.0) % 360.0 - 180.0
        return found


def is_wgs84(name: str) -> bool:
    """Whether a name denotes longitude and latitude on WGS 84."""
    return name.endswith(("CRS84", "CRS:84", ":4326")) or name == "WGS 84"


def change_of(crs: str, path: str, notices: list[Message]) -> Reprojection | None:
    """The conversion of coordinates in a stated system; None if no conversion is needed.

    The notice about a conversion is added once.

    Raises
    ------
    RequestError
        In the same cases as `reprojection`.
    """
    change = reprojection(crs, path) if crs else None
    if change is not None and change.notice not in notices:
        notices.append(change.notice)
    return change


@cache
def reprojection(name: str, path: str) -> Reprojection | None:
    """The conversion of a file's coordinates to degrees on WGS 84; None if they are already in this
    system.

    Parameters
    ----------
    name
        The coordinate reference system as a code, a URN or WKT.
    path
        The file, for messages.

    Raises
    ------
    RequestError
        If the system is unknown, or its relation to WGS 84 is not known accurately enough.
    """
    if is_wgs84(name):
        return None
    from pyproj import CRS
    from pyproj.exceptions import CRSError
    from pyproj.transformer import TransformerGroup

    hint = "ogr2ogr -t_srs EPSG:4326 area.geojson FILE"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # The warnings are about grids that are not installed.
        try:
            crs = CRS.from_user_input(name)
        except CRSError:
            raise RequestError(f"'{path}': crs {shown(name)} is not known", hint) from None
        if crs.is_compound:
            crs = crs.sub_crs_list[0]
        transformers = TransformerGroup(crs, "EPSG:4326", always_xy=True).transformers
    accuracy_m = _accuracy_m(transformers[0]) if transformers else -1.0
    if crs == CRS.from_epsg(4326) or crs.to_epsg() == 4326:
        return None
    limit_m = PROJECTED_WITHIN_M if crs.is_projected else DEGREES_WITHIN_M
    if not 0.0 <= accuracy_m <= limit_m:
        known = f"up to {accuracy_m:g} m here" if accuracy_m > 0.0 else "not known here"
        raise RequestError(
            f"'{path}': crs {shown(name)} is not WGS 84, and the error of a transformation "
            f"to WGS 84 is {known}",
            hint,
        )
    message = (
        f"'{path}' is in {crs.name}: its coordinates were transformed to WGS 84, with an "
        f"error of at most {accuracy_m:g} m"
    )
    return Reprojection(
        transformers[0], crs.is_projected, path, name, Message("reprojected", message)
    )


def _accuracy_m(transformer: Transformer) -> float:
    """Accuracy of a transformation [m]; negative if it is not known.

    A conversion that does not change the datum is exact. PROJ 9.8 and later do not state an
    accuracy for such conversions.
    """
    steps = transformer.operations or ()
    if steps and all(step.type_name == "Conversion" for step in steps):
        return 0.0
    return float(transformer.accuracy)
