"""Scenes and stands as files that are quick to read."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.errors import RequestError
from aosplan.planning.loaded_scene import VOXEL_SUFFIX

if TYPE_CHECKING:
    from aosplan.planning.loaded_scene import LoadedScene
    from aosplan.scenes.correlogram import Correlogram


def check_name(path: str) -> None:
    """Refuse a file that cannot hold a scene.

    Raises
    ------
    RequestError
        If the path does not end in ``.toml`` or ``.npz``.
    """
    if not path.lower().endswith((".toml", VOXEL_SUFFIX)):
        raise RequestError(
            f"--save '{path}' does not end in .toml or {VOXEL_SUFFIX}",
            ".toml has the statistics, .npz the voxels as well",
        )


def scene_bytes(loaded: LoadedScene, table: Correlogram | None, path: str) -> bytes:
    """A scene and its correlogram as the file that a path names.

    Raises
    ------
    RequestError
        As `check_name`, or if a scene without voxels is to be saved as ``.npz``.
    """
    check_name(path)
    if not path.lower().endswith(VOXEL_SUFFIX):
        from aosplan.scenes.files.toml_file import scene_toml

        return scene_toml(loaded.scene, table)
    if loaded.volume is None:
        raise RequestError(f"--save '{path}': this scene has no voxels", "save it as .toml")
    from aosplan.scenes.files.voxel_file import VoxelStand, stand_npz
    from aosplan.scenes.scene import LayeredScene

    assert isinstance(loaded.scene, LayeredScene)  # voxels have layers
    return stand_npz(VoxelStand(loaded.volume, loaded.scene.layers, table))
