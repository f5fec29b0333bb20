"""From names and files to things: the camera, the scene and the altitude of a request."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, cast

from aosplan.camera import Camera
from aosplan.errors import RequestError
from aosplan.quantities import nearest_hint
from aosplan.scene import Scene, UniformScene

if TYPE_CHECKING:
    from collections.abc import Callable

    from aosplan.lidar import GroundMethod
    from aosplan.request import PlanRequest
    from aosplan.voxels import VoxelVolume

CLOUD_SUFFIXES = (".las", ".laz")
VOXEL_SUFFIX = ".npz"


class Message(NamedTuple):
    """A warning: a short code for programs, a sentence for people."""

    code: str
    message: str


class ResolvedScene(NamedTuple):
    """A scene, what kind of source it came from, its warnings, and its voxels if it has any."""

    scene: Scene
    kind: str
    warnings: tuple[Message, ...] = ()
    volume: VoxelVolume | None = None


def find_camera(name: str) -> Camera:
    """A camera by its preset's name, or from a file.

    Raises
    ------
    RequestError
        Where there is neither; the hint names the nearest preset.
    """
    from aosplan.presets.cameras import CAMERAS

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
    if _is_file_name(name):
        from aosplan.documents import read_camera

        return read_camera(name)
    raise RequestError(
        f"unknown camera '{name}'",
        nearest_hint(name, CAMERAS) or "aosplan cameras lists them; a file name ends in .toml",
    )


def camera_of(request: PlanRequest, *, folder: str = "") -> Camera:
    """The camera of a request: a preset, a file (looked for in `folder` first), or numbers."""
    if request.camera is not None:
        return find_camera(located(request.camera, folder))
    width, height = request.image_width, request.image_height
    assert width is not None  # the request has checked that a camera is complete
    assert height is not None
    if request.fov is not None:
        return Camera.from_field_of_view(request.fov, width, height)
    assert request.focal_length is not None
    assert request.sensor_width is not None
    sensor_height = request.sensor_height or request.sensor_width * height / width
    return Camera(
        "custom", request.focal_length, request.sensor_width, sensor_height, width, height
    )


def altitude_of(request: PlanRequest, camera: Camera) -> float:
    """Altitude above the focal plane [m], given or solved from the wanted resolution."""
    if request.altitude is not None:
        return request.altitude
    if request.gsd is not None:
        return camera.altitude_for_gsd_m(request.gsd)
    assert request.target_size is not None  # the request has checked that one way is given
    assert request.target_pixels is not None
    return camera.altitude_for_gsd_m(request.target_size / request.target_pixels)


def find_preset_scene(name: str) -> UniformScene | None:
    """A scene by its preset's name, or None."""
    from aosplan.presets.scenes import SCENES

    preset = SCENES.get(name)
    if preset is None:
        return None
    return UniformScene(
        name=name,
        density=None,
        occluder_size_m=preset.occluder_size_m,
        volume_base_m=preset.volume_base_m,
        volume_height_m=preset.volume_height_m,
        given_integrated_density=preset.integrated_density,
        title=preset.title,
        source=preset.source,
        assumed=preset.assumed,
    )


def scene_of(
    request: PlanRequest, *, folder: str = "", progress: Callable[[int, int], None] | None = None
) -> ResolvedScene:
    """The scene of a request: numbers, a preset, a scene file or a point cloud.

    Parameters
    ----------
    request
        The request.
    folder
        Folder of the request file, where its file names are looked for first.
    progress
        Called with points read and points in all, for point clouds.
    """
    if request.scene is None:
        assert request.occluder_size is not None  # the request has checked a uniform scene
        assert request.volume_height is not None
        assert request.volume_base is not None
        scene = UniformScene(
            name="custom",
            density=request.density,
            occluder_size_m=request.occluder_size,
            volume_base_m=request.volume_base,
            volume_height_m=request.volume_height,
            given_integrated_density=request.integrated_density,
        )
        return ResolvedScene(scene, "uniform")
    name = located(request.scene, folder)
    if name.lower().endswith(CLOUD_SUFFIXES):
        return _cloud(request, name, progress)
    voxels = name.lower().endswith(VOXEL_SUFFIX)
    own = () if voxels else ("occluder_size",)
    for option in ("voxel", "ground", "min_height", *own):
        if getattr(request, option) is not None:
            raise RequestError(
                f"--{option.replace('_', '-')} goes with a point cloud, and scene '{request.scene}' "
                "is none"
            )
    preset = find_preset_scene(name)
    if preset is not None:
        return ResolvedScene(preset, "uniform")
    if name.lower().endswith(VOXEL_SUFFIX):
        from aosplan.voxel_file import read_volume

        return _of_volume(read_volume(name), os.path.basename(name), request)
    if _is_file_name(name):
        from aosplan.documents import read_scene

        scene_file = read_scene(name)
        return ResolvedScene(scene_file, scene_file.kind)
    from aosplan.presets.scenes import SCENES

    raise RequestError(
        f"unknown scene '{request.scene}'",
        nearest_hint(request.scene, SCENES)
        or "aosplan scenes lists them; a file name ends in .toml, .json, .npz, .las or .laz",
    )


def _cloud(
    request: PlanRequest, path: str, progress: Callable[[int, int], None] | None
) -> ResolvedScene:
    from aosplan.lidar import read_voxels

    volume = read_voxels(
        path,
        voxel_m=request.voxel or 0.25,
        ground=cast("GroundMethod", request.ground or "auto"),
        min_height_m=2.0 if request.min_height is None else request.min_height,
        progress=progress,
    )
    return _of_volume(volume, os.path.basename(path), request)


def _of_volume(volume: VoxelVolume, name: str, request: PlanRequest) -> ResolvedScene:
    from aosplan.estimate import layered_scene

    scene = layered_scene(volume, name)
    if request.occluder_size is not None:
        scene = replace(scene, voxel_m=request.occluder_size)
    warnings = tuple(Message(*warning) for warning in volume.warnings)
    return ResolvedScene(scene, "cloud", warnings, volume)


def located(name: str, folder: str) -> str:
    """A file name from a request file, looked for beside that file first."""
    beside = os.path.join(folder, name)
    return beside if folder and _is_file_name(name) and os.path.exists(beside) else name


def _is_file_name(name: str) -> bool:
    return os.path.splitext(name)[1] != "" or os.sep in name
