"""Built-in cameras have square pixels and agree with the data in their sources."""

import re
from math import atan, degrees, hypot

import pytest

from aosplan.camera.presets import CAMERAS

# Manufacturers round fields of view to a degree, and publish them for images before the correction
# of the lens. If a field of view differs from the preset by a larger share than this, the preset
# mentions the difference.
FIELD_TOLERANCE = 0.02
# This is the largest difference between the calibration of a single camera and the preset of its
# type.
CALIBRATION_TOLERANCE = 0.03


def field_deg(extent_mm, camera):
    return degrees(2 * atan(extent_mm / (2 * camera.focal_length_mm)))


def stated_fields(camera):
    """Fields of view [deg] that the source states, each with the extent [mm] of the sensor for it."""
    width, height = camera.sensor_width_mm, camera.sensor_height_mm
    for angle, axis in re.findall(r"([\d.]+)° (diagonal|horizontal)", camera.source):
        yield float(angle), width if axis == "horizontal" else hypot(width, height)
    for across, down in re.findall(r"([\d.]+)° x ([\d.]+)°", camera.source):
        yield float(across), width
        yield float(down), height


@pytest.mark.parametrize("name", CAMERAS)
def test_pixels_are_square(name):
    camera = CAMERAS[name]
    assert camera.image_width_px >= camera.image_height_px
    pitches = (
        camera.sensor_width_mm / camera.image_width_px,
        camera.sensor_height_mm / camera.image_height_px,
    )
    assert pitches[0] == pytest.approx(pitches[1], rel=6e-3)


@pytest.mark.parametrize("name", CAMERAS)
def test_the_pixel_pitch_in_a_source_is_that_of_the_preset(name):
    camera = CAMERAS[name]
    pitches = set(re.findall(r"([\d.]+) µm", camera.source + camera.assumed))
    for pitch in pitches:
        assert camera.sensor_width_mm == pytest.approx(
            float(pitch) * 1e-3 * camera.image_width_px, rel=1e-4
        )


@pytest.mark.parametrize("name", [n for n, camera in CAMERAS.items() if [*stated_fields(camera)]])
def test_fields_of_view_agree_with_the_makers_or_the_preset_explains_the_difference(name):
    camera = CAMERAS[name]
    for stated, extent_mm in stated_fields(camera):
        off = field_deg(extent_mm, camera) / stated - 1
        # Angles in whole degrees have a rounding error of half a degree.
        rounding = 0.5 / stated if stated == round(stated) else 0.05 / stated
        if abs(off) > FIELD_TOLERANCE + rounding:
            assert f"{stated:g}°" in camera.assumed


def calibrations():
    """Focal lengths in pixels from sources, scaled to the preset's image width."""
    pattern = r"\(([\d.]+) px(?: at (\d+) px image width)?"
    for name, camera in CAMERAS.items():
        for focal_px, width_px in re.findall(pattern, camera.source):
            scale = camera.image_width_px / float(width_px or camera.image_width_px)
            yield pytest.param(name, float(focal_px) * scale, id=f"{name}-{focal_px}")


@pytest.mark.parametrize(("name", "calibrated_px"), [*calibrations()])
def test_the_focal_length_is_that_of_calibrated_cameras(name, calibrated_px):
    camera = CAMERAS[name]
    focal_px = camera.focal_length_mm / camera.sensor_width_mm * camera.image_width_px
    assert focal_px == pytest.approx(calibrated_px, rel=CALIBRATION_TOLERANCE)


def test_focal_lengths_of_presets_equal_those_in_photo_metadata():
    """The focal lengths equal CalibratedFocalLength in the XMP of photos of the two mapping drones."""
    for name, recorded_px in (("dji-phantom-4-pro", 3666.666504), ("dji-m3e-wide", 3725.151611)):
        camera = CAMERAS[name]
        focal_px = camera.focal_length_mm / camera.sensor_width_mm * camera.image_width_px
        assert focal_px == pytest.approx(recorded_px, rel=3e-4)
