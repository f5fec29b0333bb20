"""Find a camera by the name of a preset or the path of a file."""

from __future__ import annotations

from aosplan.camera.camera import Camera


def find_camera(name: str, folder: str = "") -> Camera:
    """A camera from a preset, a file, or another installed distribution (``aosplan.cameras``).

    A file is looked for in `folder` first.

    Raises
    ------
    RequestError
        If no preset or file has this name.  The hint gives the most similar preset.
    """
    from aosplan.camera.presets import CAMERAS

    preset = CAMERAS.get(name)
    if preset is None:
        from aosplan.files import is_file_name, located
        from aosplan.plugins import added_preset

        if is_file_name(name):
            from aosplan.camera.camera_file import read_camera

            return read_camera(located(name, folder))
        preset = added_preset("camera", name, CAMERAS)
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
