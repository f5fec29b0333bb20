"""The coverage of a flight over an area: the photos that see each place, and the gaps.

A plan with a target has a probability of detection at each place.  A place is then a gap if the
probability with the flown photos is lower than the planned probability by more than `SHORT`.  For
other plans, each place below canopy needs N sites in the rectangle around it
(`aosplan.areas.coverage`), and clear ground needs one photo.  A place is then a gap if it has fewer
sites or photos than needed, and fewer than planned.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.areas.photo_sets import PhotoSets, photo_sets
from aosplan.geodesy import to_wgs84
from aosplan.maps.detection_map import ground_of, photos_of
from aosplan.planning.place_detection import PlaceDetection, canopy_over, relative_depth

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.areas.ground_cells import GroundCells
    from aosplan.planning.result import Plan

    Floats = NDArray[np.float64]
    Whole = NDArray[np.int64]

SHORT = 0.05
"""A place is a gap if its probability of detection is lower than the planned one by more than this
value.
"""

AROUND = 3
"""Side, in cells, of the square over which probabilities are averaged before gaps are found."""

SHARES = (0.5, 0.7, 0.8, 0.9, 0.95)
"""Numbers of photos with which the gaps are to be closed, as shares of the number of planned
photos. They are tried in this order until the photos close the gaps.
"""

NEAR = 0.01
"""A flight to all missing sites would give a certain mean probability of detection in the gaps. The
flight to the chosen sites may give a probability that is lower by at most this value.
"""


class CoverageMap(NamedTuple):
    """Coverage of the ground of a plan by photos.

    Attributes
    ----------
    cells
        The cells of the ground.
    origin
        Latitude and longitude of the origin of the cells.
    planned, flown
        Number of planned and of flown photos that see each cell, shape (cells,).
    gaps
        Mask of the cells that are gaps.
    planned_detection, flown_detection
        Probability of detection in each cell; None for a plan without a target to find.
    """

    cells: GroundCells
    origin: tuple[float, float]
    planned: Whole
    flown: Whole
    gaps: NDArray[np.bool_]
    planned_detection: Floats | None
    flown_detection: Floats | None

    @property
    def gap_share(self) -> float:
        """Share of the ground that is a gap."""
        return float(self.gaps[self.cells.inside_rows].mean())

    def document(self) -> dict[str, Any]:
        """The coverage as plain values, ``coverage`` in a review's JSON document."""
        inside = self.cells.inside_rows
        planned, flown = self.planned[inside], self.flown[inside]
        return {
            "area_m2": self.cells.area_m2,
            "cell_m": self.cells.cell_m,
            "planned_photos": float(planned.mean()),
            "flown_photos": float(flown.mean()),
            "unseen_share": float((flown == 0).mean()),
            "gap_share": self.gap_share,
            "gap_m2": self.gap_share * self.cells.area_m2,
            "gaps": len(self.gap_polygons()),
            "rule": "photos" if self.planned_detection is None else "detection",
        }

    def geotiff(self) -> bytes:
        """A GeoTIFF with bands for photos, missing photos, gaps, and the probability of detection.

        Raises
        ------
        MissingExtraError
            If rasterio is not installed.
        """
        bands: list[Any] = [self.flown, np.maximum(self.planned - self.flown, 0), self.gaps]
        names = ["photos", "photos missing", "gap"]
        if self.planned_detection is not None:
            bands += [self.flown_detection, self.planned_detection]
            names += ["probability of detection", "probability of detection as planned"]
        return self.cells.geotiff(bands, names, self.origin)

    def gap_polygons(self) -> list[Any]:
        """The gaps as polygons in metres east and north, the largest first."""
        import shapely

        rows, columns = np.nonzero(self.gaps.reshape(self.cells.inside.shape) & self.cells.inside)
        west = self.cells.left_m + columns * self.cells.cell_m
        north = self.cells.top_m - rows * self.cells.cell_m
        side = self.cells.cell_m
        # GEOS leaves floating-point flags set, for which NumPy would print warnings.
        with np.errstate(divide="ignore", invalid="ignore"):
            whole = shapely.union_all(shapely.box(west, north - side, west + side, north))
        parts = [part for part in shapely.get_parts(whole).tolist() if part.area > 0.0]
        return sorted(parts, key=lambda part: -part.area)

    def geojson(self) -> bytes:
        """The gaps as GeoJSON (RFC 7946), one feature per gap with its area."""
        import json

        from shapely.geometry.polygon import orient

        features = []
        for number, part in enumerate(self.gap_polygons()):
            # Outer rings are counterclockwise, inner rings clockwise.
            polygon = orient(part)
            rings = []
            for ring in (polygon.exterior, *polygon.interiors):
                east, north = np.array(ring.coords).T
                latitude, longitude = to_wgs84(self.origin, east.tolist(), north.tolist())
                rings.append(
                    [[round(x, 8), round(y, 8)] for x, y in zip(longitude, latitude, strict=True)]
                )
            features.append(
                {
                    "type": "Feature",
                    "properties": {"gap": number, "area_m2": round(part.area, 1)},
                    "geometry": {"type": "Polygon", "coordinates": rings},
                }
            )
        return json.dumps({"type": "FeatureCollection", "features": features}).encode() + b"\n"


class Coverage:
    """The ground of a plan, with methods for its coverage by photos.

    Parameters
    ----------
    plan
        The plan.
    """

    def __init__(self, plan: Plan) -> None:
        assert plan.origin is not None  # Reviews of plans without a location do not have a map.
        self._plan, self._origin = plan, plan.origin
        self.cells, _ = ground_of(plan)
        self._places = self.cells.middles_m
        self._sites = photos_of(plan)
        self._inside = self.cells.inside_rows
        survey, area = plan.layout.survey, plan.layout.area
        footprint = plan.inputs.footprint_m
        self._window_m = footprint if survey is None else survey.rectangle_m
        self._clear = np.zeros(len(self._places), np.bool_)
        if area is not None and not area.clear.is_empty:
            import shapely

            # GEOS leaves floating-point flags set, for which NumPy would print warnings.
            with np.errstate(divide="ignore", invalid="ignore"):
                self._clear = shapely.contains_xy(area.clear, *self._places.T)
        self._planned_sets = self._sets(self._sites)
        self._predict = self._depth = None
        self._planned_detection: Floats | None = None
        if plan.detection is not None:
            self._predict = PlaceDetection(plan)
            self._depth = relative_depth(canopy_over(plan, self.cells))
            self._planned_detection = self._detection(self._sites)

    def of(self, points_m: Floats, counted_m: Floats) -> CoverageMap:
        """Coverage by photos.

        Parameters
        ----------
        points_m
            Positions of the photos, metres east and north, shape (N, 2).
        counted_m
            Positions for the count of sites around a place, shape (N, 2). If a photo belongs to a
            site of the plan, this is the position of the site, otherwise the position of the photo.
        """
        sets = self._sets(points_m)
        detection = self._detection(points_m) if self._predict is not None else None
        if self._planned_detection is not None and detection is not None:
            gaps = self._around(self._planned_detection - detection) > SHORT
        else:
            gaps = self._counts(counted_m) < self._needed
        return CoverageMap(
            self.cells,
            self._origin,
            self._planned_sets.looks,
            sets.looks,
            gaps & self._inside,
            self._planned_detection,
            detection,
        )

    def closing(self, points_m: Floats, counted_m: Floats, missing_m: Floats) -> NDArray[np.intp]:
        """Choose a small number of the missing sites that close the gaps as well as all of them
        would.

        The result has the indices of these sites in increasing order. Sites are chosen one after
        the other: the next site is always the one that helps the largest number of places.
        """
        found = self.of(points_m, counted_m)
        gaps = np.flatnonzero(found.gaps)
        if not len(gaps):
            return np.zeros(0, np.intp)
        if self._predict is None:
            wide = self._sets_by(missing_m, self._window_m)
            own = self._sets(missing_m)
            rows = [(own if self._clear[k] else wide).of(k) for k in gaps.tolist()]
            return covering(rows, (self._needed - self._counts(counted_m))[gaps], len(missing_m))
        rows = list(map(self._sets(missing_m).of, gaps.tolist()))

        def detected(more_m: Floats) -> float:
            """Mean probability of detection in the gaps, after additional photos at the given
            positions.
            """
            points = np.vstack([points_m, more_m])
            return float(self._detection(points, gaps).mean())

        enough = detected(missing_m) - NEAR
        for share in SHARES:
            wanted = np.ceil(share * found.planned[gaps]).astype(np.int64) - found.flown[gaps]
            fewer = covering(rows, wanted, len(missing_m))
            if detected(missing_m[fewer]) >= enough:
                return fewer
        return np.arange(len(missing_m))

    def gains(self, found: CoverageMap, missing_m: Floats) -> Whole:
        """Count, for each missing site, the cells in gaps that a photo at this site would help to
        close.
        """
        size_m = self._window_m if self._predict is None else self._plan.inputs.footprint_m
        gaps = self._places[found.gaps]
        sets = photo_sets(gaps, missing_m, size_m, self._plan.heading_deg)
        counts: Whole = np.bincount(sets.photos, minlength=len(missing_m))
        return counts

    @property
    def _needed(self) -> Whole:
        """Number of photos that each place needs: the planned number or the number that the
        coverage rule requires, whichever is smaller.
        """
        most = np.where(self._clear, 1, self._plan.solution.pattern.samples)
        needed: Whole = np.minimum(self._counts(self._sites), most)
        return needed

    def _counts(self, points_m: Floats) -> Whole:
        """Number of sites in the rectangle around each place.  For clear ground, it is the number
        of photos that see the place.
        """
        wide = self._sets_by(points_m, self._window_m).looks
        return np.where(self._clear, self._sets(points_m).looks, wide)

    def _sets(self, points_m: Floats) -> PhotoSets:
        return self._sets_by(points_m, self._plan.inputs.footprint_m)

    def _sets_by(self, points_m: Floats, size_m: tuple[float, float]) -> PhotoSets:
        return photo_sets(self._places, points_m, size_m, self._plan.heading_deg)

    def _around(self, values: Floats) -> Floats:
        """Average each cell with its neighbours on the ground. Otherwise, noise would appear as
        gaps.
        """
        from scipy.ndimage import uniform_filter

        shape, inside = self.cells.inside.shape, self.cells.inside.astype(np.float64)
        total = uniform_filter(values.reshape(shape) * inside, AROUND, mode="constant")
        share = uniform_filter(inside, AROUND, mode="constant")
        return (total / np.maximum(share, 1e-9)).ravel()

    def _detection(self, points_m: Floats, some: Whole | None = None) -> Floats:
        """Probability of detection at all places, or at some of them."""
        assert self._predict is not None
        some = np.arange(len(self._places)) if some is None else some
        places, depth = self._places[some], None if self._depth is None else self._depth[some]
        plan = self._plan
        sets = photo_sets(places, points_m, plan.inputs.footprint_m, plan.heading_deg)
        return self._predict.probabilities(sets, places, points_m, depth)


def covering(rows: list[Whole], wanted: Whole, sites: int) -> NDArray[np.intp]:
    """Choose a small number of sites so that each place is seen from as many sites as it needs, if
    possible.

    Parameters
    ----------
    rows
        For each place, the indices of the sites that see it.
    wanted
        For each place, the number of sites from which it has to be seen.
    sites
        Number of sites.
    """
    from scipy.sparse import csr_matrix

    lengths = np.array([len(row) for row in rows])
    left = np.minimum(wanted, lengths)
    sees = csr_matrix(
        (np.ones(lengths.sum()), np.concatenate(rows), np.concatenate([[0], np.cumsum(lengths)])),
        shape=(len(rows), sites),
    )
    seen_by = sees.T.tocsr()
    chosen = np.zeros(sites, np.bool_)
    while (left > 0).any():
        gain = seen_by @ (left > 0).astype(np.float64)
        gain[chosen] = -1.0
        best = int(np.argmax(gain))
        chosen[best] = True
        left[seen_by.indices[seen_by.indptr[best] : seen_by.indptr[best + 1]]] -= 1
    return np.flatnonzero(chosen)
