"""Camera files: intrinsics in TOML or JSON."""

from __future__ import annotations

from aosplan.camera.camera import Camera
from aosplan.files import read_table
from aosplan.validation import Document, Finite, Pixels, checked


class CameraDocument(Document):
    """A camera file."""

    name: str
    focal_length_mm: Finite
    sensor_width_mm: Finite
    sensor_height_mm: Finite
    image_width_px: Pixels
    image_height_px: Pixels
    title: str = ""
    source: str = ""
    assumed: str = ""


def read_camera(path: str) -> Camera:
    """Read a camera from a TOML or JSON file."""
    return Camera(**checked(CameraDocument, read_table(path), path).model_dump())
