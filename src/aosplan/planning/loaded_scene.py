"""The scene of a request.  It is read from a file, found among the presets, or given by numbers."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from aosplan.errors import RequestError
from aosplan.files import is_file_name, is_pattern, located
from aosplan.messages import Message
from aosplan.planning.options import DEFAULTS, GUIDED, READING
from aosplan.scenes.presets import find_preset_scene, scene_hint
from aosplan.scenes.scene import Scene, UniformScene

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from aosplan.planning.request import PlanRequest
    from aosplan.scenes.correlogram import Correlogram
    from aosplan.scenes.files.crop import Crop
    from aosplan.scenes.files.voxel_file import VoxelStand
    from aosplan.scenes.voxels import VoxelVolume

    Progress = Callable[[int, int], None]

CLOUD_SUFFIXES = (".las", ".laz")
VOXEL_SUFFIX = ".npz"
RASTER_SUFFIXES = (".tif", ".tiff")
TABLE_SUFFIX = ".csv"
OPACITY = ("opacity", "leaf_size", "trajectory")
"""Options that determine the source of a point cloud's opacity."""


@dataclass(frozen=True)
class LoadedScene:
    """A scene, the kind of its source, and the other content of the source.

    Attributes
    ----------
    scene
        Uniform or layered.
    kind
        ``uniform``, ``layered`` or ``cloud``.  It determines the default model.
    warnings
        Messages of the reader.
    volume
        The voxels of the scene, if it has voxels.
    correlogram
        The correlogram of the scene, if the source contains it.
    reading
        The options with which the scene was read, including defaults.
    from_cache
        Whether the voxels come from the cache, because the same files have been read before.
    """

    scene: Scene
    kind: str
    warnings: tuple[Message, ...] = ()
    volume: VoxelVolume | None = field(default=None, repr=False, compare=False)
    correlogram: Correlogram | None = field(default=None, repr=False, compare=False)
    reading: Mapping[str, Any] = field(default_factory=dict)
    from_cache: bool = False


def load_scene(
    request: PlanRequest,
    *,
    folder: str = "",
    progress: Progress | None = None,
    also: Iterable[str] = (),
    surroundings: Callable[[], Crop | None] | None = None,
) -> LoadedScene:
    """The scene of a request: numbers, a preset, a scene file or a point cloud.

    Parameters
    ----------
    request
        The request.
    folder
        Folder of the request file, in which file names are looked for first.
    progress
        Function that is called with the number of points read and the total, while a point cloud is
        read.
    also
        More point clouds of the same stand.
    surroundings
        Function that returns the part of a point cloud that the plan needs. It is called if the
        request itself does not give such a part.
    """
    if request.scene is None:
        return _of_numbers(request)
    preset = find_preset_scene(request.scene)
    name = request.scene if preset is not None else located(request.scene, folder)
    suffix = os.path.splitext(name)[1].lower()
    clouds = () if preset is not None else cloud_files(name)
    more = [file for other in also for file in cloud_files(other) or (other,)]
    unexpected = [file for file in (*(() if clouds else (name,)), *more) if not _is_cloud(file)]
    if more and unexpected:
        raise RequestError(
            f"'{unexpected[0]}' is not a point cloud, and several files can be read together "
            "only if all of them are point clouds",
            "give a single scene, or several .las and .laz files",
        )
    if clouds:
        files = (*clouds, *more)
        twice = {file for file in files if files.count(file) > 1}
        if twice:
            raise RequestError(f"point cloud '{min(twice)}' is given twice")
        return _cloud(request, name, files, progress, folder, surroundings)
    if preset is None and suffix in RASTER_SUFFIXES:
        return _raster(request, name)
    _check_unread(request, READING if suffix == VOXEL_SUFFIX else (*READING, "occluder_size"))
    if preset is not None:
        return LoadedScene(preset, "uniform")
    if suffix == VOXEL_SUFFIX:
        from aosplan.scenes.files.voxel_file import read_stand

        return _of_stand(read_stand(name), os.path.basename(name), request)
    if suffix == TABLE_SUFFIX:
        from aosplan.scenes.files.slice_table import read_slices

        return LoadedScene(read_slices(name), "layered")
    if is_file_name(name):
        from aosplan.scenes.files.toml_file import read_scene_file

        file = read_scene_file(name)
        if file.table is None or request.model not in (None, "measured"):
            return LoadedScene(file.scene, file.scene.kind)
        return LoadedScene(file.scene, "cloud", correlogram=file.correlogram())
    raise RequestError(
        f"unknown scene '{request.scene}'",
        scene_hint(request.scene)
        or "aosplan scenes lists the presets; the name of a scene file ends in .toml, .json, "
        ".npz, .csv, .las, .laz or .tif",
    )


def _of_numbers(request: PlanRequest) -> LoadedScene:
    """The scene that the numbers of a request describe."""
    height, base = request.volume_height, request.volume_base
    assert height is not None  # `PlanRequest` has checked that the scene is complete.
    assert base is not None
    if request.stems_per_hectare is not None:
        from aosplan.scenes.inventory import inventory_scene

        assert request.crown_diameter is not None
        assert request.leaf_area_index is not None
        stand = inventory_scene(
            "custom",
            stems_per_hectare=request.stems_per_hectare,
            crown_diameter_m=request.crown_diameter,
            leaf_area_index=request.leaf_area_index,
            volume_base_m=base,
            volume_height_m=height,
            occluder_size_m=request.occluder_size,
        )
        return LoadedScene(stand, "layered")
    assert request.occluder_size is not None
    scene = UniformScene(
        name="custom",
        density=request.density,
        occluder_size_m=request.occluder_size,
        volume_base_m=base,
        volume_height_m=height,
        given_integrated_density=request.integrated_density,
    )
    return LoadedScene(scene, "uniform")


def without_simulated_view(request: PlanRequest) -> PlanRequest:
    """The request without the option ``view``, if only the simulation uses this option.

    The measured model is the only model that has a view.
    """
    cloud = (request.scene or "").lower().endswith((*CLOUD_SUFFIXES, VOXEL_SUFFIX))
    measured = request.model == "measured" or (request.model is None and cloud)
    return request if measured else replace(request, view=None)


def cloud_files(name: str) -> tuple[str, ...]:
    """Sorted files of the point cloud with a given name; empty if the name does not belong to a
    point cloud.

    A name is a file, a folder of tiles, or a pattern such as ``tiles/*.laz``.

    Raises
    ------
    RequestError
        If a folder or a pattern contains no point cloud.
    """
    if os.path.isdir(name):
        found = [os.path.join(name, file) for file in os.listdir(name)]
    elif is_pattern(name):
        import glob

        found = glob.glob(name)
    else:
        return (name,) if _is_cloud(name) else ()
    files = tuple(sorted(file for file in found if _is_cloud(file)))
    if not files:
        raise RequestError(f"'{name}' contains no .las or .laz file", "give the files of one stand")
    return files


def _check_unread(request: PlanRequest, options: Iterable[str]) -> None:
    """Refuse options for the reading of scene files that do not apply to the scene."""
    for option in options:
        if getattr(request, option) is not None:
            kind = "canopy height raster" if option == "crown_base" else "point cloud"
            raise RequestError(
                f"--{option.replace('_', '-')} needs a {kind}, but scene '{request.scene}' "
                "is not one"
            )


def _cloud(
    request: PlanRequest,
    name: str,
    files: tuple[str, ...],
    progress: Progress | None,
    folder: str,
    surroundings: Callable[[], Crop | None] | None,
) -> LoadedScene:
    from aosplan.planning.cloud_crop import asked_crop
    from aosplan.scenes.files import cache

    _check_unread(request, ("crown_base",))
    reading: dict[str, Any] = {
        "voxel": request.voxel,
        "ground": request.ground or DEFAULTS["ground"],
        "min_height": _min_height_m(request),
        "opacity": request.opacity or DEFAULTS["opacity"],
    }
    if request.units is not None:
        reading["units"] = request.units
    if request.crop is not None:
        reading["crop"] = request.crop
        crop = asked_crop(request.crop, folder)
    else:
        crop = surroundings and surroundings()
    if request.opacity == "voxels":
        for option in ("leaf_size", "trajectory"):
            if getattr(request, option) is not None:
                raise RequestError(
                    f"--{option.replace('_', '-')} is only for opacity from pulses, and "
                    "--opacity voxels is given"
                )
    if request.leaf_size is not None:
        reading["leaf_size"] = request.leaf_size
    trajectory = None
    if request.trajectory is not None:
        reading["trajectory"] = request.trajectory
        trajectory = located(request.trajectory, folder)

    halves = request.grid == GUIDED

    def read() -> VoxelVolume:
        from aosplan.scenes.files.point_cloud import read_voxels

        return read_voxels(
            files,
            voxel_m=reading["voxel"],
            ground=reading["ground"],
            min_height_m=reading["min_height"],
            units=request.units,
            opacity=reading["opacity"],
            leaf_size_m=request.leaf_size,
            trajectory=trajectory,
            crop=crop,
            halves=halves,
            progress=progress,
        )

    read_from = files if trajectory is None else (*files, trajectory)
    key = {**reading, "box": crop, **({"halves": True} if halves else {})}
    stand, from_cache = cache.cached_stand(read_from, key, read)
    shown = os.path.basename(os.path.normpath(name))
    loaded = _of_stand(stand, shown, request)
    reading["voxel"] = stand.volume.slice_height_m
    return replace(loaded, reading=reading, from_cache=from_cache)


def _raster(request: PlanRequest, name: str) -> LoadedScene:
    from aosplan.scenes.files.canopy_raster import CROWN_BASE, read_canopy
    from aosplan.scenes.files.voxel_file import VoxelStand

    _check_unread(request, ("ground", "crop", *OPACITY))
    reading = {
        "min_height": _min_height_m(request),
        "crown_base": CROWN_BASE if request.crown_base is None else request.crown_base,
    }
    volume = read_canopy(
        name,
        voxel_m=request.voxel,
        min_height_m=reading["min_height"],
        crown_base=reading["crown_base"],
        units=request.units,
    )
    loaded = _of_stand(VoxelStand.of(volume), os.path.basename(name), request)
    return replace(loaded, reading=reading | {"voxel": volume.voxel_m})


def _min_height_m(request: PlanRequest) -> float:
    """Height below which vegetation is ignored."""
    given = request.min_height
    return float(DEFAULTS["min_height"] if given is None else given)


def _of_stand(stand: VoxelStand, name: str, request: PlanRequest) -> LoadedScene:
    scene = stand.scene(name)
    if request.occluder_size is not None:
        scene = replace(scene, voxel_m=request.occluder_size)
    warnings = tuple(Message(*warning) for warning in stand.volume.warnings) + _of_rim(stand.volume)
    return LoadedScene(scene, "cloud", warnings, stand.volume, stand.correlogram)


def _of_rim(volume: VoxelVolume) -> tuple[Message, ...]:
    """The warning that the rim of a plot is thinner than its middle."""
    from aosplan.scenes.occluder_statistics import thin_rim

    found = thin_rim(volume)
    if found is None:
        return ()
    rim, middle = found
    return (
        Message(
            "thin_rim",
            f"the canopy hides {rim:.0%} of the ground near the edges of the plot and "
            f"{middle:.0%} in its middle, so trees at the edges may have been cut; plans "
            "count only the places whose rays stay on the plot, unless --edges wrapped is "
            "given",
        ),
    )


def _is_cloud(name: str) -> bool:
    return name.lower().endswith(CLOUD_SUFFIXES)
