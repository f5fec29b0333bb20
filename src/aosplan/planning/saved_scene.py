"""Saving of scenes and stands as files that are quick to read."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.errors import RequestError
from aosplan.planning.loaded_scene import VOXEL_SUFFIX

if TYPE_CHECKING:
    from aosplan.planning.loaded_scene import LoadedScene
    from aosplan.scenes.correlogram import Correlogram


def check_name(path: str) -> None:
    """Refuse a path whose file cannot contain a scene.

    Raises
    ------
    RequestError
        If the path does not end in ``.toml`` or ``.npz``.
    """
    if not path.lower().endswith((".toml", VOXEL_SUFFIX)):
        raise RequestError(
            f"--save '{path}' does not end in .toml or {VOXEL_SUFFIX}",
            "write .toml for the statistics, or .npz for the statistics and the voxels",
        )


def scene_bytes(loaded: LoadedScene, table: Correlogram | None, path: str) -> bytes:
    """The bytes of a file with a scene and its correlogram.  The extension of the path determines
    the type.

    Raises
    ------
    RequestError
        If `check_name` refuses the path, or if a scene without voxels is saved as ``.npz``.
    """
    check_name(path)
    if not path.lower().endswith(VOXEL_SUFFIX):
        from aosplan.scenes.files.toml_file import scene_toml

        return scene_toml(loaded.scene, table)
    if loaded.volume is None:
        raise RequestError(f"--save '{path}': the scene has no voxels", "save it as .toml")
    from aosplan.scenes.files.voxel_file import VoxelStand, stand_npz
    from aosplan.scenes.scene import LayeredScene

    assert isinstance(loaded.scene, LayeredScene)  # A scene with voxels has layers.
    return stand_npz(VoxelStand(loaded.volume, loaded.scene.layers, table))
