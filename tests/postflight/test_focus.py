"""Focus and alignment: the plane, the yaw and the positions of a recording are found."""

import json
import runpy
import sys
from functools import partial

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from PIL import Image
from support.command_line import process
from support.flown import rotation_of, write_photo
from support.paths import ROOT
from support.recorded import nadir_to, photo, write_recording

from aosplan.cli.schema import json_schema
from aosplan.postflight.integral.agreement import (
    Agreement,
    DetailSums,
    agreement,
    detail_of,
    details_of,
    peaks_of,
    vertex,
)
from aosplan.postflight.integral.alignment import fitted
from aosplan.postflight.integral.focal_plane import Raster
from aosplan.postflight.integral.focus import find_focus
from aosplan.postflight.integral.integral_warnings import focus_warnings
from aosplan.postflight.integral.recording import Recording
from aosplan.postflight.integral.view_subset import ViewSubset
from aosplan.simulation.ssim import similarity

pytestmark = pytest.mark.usefixtures("folder")

GRAIN_M = 0.5


def rough(seed):
    """An aperiodic texture: random values every half metre with bilinear interpolation."""
    values = np.random.default_rng(seed).uniform(0, 255, (160, 160))

    def shade(x, y):
        column, row = x / GRAIN_M + 80.0, y / GRAIN_M + 80.0
        i, j = np.floor(row).astype(int) % 159, np.floor(column).astype(int) % 159
        v, u = row % 1.0, column % 1.0
        return (1 - v) * ((1 - u) * values[i, j] + u * values[i, j + 1]) + v * (
            (1 - u) * values[i + 1, j] + u * values[i + 1, j + 1]
        )

    return shade


GROUND = rough(1)
SITES = [np.array([3.0 * x, 3.0 * y]) for x in range(-2, 3) for y in range(-2, 3)]


def test_agreement_is_the_mean_correlation_of_all_halves():
    rng = np.random.default_rng(2)
    truth = rng.normal(size=(40, 40))
    views = truth + rng.normal(0.0, 2.0, (12, 40, 40))
    sums = DetailSums(Raster(0, 0, 1, 40, 40))
    for view in views.astype(np.float32):
        sums.add(view)
    halves = []
    for _ in range(400):
        order = rng.permutation(12)
        one, other = views[order[:6]].mean(axis=0), views[order[6:]].mean(axis=0)
        halves.append((one * other).mean() / np.sqrt((one**2).mean() * (other**2).mean()))
    error = np.std(halves) / np.sqrt(len(halves))
    # The tested formula is a ratio of means, and the comparison is a mean of ratios. These two
    # means differ much less than the results of different halves.
    assert agreement(sums).value == pytest.approx(np.mean(halves), abs=4 * error + 2e-3)


def test_a_parabola_has_its_vertex():
    places = np.array([1.0, 2.0, 4.0])
    assert vertex(places, -((places - 2.3) ** 2)) == pytest.approx(2.3)


def test_detail_has_the_same_contrast_in_dull_and_in_bright_parts(folder):
    rng = np.random.default_rng(11)
    contrast = np.where(np.arange(160) < 100, 2.0, 40.0)
    image = (128.0 + contrast * rng.standard_normal((120, 160))).astype(np.float32)
    paths = write_recording(folder, [(nadir_to(0.0), np.array([0.0, 0.0, 40.0]))], [image])
    detail = detail_of(Recording(*paths).sources[0]).pixels[..., 0]
    # Near the border of the two parts, the window contains both.
    dull, bright = detail[:, :70].std(), detail[:, 130:].std()
    assert 0.5 < dull / bright < 1.2


def curve_with(low, dip, high, deviation):
    """Agreement at nine heights, with peaks at the indices 2 and 6.  For the dip between the peaks,
    the jackknife gives the standard deviation `deviation`.
    """
    values = [0.2, 0.4, low, 0.5 * (low + dip), dip, 0.5 * (dip + high), high, 0.4, 0.2]
    off = np.resize([1.0, -1.0], 16) * deviation / np.sqrt(15.0)
    return [Agreement(value, value + off * (index == 4)) for index, value in enumerate(values)]


@pytest.mark.parametrize(("deviation", "peaks"), [(0.02, (2, 6)), (0.05, (6, None))])
def test_a_peak_rises_above_its_saddle_by_three_standard_deviations(deviation, peaks):
    # The lower peak rises by 0.1 above the dip.
    curve = curve_with(0.6, 0.5, 0.7, deviation)
    assert peaks_of(np.arange(9.0), curve) == peaks


def test_growth_and_rotation_are_separated_from_the_rest():
    rng = np.random.default_rng(3)
    positions = rng.normal(0, 5, (30, 2)) + 100.0
    x, y = (positions - positions.mean(axis=0)).T
    shifts = 0.7 + 0.02 * np.stack([x, y], axis=1) + 0.05 * np.stack([-y, x], axis=1)
    shifts[7] += 50.0
    clear = np.arange(30) != 7
    fit = fitted(shifts, clear, positions)
    # Positions are relative to the mean of all positions. Leaving out the position with the index 7
    # therefore changes only the constant.
    assert (fit.growth, fit.turn_rad) == pytest.approx((0.02, 0.05))
    assert np.abs(fit.rest_m).max() < 1e-9


def recorded(folder, height=0.0, crowns=None):
    """Poses and images of the textured ground at a given height.  There may be crowns above it."""
    views = [(nadir_to(10.0 * k), np.array([*site, 40.0])) for k, site in enumerate(SITES)]
    images = []
    for rotation, position in views:
        image = photo(rotation, position, height=height, shade=GROUND)
        if crowns is not None:
            leaves = photo(rotation, position, height=crowns, shade=rough(5))
            hidden = photo(rotation, position, height=crowns, shade=rough(6)) > 150.0
            image = np.where(hidden, leaves, image)
        images.append(np.rint(image).astype(np.uint8))
    return write_recording(folder, views, images)


@pytest.mark.parametrize("height", [-3.0, 4.5])
def test_the_ground_is_found_between_the_heights_of_a_range(folder, height):
    recording = Recording(*recorded(folder, height))
    found = find_focus(recording, np.arange(25), (-8.0, 10.0))
    assert found.ground.place == pytest.approx(height, abs=0.1)
    assert abs(found.ground.place - height) < 5 * found.ground.deviation + 0.02
    assert found.crowns is None
    assert found.name == "lowest layer found"
    assert [warning.code for warning in focus_warnings(found)] == ["one_layer"]
    assert not found.at_end


def test_ground_and_crowns_are_two_peaks(folder):
    recording = Recording(*recorded(folder, 1.0, crowns=12.0))
    found = find_focus(recording, np.arange(25))
    assert found.ground.place == pytest.approx(1.0, abs=0.2)
    assert found.crowns.place == pytest.approx(12.0, abs=0.6)
    assert found.name == "ground"
    assert focus_warnings(found) == []


@pytest.mark.slow
@pytest.mark.parametrize("sea_m", [-500.0, 0.0, 311.0])
def test_the_ground_is_found_below_cameras_at_any_height(folder, sea_m):
    # Poses are above sea level or in the system of a reconstruction. The images have black borders,
    # a logo and a fixed pattern, which would agree on planes that are far away.
    rng = np.random.default_rng(8)
    fixed = rng.normal(0.0, 12.0, (120, 160))
    views, images = [], []
    for site in SITES:
        rotation, position = nadir_to(15.0), np.array([*site, 40.0])
        image = photo(rotation, position, shade=GROUND) + fixed
        image[:, :12] = image[:, -12:] = 0.0
        image[10:25, 120:145] = 250.0
        views.append((rotation, position + np.array([0.0, 0.0, sea_m])))
        images.append(np.clip(np.rint(image), 0, 255).astype(np.uint8))
    recording = Recording(*write_recording(folder, views, images), focal_height_m=None)
    assert not recording.is_height_known
    found = find_focus(recording, np.arange(25))
    assert found.ground.place == pytest.approx(sea_m, abs=0.2)
    assert not found.at_end


def test_detail_common_to_all_images_is_left_out(folder):
    views = [(nadir_to(15.0), np.array([*site, 40.0])) for site in SITES]
    fixed = np.random.default_rng(9).integers(0, 255, (120, 160)).astype(np.uint8)
    recording = Recording(*write_recording(folder, views, [fixed] * 25))
    assert max(np.abs(detail.pixels).max() for detail in details_of(recording.sources)) < 1e-5


# Photos with errors in their metadata


def fly(folder, *, yaw_bias=0.0, height_error=0.0, off_m=0.0, seed=4):
    """Write photos whose metadata have given errors, and return the errors of the positions."""
    noise = np.random.default_rng(seed).normal(0.0, off_m, (len(SITES), 2))
    (folder / "photos").mkdir()
    for index, (site, error) in enumerate(zip(SITES, noise, strict=True)):
        yaw = 90.0 * (index % 2)
        image = photo(rotation_of(yaw, -90.0, 0.0), np.array([*site, 40.0]), shade=GROUND)
        write_photo(folder / "photos" / f"DJI_{index:04d}.jpg", (*(site + error), 40.0 + height_error),
                    (yaw + yaw_bias, -90.0, 0.0), image=np.rint(image).astype(np.uint8))  # fmt: skip
    return noise


@pytest.mark.slow
def test_yaw_and_height_are_found_where_positions_are_true(folder):
    fly(folder, yaw_bias=3.0, height_error=2.0)
    recording = Recording("photos")
    found = find_focus(recording, np.arange(25), align="yaw")
    assert found.ground.place == pytest.approx(2.0, abs=0.15)
    assert found.correction.yaw_deg == pytest.approx(-3.0, abs=0.15)
    assert not found.correction.shifts_m.any()


def test_positions_are_recovered_except_for_undetermined_components(folder):
    noise = fly(folder, yaw_bias=3.0, height_error=2.0, off_m=0.5)
    recording = Recording("photos")
    found = find_focus(recording, np.arange(25), align="positions")
    # Photos cannot determine a common shift, rotation or scale of all positions.
    rest = fitted(noise, np.ones(25, bool), np.array(SITES)).rest_m
    left = fitted(found.correction.shifts_m + noise, np.ones(25, bool), np.array(SITES)).rest_m
    assert np.sqrt((rest**2).mean()) > 0.4
    assert np.sqrt((left**2).mean()) < 0.03
    assert abs(found.ground.place - 2.0) < 3 * found.ground.deviation
    assert abs(found.correction.yaw_deg + 3.0) < 3 * found.yaw_deviation_deg
    assert 0.2 < found.ground.deviation < 1.2
    assert found.aligned == 25


@pytest.mark.slow
def test_the_simulated_drone_comes_into_focus(folder):
    """The flight of the tutorial has errors of compass, barometer and GNSS.  It is compared with
    its true poses.
    """
    plan = tutorial(folder)
    true = Recording("recording/poses.json", "recording/images")
    raster = Raster.over((-6.0, -6.0, 6.0, 6.0), 0.125)
    wanted = true.integrate(ViewSubset(), raster).values
    recording = Recording("photos")
    every = np.arange(len(recording.views))
    blurred = recording.integrate(ViewSubset(), raster).values
    assert similarity(blurred, wanted, None, 255.0).ssim < 0.3
    found = find_focus(recording, every, align="positions", sigma_m=1.0)
    assert abs(found.ground.place - 2.0) < 2 * found.ground.deviation < 1.6
    assert abs(found.correction.yaw_deg + 3.0) < 2 * found.yaw_deviation_deg < 2.0
    assert found.crowns.place - found.ground.place == pytest.approx(12.0, abs=1.0)
    # The common position, scale and rotation are taken from the true poses, because photos do not
    # contain them.
    views = found.correction.applied(recording.views, np.eye(3))
    sites = np.array([(place["east_m"], place["north_m"]) for place in plan["waypoints"]])
    there = np.array([view.position for view in views])
    given = (there[:, 0] + 1j * there[:, 1]) - (there[:, 0] + 1j * there[:, 1]).mean()
    meant = sites[:, 0] + 1j * sites[:, 1]
    factor = np.vdot(given, meant - meant.mean()) / np.vdot(given, given)
    assert abs(abs(factor) - 1.0) < 0.04
    angle = np.angle(factor)
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    moved = meant.mean() + factor * given - (there[:, 0] + 1j * there[:, 1])
    up = (there[:, 2] - found.ground.place) * abs(factor)
    shifts = np.stack([moved.real, moved.imag, up - there[:, 2]], axis=1)
    recording.refocus(0.0, [v.moved(s, turn) for v, s in zip(views, shifts, strict=True)], every)
    assert (
        similarity(recording.integrate(ViewSubset(), raster).values, wanted, None, 255.0).ssim
        > 0.95
    )


def tutorial(folder):
    """Make the files of the how-to page, and return the plan's document."""
    stand, plan = str(folder / "stand.laz"), folder / "plan.json"
    script("make_stand.py", stand)
    options = ["--altitude", "50", "--scene", stand, "--baseline", "2", "--samples", "49"]
    done = process("plan", *options, "--origin", "48.3358,14.3261", "--json", "--quiet")
    plan.write_bytes(done.stdout)
    script("record.py", str(plan), stand, str(folder / "recording"))
    script("fly.py", str(plan), str(folder / "photos"), "--stand", stand, "--yaw-bias", "3",
           "--height-error", "2")  # fmt: skip
    return json.loads(done.stdout)


def script(name, *arguments):
    before = sys.argv
    sys.argv = [name, *arguments]
    try:
        runpy.run_path(str(ROOT / "examples" / "tutorial" / name), run_name="__main__")
    finally:
        sys.argv = before


# The command


@pytest.fixture
def command(command):
    return partial(command, "integrate")


@pytest.mark.slow
def test_one_command_focuses_and_says_what_it_found(command, folder):
    fly(folder, yaw_bias=3.0, height_error=2.0, off_m=0.3)
    status, out, _ = command(
        "photos", "--focus", "auto", "--out", "x.png", "--focus-figure", "curve.png", "--json"
    )
    assert status == 0
    document = json.loads(out)
    Draft202012Validator(json_schema("integral")).validate(document)
    assert document["focal_height_m"] == document["focus"]["ground"]["place"]
    assert len(document["focus"]["heights_m"]) == len(document["focus"]["agreement"])
    with Image.open("curve.png") as curve:
        assert curve.width > 500
    status, out, _ = command("photos", "--focus", "-5..8", "--align", "yaw", "--out", "y.png")
    assert status == 0
    assert "lowest layer found at" in out
    assert "turned by -" in out
    assert "moved" not in out


def test_focus_with_a_single_height_equals_that_focal_height(command, folder):
    paths = recorded(folder)
    command(*paths, "--focus", "2", "--out", "a.png")
    command(*paths, "--focal-height", "2", "--out", "b.png")
    assert (folder / "a.png").read_bytes() == (folder / "b.png").read_bytes()


@pytest.fixture(scope="module")
def recording_paths(tmp_path_factory):
    """The paths of a recording that tests only read."""
    return [str(path) for path in recorded(tmp_path_factory.mktemp("recorded"))]


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["--focus", "x"], "--focus"),
        (["--focus", "1..2..3"], "not a range"),
        (["--focus", "5..1"], "empty"),
        (["--focus", "0..50"], "cameras are only at 40"),
        (["--focus", "0..1e300"], "more than 1e+09 m from the origin"),
        (["--focus", "3", "--focal-height", "2"], "both"),
        (["--focus", "auto", "--align", "x"], "--align 'x'"),
        (["--align", "yaw"], "need --focus"),
        (["--focus", "auto", "--views", "1-3"], "at least 4 photos"),
        (["--focus", "auto", "--focus-figure", "c.txt"], "c.txt"),
    ],
)
def test_wrong_focuses_are_refused(command, folder, recording_paths, arguments, part):
    status, out, err = command(*recording_paths, *arguments, "--out", "x.png")
    assert (status, out) == (2, "")
    assert part in err
    assert not (folder / "x.png").exists()


def test_views_without_detail_have_no_focus(command, folder):
    views = [(nadir_to(0.0), np.array([*site, 40.0])) for site in SITES]
    rng = np.random.default_rng(7)
    images = [rng.integers(0, 255, (120, 160)).astype(np.uint8) for _ in views]
    status, _, err = command(
        *write_recording(folder, views, images), "--focus", "-5..5", "--out", "x.png"
    )
    assert status == 2
    assert "in focus" in err
