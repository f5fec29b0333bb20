"""Find a camera by the name of a preset or the path of a file."""

from __future__ import annotations

from aosplan.camera.camera import Camera
from aosplan.errors import RequestError
from aosplan.files import is_file_name
from aosplan.units import preset_hint


def find_camera(name: str) -> Camera:
    """A camera from a preset, a file, or another installed distribution.

    Raises
    ------
    RequestError
        If no preset or file has this name.  The hint gives the most similar preset.
    """
    from aosplan.camera.presets import CAMERAS, CameraPreset

    file = is_file_name(name)
    preset = CAMERAS.get(name)
    if preset is None and not file:
        from aosplan.plugins import plugin

        preset = plugin("aosplan.cameras", name)
    if isinstance(preset, CameraPreset):
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
    if file:
        from aosplan.camera.camera_file import read_camera

        return read_camera(name)
    raise RequestError(
        f"unknown camera '{name}'",
        preset_hint(name, {each: camera.title for each, camera in CAMERAS.items()})
        or "aosplan cameras lists them; a file name ends in .toml",
    )
