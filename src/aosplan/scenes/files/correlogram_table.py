"""Conversion of a correlogram to the plain values in scene files, and back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from aosplan.errors import RequestError
from aosplan.scenes.correlogram import INTERIOR, Correlogram

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

DIGITS = 6
"""Number of decimals of correlations and densities.  The rounding error is smaller than the error
of the correlogram itself.
"""

MOST_ENTRIES = 1_000_000


def correlogram_table(table: Correlogram) -> dict[str, Any]:
    """The correlogram as plain values, including the densities by offset."""
    return {
        "lags": table.lags.tolist(),
        "directions_deg": table.directions_deg.tolist(),
        "rho": np.round(table.rho, DIGITS).tolist(),
        "density_by_offset": np.round(table.density_by_offset, DIGITS).tolist(),
        "density": table.density,
        "reach": table.reach,
        "interior": [
            {
                "density": each.density,
                "rho": np.round(each.rho, DIGITS).tolist(),
                "density_by_offset": np.round(each.density_by_offset, DIGITS).tolist(),
            }
            for each in table.interior
        ],
    }


def density_by_angle(table: Correlogram) -> list[list[float]]:
    """Pairs of an angle off nadir [deg] and the density p at that angle, averaged over directions."""
    angles = np.degrees(np.arctan(table.lags)).tolist()
    # The values are rounded as in files. They are then the same before the file is written and
    # after it is read.
    kept = np.round(table.density_by_offset, DIGITS)
    densities = np.round(kept.mean(axis=0), DIGITS).tolist()
    return [[0.0, table.density], *map(list, zip(angles, densities, strict=True))]


def correlogram_from(table: Mapping[str, Any], where: str) -> Correlogram:
    """A correlogram from the result of `correlogram_table`.

    Parameters
    ----------
    table
        The values.
    where
        Name of the file, for messages.

    Raises
    ------
    RequestError
        If a value is missing, has the wrong shape, or is outside its domain.
    """

    def numbers(name: str, shape: tuple[int, ...] | None = None) -> NDArray[np.float64]:
        try:
            values = np.array(table[name], dtype=np.float64)
        except KeyError:
            raise _wrong(where, f"{name} is missing") from None
        except (TypeError, ValueError):
            raise _wrong(where, f"{name} is not a table of numbers") from None
        if values.size > MOST_ENTRIES or not np.isfinite(values).all():
            raise _wrong(
                where, f"{name} contains values that are not finite numbers, or too many values"
            )
        if shape is not None and values.shape != shape:
            raise _wrong(where, f"{name} is of shape {values.shape}, not {shape}")
        return values

    lags, directions = numbers("lags"), numbers("directions_deg")
    if lags.ndim != 1 or not lags.size or lags[0] <= 0.0 or (np.diff(lags) <= 0.0).any():
        raise _wrong(where, "lags are not positive and increasing")
    even = np.arange(directions.size) * (180.0 / max(directions.size, 1))
    if directions.ndim != 1 or not directions.size or not np.allclose(directions, even):
        raise _wrong(where, "directions_deg do not divide the half circle evenly from 0")
    rho = numbers("rho", (directions.size, lags.size))
    densities = numbers("density_by_offset", rho.shape)
    density, reach = float(numbers("density", ())), float(numbers("reach", ()))
    if np.abs(rho).max() > 1.0:
        raise _wrong(where, "rho is not between -1 and 1")
    if not 0.0 <= min(density, densities.min()) <= max(density, densities.max()) <= 1.0:
        raise _wrong(where, "a density is not between 0 and 1")
    if reach <= 0.0:
        raise _wrong(where, f"reach {reach:g} is not above 0")
    inside = table.get("interior", [])
    if not isinstance(inside, list) or len(inside) not in (0, len(INTERIOR)):
        raise _wrong(where, f"interior does not contain {len(INTERIOR)} tables")
    if not all(isinstance(each, dict) for each in inside):
        raise _wrong(where, "interior contains a value that is not a table")
    shared = {"lags": table["lags"], "directions_deg": table["directions_deg"], "reach": reach}
    interior = tuple(correlogram_from({**each, **shared, "interior": []}, where) for each in inside)
    return Correlogram(lags, directions, rho, densities, density, reach, interior)


def _wrong(where: str, what: str) -> RequestError:
    return RequestError(
        f"correlogram of '{where}': {what}", "save the scene again from its point cloud"
    )
