"""The camera that a name or a file stands for."""

from __future__ import annotations

from aosplan.camera.camera import Camera
from aosplan.errors import RequestError
from aosplan.files import is_file_name
from aosplan.units import nearest_hint


def find_camera(name: str) -> Camera:
    """A camera by its preset's name, or from a file.

    Raises
    ------
    RequestError
        Where there is neither; the hint names the nearest preset.
    """
    from aosplan.camera.presets import CAMERAS

    if name in CAMERAS:
        preset = CAMERAS[name]
        return Camera(
            name=name,
            focal_length_mm=preset.focal_length_mm,
            sensor_width_mm=preset.sensor_width_mm,
            sensor_height_mm=preset.sensor_height_mm,
            image_width_px=preset.image_width_px,
            image_height_px=preset.image_height_px,
            title=preset.title,
            source=preset.source,
            assumed=preset.assumed,
        )
    if is_file_name(name):
        from aosplan.camera.camera_file import read_camera

        return read_camera(name)
    raise RequestError(
        f"unknown camera '{name}'",
        nearest_hint(name, CAMERAS) or "aosplan cameras lists them; a file name ends in .toml",
    )
