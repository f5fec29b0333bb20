"""Plans over areas, from the file to the waypoints on earth.

The checks do not use lattices.  They project waypoints and area with PROJ, and count sites.
"""

import contextlib
import json
import math
import re
from collections import Counter

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from pyproj import Transformer
from support.shapes import areas, outlines, points_in

import aosplan
from aosplan import PlanRequest
from aosplan.errors import InfeasibleError, RequestError
from aosplan.geodesy import to_wgs84

PLACES = [(48.3, 14.3), (0.0, 0.0), (-16.5, 180.0), (52.0, -179.9999), (-89.0, 20.0)]
"""Places on earth.  They are not close to a pole, because lines that are straight in degrees are
not straight in metres there.
"""

quick = settings(
    max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)  # fmt: skip


@pytest.fixture
def file(tmp_path):
    """A function that writes a shape in metres around a place to GeoJSON and returns its path."""

    def write(shape, place=PLACES[0], name="area.geojson"):
        def turned(points):
            latitudes, longitudes = to_wgs84(place, *points.T.tolist())
            return np.column_stack([longitudes, latitudes])

        table = json.loads(shapely.to_geojson(shapely.transform(shape, turned)))
        path = tmp_path / name
        path.write_text(json.dumps(table))
        return str(path)

    return write


def planned(path, **options):
    return aosplan.plan(PlanRequest(**{"altitude": 40, "vhat": 0.9, "area": path} | options))


def opened(shape, radius_m=1e-6):
    """A shape without spikes that are narrower than twice the radius.  Sharp corners are kept."""
    corners = {"join_style": "mitre", "mitre_limit": 1000.0}
    inner = shapely.buffer(shape, -radius_m, **corners)
    return shapely.buffer(inner, radius_m, **corners)


class Judge:
    """Waypoints and area of a plan in metres along and across the heading."""

    def __init__(self, plan):
        latitude, longitude = plan.layout.survey.origin
        self.plan = plan
        self.project = Transformer.from_crs(
            "EPSG:4326", f"+proj=aeqd +lat_0={latitude} +lon_0={longitude} +ellps=WGS84"
        )
        self.heading = math.radians(plan.request.heading)
        ways = plan.waypoints
        self.way = self.turned(*self.project.transform(ways.latitude, ways.longitude))
        photo = np.ones(len(ways), bool) if ways.photo is None else np.array(ways.photo)
        self.sites = self.way[photo]

    def turned(self, east, north):
        east, north = np.asarray(east), np.asarray(north)
        sine, cosine = math.sin(self.heading), math.cos(self.heading)
        return np.column_stack([east * sine + north * cosine, east * cosine - north * sine])

    def shape(self, path):
        with open(path, encoding="utf-8") as text:
            shape = shapely.from_geojson(text.read())
        shape = shapely.transform(
            shape, lambda points: self.turned(*self.project.transform(points[:, 1], points[:, 0]))
        )
        # After rounding, the sides of a spike may cross each other, or may enclose no area.
        return opened(shapely.make_valid(shape))

    def area(self, path):
        """The shape of an area without the slivers that the plan reports as left out."""
        whole = self.shape(path)
        parts = shapely.get_parts(whole)
        size = shapely.area(parts)
        sliver = (2 * size / shapely.length(parts) < 0.5) & (size < 0.001 * size.sum())
        told = [warning.message for warning in self.plan.warnings if warning.code == "slivers"]
        if not told:
            return whole
        left_out = float(re.search(r"a total area of (\S+) m²\)", *told)[1])
        # The message has two digits, and repaired outlines may have tiny parts of less than 1 mm².
        assert left_out == pytest.approx(size[sliver].sum(), rel=0.051, abs=1e-6)
        return shapely.multipolygons(parts[~sliver])

    def seen(self, points, size):
        """Number of sites in a rectangle around each point, with a tolerance of 0.1 mm."""
        apart = np.abs(self.sites[None] - points[:, None])
        return (apart <= np.array(size) / 2 + 1e-4).all(axis=2).sum(axis=1)

    def rectangle(self):
        pattern, b = self.plan.solution.pattern, self.plan.solution.baseline_m
        return pattern.columns * b, pattern.rows * pattern.row_pitch * b

    def check_order(self):
        assert len({(round(x, 4), round(y, 4)) for x, y in self.sites}) == len(self.sites)
        legs = np.hypot(*np.diff(self.way, axis=0).T)
        assert self.plan.route.length_m == pytest.approx(legs.sum(), abs=1e-3 * len(self.way))
        timing = self.plan.route.timing
        seconds = sum(map(timing.leg_s, legs)) + len(self.sites) * self.plan.request.hold
        assert self.plan.route.time_s == pytest.approx(seconds, rel=1e-4)
        assert self.plan.layout.survey.sites == len(self.sites)
        assert self.plan.route.length_m >= self.plan.layout.survey.shortest_m * (1 - 1e-9)


# Coverage

WITH_A_SLIVER = shapely.MultiPolygon(
    [shapely.Polygon([(-0.25, -0.433), (-0.25, 0.433), (1, 0)]), shapely.box(1.5, -18, 37.5, 18)]
)
"""An area with a triangle that is narrower than half a metre and has less than a thousandth of the
area.
"""


@quick
@example(WITH_A_SLIVER, PLACES[0], 0.0, "trimmed", 0)
@given(
    areas(),
    st.sampled_from(PLACES),
    st.floats(0, 360),
    st.sampled_from(["trimmed", "rectangle", "square"]),
    st.integers(0, 2**32),
)
def test_every_point_is_seen_from_n_sites_within_the_rectangle(
    file, shape, place, heading, grid, seed
):
    path = file(shape, place)
    plan = planned(path, heading=heading, grid=grid)
    judge = Judge(plan)
    points = points_in(judge.area(path), 60, np.random.default_rng(seed))
    assert (judge.seen(points, judge.rectangle()) >= plan.solution.pattern.samples).all()
    footprint = plan.camera.footprint_m(plan.altitude_m)
    assert all(size <= image for size, image in zip(judge.rectangle(), footprint, strict=True))
    assert plan.layout.survey.covered_share == 1.0
    assert plan.layout.survey.fewest_looks >= plan.solution.pattern.samples
    judge.check_order()


@pytest.mark.parametrize(
    ("grid", "most"), [("lanes", {"max_aperture": 20}), ("line", {"max_aperture": 24, "vhat": 0.8})]
)
def test_lanes_and_lines_cover_an_area(file, grid, most):
    path = file(shapely.box(-60, -40, 60, 40))
    plan = planned(path, grid=grid, heading=20, **most)
    judge = Judge(plan)
    points = points_in(judge.shape(path), 300, np.random.default_rng(1))
    rectangle = plan.layout.survey.rectangle_m
    footprint = plan.camera.footprint_m(plan.altitude_m)
    assert all(size <= image * (1 + 1e-9) for size, image in zip(rectangle, footprint, strict=True))
    assert (judge.seen(points, rectangle) >= plan.solution.pattern.samples).all()
    if grid == "line":
        # The distance between lines is the width of an image.
        assert rectangle[1] == pytest.approx(footprint[1])
        narrow = planned(path, grid=grid, heading=20, lane_pitch=2, **most)
        assert narrow.layout.survey.pitch_m[1] == pytest.approx(2 * narrow.layout.survey.pitch_m[0])
        assert narrow.layout.survey.sites > plan.layout.survey.sites
        best = planned(path, grid=grid, heading=20, lane_pitch="best", **most)
        assert best.layout.survey.sites == plan.layout.survey.sites


def test_an_area_of_ten_kilometres_is_covered_from_a_high_altitude(file):
    path = file(shapely.Point(0, 0).buffer(5000), (70.0, 20.0))
    plan = planned(path, altitude=4000, baseline=250, samples=10)
    judge = Judge(plan)
    points = points_in(judge.shape(path), 300, np.random.default_rng(2))
    # At 5 km from the centre, distances have a relative error of 1e-7, which is half a millimetre.
    assert (judge.seen(points, np.array(judge.rectangle()) + 2e-3) >= 10).all()


def test_a_disc_around_a_pole_is_covered(file):
    ring = [[longitude, -89.9994] for longitude in range(-180, 180, 20)]
    path = file(shapely.box(0, 0, 1, 1))
    with open(path, "w", encoding="utf-8") as text:
        json.dump({"type": "Polygon", "coordinates": [[*ring, ring[0]]]}, text)
    plan = planned(path)
    judge = Judge(plan)
    angle = np.linspace(0, 2 * math.pi, 100)
    points = np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.concatenate([66.9 * points, 30.0 * points, 0.0 * points])  # 0.0006° are 67 m.
    assert (judge.seen(points, judge.rectangle()) >= 10).all()


def test_the_fewest_looks_equal_a_count_on_a_fine_raster(file):
    path = file(shapely.Polygon([(0, 0), (50, 4), (44, 30), (20, 12), (5, 40)]))
    plan = planned(path, heading=33, vhat=0.98)
    judge = Judge(plan)
    shape = judge.shape(path)
    low, high = np.array(shape.bounds[:2]), np.array(shape.bounds[2:])
    raster = np.stack(
        np.meshgrid(*[np.arange(a, b, 0.37) for a, b in zip(low, high, strict=True)]), -1
    )
    points = raster.reshape(-1, 2)
    points = points[shapely.contains_xy(shape, points[:, 0], points[:, 1])]
    counted = judge.seen(points, judge.rectangle())
    assert counted.min() >= 50
    # The smallest number of views in the plan is reached by some point.
    assert counted.min() >= plan.layout.survey.fewest_looks >= 50
    assert counted.min() <= plan.layout.survey.fewest_looks + 2


def test_every_outer_row_and_column_of_sites_is_needed(file):
    # Without the outermost sites on any side, some point would be in fewer than N rectangles.
    path = file(shapely.box(-28, -14, 28, 14))
    plan = planned(path, heading=90, grid="square", samples=16, baseline=3.5)
    judge = Judge(plan)
    assert plan.layout.survey.sites == (16 + 3) * (8 + 3)
    points = points_in(judge.shape(path), 400, np.random.default_rng(3))
    every = judge.sites
    for axis in (0, 1):
        for edge in (every[:, axis].min(), every[:, axis].max()):
            judge.sites = every[np.abs(every[:, axis] - edge) > 0.1]
            assert judge.seen(points, judge.rectangle()).min() < 16


# Clear ground

WITH_A_SPIKE = shapely.from_wkt(
    "MULTIPOLYGON (((5.371484736897529 7.74698664723029, 4.0901699437494745 9.510565162951535, "
    "5.027245325073185 8.22079154997895, 5.403023058681398 8.414709848078965, "
    "5.371484736897529 7.74698664723029)), ((-9.988864023252177 0.4718003020117096, "
    "-7.090169943749474 1.9676574865563807, -7.0901699437494745 -1.3894297622895384, "
    "-9.988864023252177 0.4718003020117096)))"
)
"""The sides of the spike cross in one projection and not in another."""


@quick
@example(WITH_A_SPIKE, shapely.box(-5, -8, 5, -6), 0.0, 0)
@given(areas(least_m=10.0), outlines(least_m=10.0), st.floats(0, 360), st.integers(0, 2**32))
def test_clear_ground_is_in_one_image_and_canopy_in_n(file, shape, clearing, heading, seed):
    path, clear = file(shape), file(clearing, name="clear.geojson")
    plan = planned(path, clear=clear, heading=heading)
    judge = Judge(plan)
    whole, open_ground = judge.area(path), judge.shape(clear)
    points = points_in(whole, 80, np.random.default_rng(seed))
    assert (judge.seen(points, plan.camera.footprint_m(plan.altitude_m)) >= 1).all()
    hidden = points[shapely.distance(shapely.points(points), open_ground) > 1e-3]
    if plan.layout.survey.fewest_looks is not None:
        assert (judge.seen(hidden, judge.rectangle()) >= plan.solution.pattern.samples).all()
    assert plan.layout.survey.covered_share == 1.0
    assert plan.layout.survey.clear_m2 == pytest.approx(
        shapely.intersection(whole, open_ground).area, rel=1e-3, abs=0.05
    )
    judge.check_order()


def test_a_spike_without_width_is_not_reported_as_a_sliver(file):
    plan = planned(file(WITH_A_SPIKE))
    assert [warning.code for warning in plan.warnings] == []
    assert plan.layout.survey.area_m2 == pytest.approx(WITH_A_SPIKE.area, rel=1e-5)


def test_clear_ground_needs_far_fewer_sites(file):
    path = file(shapely.box(-100, -100, 100, 100))
    half = file(shapely.box(0, -200, 200, 200), name="half.geojson")
    dense, sparse, open_ = (
        planned(path, **extra).layout.survey.sites
        for extra in ({}, {"clear": half}, {"clear": path})
    )
    assert dense / 2 < sparse < 0.56 * dense
    # If the whole area is clear, the images cover it without overlap.
    footprint = planned(path).camera.footprint_m(40)
    assert open_ == math.prod(math.ceil(200 / size - 1e-3) for size in footprint)


def test_a_scene_without_occluders_needs_one_photo_of_every_point(file):
    path = file(shapely.box(-50, -50, 50, 50))
    plan = planned(path, density=0, occluder_size=0.2, volume_height=18)
    judge = Judge(plan)
    points = points_in(judge.shape(path), 300, np.random.default_rng(1))
    assert (judge.seen(points, plan.camera.footprint_m(40)) >= 1).all()
    assert plan.layout.survey.sites == 4 * 3
    assert plan.layout.survey.fewest_looks is None


# No-fly zones


@quick
@given(
    areas(least_m=10.0), st.lists(outlines(most_m=40.0), min_size=1, max_size=3),
    st.sampled_from([0.0, 3.0]), st.sampled_from(PLACES), st.integers(0, 2**32),
)  # fmt: skip
def test_sites_and_legs_avoid_zones_and_lost_coverage_is_reported(
    file, shape, outlines_, buffer, place, seed
):
    zone = shapely.multipolygons([o for o in outlines_ if o.is_valid])
    path, no_fly = file(shape, place), file(zone, place, "zone.geojson")
    try:
        plan = planned(path, no_fly=no_fly, buffer=buffer, heading=25)
    except InfeasibleError:  # No site remains.
        return
    judge = Judge(plan)
    walls = judge.shape(no_fly)
    way = shapely.LineString(judge.way) if len(judge.way) > 1 else shapely.Point(judge.way[0])
    assert shapely.distance(way, walls) >= buffer + 0.03
    judge.check_order()
    # The share of points with too few views has to equal the share that the plan reports.
    rng = np.random.default_rng(seed)
    whole = judge.area(path)
    low, high = np.array(whole.bounds[:2]), np.array(whole.bounds[2:])
    random = rng.uniform(low, high, (4000, 2))
    points = random[shapely.contains_xy(whole, random[:, 0], random[:, 1])]
    if len(points) < 200:
        return
    share = (judge.seen(points, judge.rectangle()) >= plan.solution.pattern.samples).mean()
    told = plan.layout.survey.covered_share
    error = math.sqrt(max(told * (1 - told), 0.5 / len(points)) / len(points))
    assert abs(share - told) < 5 * error + 1e-3
    codes = [warning.code for warning in plan.warnings]
    assert ("coverage_lost" in codes) == (told < 1.0)
    for warning in plan.warnings:
        if warning.code == "coverage_lost":
            whole = re.search(r" of ([\d,.]+) m² ", warning.message)
            assert whole is not None  # The number is written without an exponent.
            assert float(whole[1].replace(",", "")) == pytest.approx(
                plan.layout.survey.area_m2, abs=0.5
            )


def test_sites_enclosed_by_a_zone_are_dropped(file):
    path = file(shapely.box(-60, -60, 60, 60))
    ring = shapely.Point(0, 0).buffer(40).difference(shapely.Point(0, 0).buffer(25))
    plan = planned(path, no_fly=file(ring, name="ring.geojson"), buffer=0)
    assert plan.layout.survey.sites_enclosed > 50
    judge = Judge(plan)
    assert np.hypot(*judge.sites.T).min() > 40
    inner = planned(
        path,
        no_fly=file(shapely.box(-500, -500, 500, 500).difference(shapely.box(-40, -40, 40, 40))
        , name="fence.geojson"), buffer=0,
    )  # fmt: skip
    # A fence is a zone with a hole, in which flying is allowed.
    assert inner.layout.survey.sites > 100
    assert np.abs(Judge(inner).sites).max() < 40


def test_turning_points_are_in_the_files_without_a_photo(file, tmp_path):
    path = file(shapely.box(-40, -40, 40, 40))
    zone = file(shapely.box(-30, -4, 30, 4), name="zone.geojson")
    plan = planned(path, no_fly=zone, buffer=2)
    kinds = Counter(waypoint.photo for waypoint in plan.waypoints)
    assert kinds[True] == plan.layout.survey.sites
    document = plan.document()
    assert sum(not row.get("photo", True) for row in document["waypoints"]) == kinds[False]
    plan.write(str(tmp_path / "plan.geojson"))
    written = json.loads((tmp_path / "plan.geojson").read_text())["features"]
    assert len(written) == len(plan.waypoints) + 1


def test_an_area_inside_a_zone_is_refused(file):
    path = file(shapely.box(-5, -5, 5, 5))
    with pytest.raises(InfeasibleError, match="sites lie in no-fly zones"):
        planned(path, no_fly=file(shapely.box(-90, -90, 90, 90), name="zone.geojson"))


def test_lines_are_flown_without_stops_if_no_zone_is_in_the_way(file):
    path = file(shapely.box(-60, -40, 60, 40))
    away = file(shapely.box(300, 300, 310, 310), name="away.geojson")
    plan = planned(path, no_fly=away, heading=90, trigger="distance", drone="dji-m3t")
    judge = Judge(plan)
    points = points_in(judge.shape(path), 100, np.random.default_rng(1))
    assert (judge.seen(points, judge.rectangle()) >= 10).all()
    assert plan.waypoints.photo.count(False) >= 2 * plan.waypoints.photo.count(True) / 60
    assert plan.layout.continuous is None
    middle = file(shapely.box(-4, -4, 4, 4), name="middle.geojson")
    with pytest.raises(InfeasibleError, match="would pass through no-fly zones"):
        planned(path, no_fly=middle, heading=90, trigger="distance")


def test_a_warning_names_paths_from_the_takeoff_through_a_zone(file):
    path = file(shapely.box(-40, -40, 40, 40))
    wall = file(shapely.box(-100, -60, 100, -55), name="wall.geojson")
    (south, north), longitudes = to_wgs84(PLACES[0], [0.0, 0.0], [-90.0, 90.0])
    for latitude, told in ((south, True), (north, False)):
        plan = planned(path, no_fly=wall, takeoff=(latitude, longitudes[0]), flight_time=10)
        assert len(plan.route.flights) > 1
        assert ("way_through_zone" in [warning.code for warning in plan.warnings]) == told


def test_batteries_and_resuming_neither_lose_nor_repeat_a_site(file):
    path = file(shapely.box(-40, -40, 40, 40))
    zone = file(shapely.box(-10, -4, 10, 4), name="zone.geojson")
    options = {"no_fly": zone, "flight_time": 12}
    plan = planned(path, **options)
    ways = plan.waypoints
    covered = [place for f in plan.route.flights for place in range(f.first, f.last + 1)]
    photos = [place for place in covered if ways.photo is None or ways.photo[place]]
    assert len(photos) == len(set(photos)) == plan.layout.survey.sites
    later = planned(path, **options, resume_at=200)
    left = sum(later.waypoints.photo or [True] * len(later.waypoints))
    assert left == sum((ways.photo or [True] * len(ways))[200:])


# Limits


def test_too_many_sites_are_refused_before_they_are_computed(file):
    path = file(shapely.box(-9000, -9000, 9000, 9000))
    # 18 000² / 2.8² = 41.3 million
    for options, why in (({}, "10000 that --max-sites allows"), ({"max_sites": 10**9}, "one plan")):
        with pytest.raises(RequestError, match=rf"at least 41\d{{6}} sites, more than the .*{why}"):
            planned(path, **options)
    small = file(shapely.box(-150, -150, 150, 150), name="small.geojson")
    with pytest.raises(RequestError, match="more than the 10000") as caught:
        planned(small)
    needed = int(re.search(r"at least (\d+) sites", caught.value.message)[1])
    assert planned(small, max_sites=2 * needed).layout.survey.sites >= needed


def test_the_max_sites_that_a_refusal_suggests_is_enough(file):
    path = file(shapely.box(-60, -60, 60, 60))
    plan = planned(path, max_sites=100_000)
    with pytest.raises(RequestError) as caught:
        planned(path, max_sites=plan.layout.survey.sites - 1)
    assert f"needs {plan.layout.survey.sites} sites" in caught.value.message
    assert (
        planned(path, max_sites=plan.layout.survey.sites).layout.survey.sites
        == plan.layout.survey.sites
    )


def test_images_too_small_for_the_grid_are_an_error_with_a_remedy(file):
    path = file(shapely.box(-60, -60, 60, 60))
    # Over an area, every point has to be in the images of all its sites, even if single grids do
    # not need common ground.
    options = {"vhat": 0.98, "camera": "dji-h20t-thermal", "allow_no_common_ground": True}
    with pytest.raises(InfeasibleError, match="too small for an area") as caught:
        planned(path, **options, baseline=2.8)
    most = float(caught.value.hint.split("--max-aperture ")[1].split(",")[0])
    plan = planned(path, **options | {"vhat": 0.97}, max_aperture=most)
    assert plan.layout.survey.covered_share == 1.0
    assert plan.solution.met


@pytest.mark.parametrize(
    ("vhat", "optimize"), [(0.8, "time"), (0.88, "samples"), (0.9, "time"), (0.92, "samples")]
)
def test_the_best_grid_fits_into_the_images(file, vhat, optimize):
    path = file(shapely.box(-40, -30, 40, 30))
    # Without a shortest interval between photos, the grid with the shortest time has more photos
    # than are allowed.
    options = {"vhat": vhat, "optimize": optimize, "trigger": "distance", "photo_interval": 1.0}
    taken = []
    for grid in ("trimmed", "lanes"):
        with contextlib.suppress(InfeasibleError):
            taken.append(planned(path, grid=grid, **options))
    assert taken
    # This request was once refused because a line was chosen.
    best = planned(path, grid="best", **options)
    assert best.layout.survey.covered_share == 1.0
    assert best.solution.pattern.samples <= max(one.solution.pattern.samples for one in taken)


# Heading and order


def test_a_spiral_is_refused(file):
    path = file(shapely.box(-20, -20, 20, 20))
    with pytest.raises(RequestError, match="spiral cannot be repeated"):
        planned(path, grid="spiral")


def test_auto_heading_flies_along_the_longer_side(file):
    strip = shapely.transform(
        shapely.box(-100, -20, 100, 20),
        lambda p: p @ [[math.cos(0.5), math.sin(0.5)], [-math.sin(0.5), math.cos(0.5)]],
    )
    plan = planned(file(strip), heading="auto")
    assert plan.request.heading == pytest.approx(90 - math.degrees(0.5), abs=0.02)
    again = aosplan.plan(PlanRequest(**plan.request.document()))
    assert again.document() == plan.document()


def test_the_path_over_a_square_has_the_length_of_the_lower_bound(file):
    plan = planned(file(shapely.box(-50, -50, 50, 50)))
    assert plan.layout.survey.length_m == pytest.approx(plan.layout.survey.shortest_m)
    assert plan.document()["area"]["over_shortest"] == pytest.approx(1.0)
