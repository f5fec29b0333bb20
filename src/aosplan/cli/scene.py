"""``aosplan scene``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.cli.options import (
    command,
    file_argument,
    flag_option,
    json_option,
    request_options,
    text_option,
)
from aosplan.cli.output import print_json, print_warnings, progress_bar
from aosplan.errors import RequestError
from aosplan.resolve import VOXEL_SUFFIX

if TYPE_CHECKING:
    from aosplan.resolve import ResolvedScene

READING = ("voxel", "ground", "min_height")


def run(
    *,
    scene: str,
    voxel: str | None,
    ground: str | None,
    min_height: str | None,
    save: str | None,
    force: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Show the occluder statistics of a scene, and save them."""
    from aosplan.files import check_output, write_all
    from aosplan.request import request_from
    from aosplan.resolve import scene_of
    from aosplan.scene_file import statistics_document

    if save is not None:
        if not save.lower().endswith((".toml", VOXEL_SUFFIX)):
            raise RequestError(
                f"--save '{save}' does not end in .toml or {VOXEL_SUFFIX}",
                ".toml has the statistics, .npz the voxels as well",
            )
        check_output(save, force=force)
    # A request needs an altitude; the statistics do not depend on it.
    request = request_from(
        {"altitude": 1.0},
        overrides={"scene": scene, "voxel": voxel, "ground": ground, "min_height": min_height},
    )
    with progress_bar(scene, quiet=quiet) as progress:
        resolved = scene_of(request, progress=progress)
    print_warnings(resolved.warnings, quiet=quiet)
    if save is not None:
        write_all({save: _scene_bytes(resolved, save)}, force=force)
    document = statistics_document(
        resolved.scene, resolved.warnings, resolved.volume, with_correlogram=as_json
    )
    if as_json:
        print_json(document)
    elif not quiet:
        from aosplan.cli.tables import print_scene

        print_scene(document)


def _scene_bytes(resolved: ResolvedScene, path: str) -> bytes:
    if not path.lower().endswith(VOXEL_SUFFIX):
        from aosplan.scene_file import scene_toml

        return scene_toml(resolved.scene)
    if resolved.volume is None:
        raise RequestError(f"--save '{path}': this scene has no voxels", "save it as .toml")
    from aosplan.voxel_file import volume_npz

    return volume_npz(resolved.volume)


COMMAND = command(
    "scene",
    run,
    summary="Occluder statistics of a point cloud, a scene file or a preset.",
    examples=("aosplan scene stand.laz --save stand.npz\naosplan scene conifer-forest --json"),
    parameters=[
        file_argument(
            "scene", "Point cloud (.las, .laz), scene file (.toml, .json, .npz), or preset."
        ),
        *request_options(lambda option: option.name in READING),
        text_option(
            "--save",
            "PATH",
            "Write a scene file that plans at once: .toml, or .npz with the voxels.",
            "Output",
        ),
        flag_option("--force", "Overwrite an existing file."),
        flag_option("--quiet", "No table, no warnings."),
        json_option(),
    ],
)
