"""Maps of the probability of detection over the ground of a plan."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.areas.ground_cells import GroundCells, cells_over, footprints, side_m
from aosplan.areas.photo_sets import along_and_across, photo_sets
from aosplan.errors import RequestError
from aosplan.messages import Message
from aosplan.planning.place_detection import PlaceDetection, canopy_over, relative_depth

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from aosplan.planning.result import Plan
    from aosplan.scenes.local_canopy import LocalCanopy

    Floats = NDArray[np.float64]

KNOWN_SHARE = 0.99
"""If the canopy is known for less than this share of the places, a warning says what is assumed for
the other places.
"""


class SearchSuccess(NamedTuple):
    """Probability of success of a search, for a prior of the target's position.

    Attributes
    ----------
    area
        Probability that the target is on the ground of the map (POA).
    success
        Probability that the target is on this ground and is found (POS).
    """

    area: float
    success: float


class DetectionMap(NamedTuple):
    """Probability of detection over the ground of a plan.

    Attributes
    ----------
    cells
        The cells of the ground. The ground is the area of the plan, or everything that at least one
        photo shows.
    ground
        ``area`` or ``footprints``.
    origin
        Latitude and longitude of the origin of the cells.
    looks
        Number of photos that see each cell, shape (cells,).
    probability
        Probability of detection in each cell.
    canopy
        The canopy above each cell; None for a scene without a location.
    sweep_width_m
        Sweep width W of a continuous line of photos: the integral of the probability of detection
        over the distance from the line. None for other grids.
    """

    cells: GroundCells
    ground: str
    origin: tuple[float, float]
    looks: NDArray[np.int64]
    probability: Floats
    canopy: LocalCanopy | None
    sweep_width_m: float | None

    def success(self, prior: str) -> SearchSuccess:
        """Probability of success, for a prior of the target's position in a GeoTIFF.

        Raises
        ------
        RequestError, MissingExtraError
            As in `aosplan.areas.prior.prior_shares`.
        """
        from aosplan.areas.prior import prior_shares

        shares = prior_shares(self.cells, self.origin, prior)
        return SearchSuccess(float(shares.sum()), float(shares @ self.probability))

    @property
    def mean(self) -> float:
        """Mean probability of detection, which is the probability that a target at a random place
        is found.
        """
        return float(self.probability[self.cells.inside_rows].mean())

    def document(self, success: SearchSuccess | None = None) -> dict[str, Any]:
        """The map as plain values: ``detection.map`` in a plan's JSON document, with the values of
        `success`.
        """
        looks = self.looks[self.cells.inside_rows]
        return {
            "probability": self.mean,
            "ground": self.ground,
            "area_m2": self.cells.area_m2,
            "cell_m": self.cells.cell_m,
            "photos": {
                "mean": float(looks.mean()),
                "least": int(looks.min()),
                "most": int(looks.max()),
            },
            "unseen_share": float((looks == 0).mean()),
            "canopy": "scene" if self.canopy is None else "local",
            "sweep_width_m": self.sweep_width_m,
            "probability_of_area": success and success.area,
            "probability_of_success": success and success.success,
        }

    def geotiff(self) -> bytes:
        """A GeoTIFF with bands for probability of detection, number of photos, and hidden share.

        Raises
        ------
        MissingExtraError
            If rasterio is not installed.
        """
        bands = [self.probability, self.looks]
        names = ["probability of detection", "photos"]
        if self.canopy is not None:
            bands.append(-np.expm1(-self.canopy.depth))
            names.append("share of the ground that is hidden from above")
        return self.cells.geotiff(bands, names, self.origin)

    def messages(self) -> Iterator[Message]:
        """Yield warnings about the map."""
        if self.canopy is not None and self.canopy.known_share < KNOWN_SHARE:
            yield Message(
                "canopy_unknown",
                "the scene does not contain the canopy above "
                f"{1.0 - self.canopy.known_share:.0%} of the mapped ground; the mean canopy "
                "of the scene is used there",
            )


def photos_of(plan: Plan) -> Floats:
    """Positions of all photos of a plan, metres east and north, shape (N, 2)."""
    sites = plan.layout.sites
    points = np.column_stack([sites.east_m, sites.north_m])
    photos: Floats = points[np.asarray(sites.photo, dtype=bool)]
    return photos


def ground_of(plan: Plan) -> tuple[GroundCells, str]:
    """The ground of a plan as cells: its area, or the ground that its photos show."""
    footprint = plan.inputs.footprint_m
    if plan.layout.area is not None:
        whole, ground = plan.layout.area.whole, "area"
    else:
        whole, ground = footprints(photos_of(plan), footprint, plan.heading_deg), "footprints"
    return cells_over(whole, side_m(float(whole.area), min(footprint))), ground


def detection_map(plan: Plan) -> DetectionMap:
    """Compute the probability of detection over the ground of a plan.

    Parameters
    ----------
    plan
        A plan with a location and a target to find.

    Raises
    ------
    RequestError
        If the plan has no location or no target.
    """
    if plan.detection is None:
        raise RequestError("a detection map needs a target", "give --find person")
    if plan.origin is None:
        raise RequestError(
            "a detection map needs a location", "give --origin LAT,LON or --area FILE"
        )
    cells, ground = ground_of(plan)
    points = photos_of(plan)
    places = cells.middles_m
    sets = photo_sets(places, points, plan.inputs.footprint_m, plan.heading_deg)
    canopy = canopy_over(plan, cells)
    depth = relative_depth(canopy)
    probability = PlaceDetection(plan).probabilities(sets, places, points, depth)
    width_m = None
    if plan.layout.continuous is not None and plan.layout.area is None:
        width_m = _sweep_width_m(plan, cells, points, probability)
    return DetectionMap(cells, ground, plan.origin, sets.looks, probability, canopy, width_m)


def _sweep_width_m(
    plan: Plan, cells: GroundCells, points_m: Floats, probability: Floats
) -> float | None:
    """Integrate the probability of detection over the distance from the line of photos.

    The integral is averaged along the middle part of the line, because fewer photos see the ground
    near the ends.
    """
    half = 0.5 * plan.inputs.footprint_m[0]
    along = along_and_across(points_m, plan.heading_deg)[:, 0]
    first, last = float(along.min()) + half, float(along.max()) - half
    if last - first < cells.cell_m:
        return None
    place = along_and_across(cells.middles_m, plan.heading_deg)[:, 0]
    within = (place >= first) & (place < last) & cells.inside_rows
    return float(probability[within].sum()) * cells.cell_m**2 / (last - first)
