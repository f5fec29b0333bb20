"""``aosplan scene``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from typer.core import TyperArgument, TyperOption

from aosplan.cli.options import command, flag_option, json_option, request_options
from aosplan.cli.output import check_apart, print_json, print_warnings, progress_bar
from aosplan.errors import RequestError
from aosplan.planning.loaded_scene import VOXEL_SUFFIX
from aosplan.show.text.terminal import print_notice

if TYPE_CHECKING:
    from aosplan.planning.loaded_scene import LoadedScene
    from aosplan.scenes.correlogram import Correlogram


def run(
    *,
    scene: list[str] | None,
    save: list[str] | None,
    force: bool,
    quiet: bool,
    as_json: bool,
    **flags: Any,
) -> None:
    """Show the occluder statistics of a scene, and save them."""
    from aosplan.files import check_output, write_all
    from aosplan.planning.loaded_scene import load_scene
    from aosplan.planning.request import request_from
    from aosplan.scenes.summary import statistics_document

    saved = save or []
    for path in saved:
        if not path.lower().endswith((".toml", VOXEL_SUFFIX)):
            raise RequestError(
                f"--save '{path}' does not end in .toml or {VOXEL_SUFFIX}",
                ".toml has the statistics, .npz the voxels as well",
            )
        check_output(path, force=force)
    check_apart(saved)
    first, more = (scene[0], scene[1:]) if scene else (None, [])
    if first is None and not any(flags.values()):
        raise RequestError("no scene is given", "name a point cloud, a scene file or a preset")
    # A request needs an altitude; the statistics do not depend on it.
    request = request_from({"altitude": 1.0}, overrides={"scene": first, **flags})
    with progress_bar(quiet=quiet) as bar:
        loaded = load_scene(request, progress=bar, also=more)
    print_warnings(loaded.warnings, quiet=quiet)
    if loaded.from_cache and not quiet:
        print_notice("note", "read earlier, taken from the cache (AOSPLAN_CACHE=0: read anew)")
    table = loaded.correlogram
    if table is None and loaded.volume is not None and (as_json or saved):
        from aosplan.scenes.correlogram import correlogram

        table = correlogram(loaded.volume)
    write_all({path: _scene_bytes(loaded, table, path) for path in saved}, force=force)
    document = statistics_document(loaded.scene, loaded.warnings, loaded.volume, table)
    if as_json:
        print_json(document)
    elif not quiet:
        from aosplan.show.text.tables import print_scene

        if loaded.volume is not None and table is None:
            from aosplan.scenes.occluder_statistics import densities_off_nadir

            document["density_by_angle"] = densities_off_nadir(loaded.volume)

        print_scene(document)


def _scene_bytes(loaded: LoadedScene, table: Correlogram | None, path: str) -> bytes:
    if not path.lower().endswith(VOXEL_SUFFIX):
        from aosplan.scenes.files.toml_file import scene_toml

        return scene_toml(loaded.scene, table)
    if loaded.volume is None:
        raise RequestError(f"--save '{path}': this scene has no voxels", "save it as .toml")
    from aosplan.scenes.files.voxel_file import Stand, stand_npz
    from aosplan.scenes.scene import LayeredScene

    assert isinstance(loaded.scene, LayeredScene)  # voxels have layers
    return stand_npz(Stand(loaded.volume, loaded.scene.layers, table))


COMMAND = command(
    "scene",
    run,
    summary="Occluder statistics of a point cloud, a scene file or a preset.",
    examples=("aosplan scene stand.laz --save stand.npz\naosplan scene north.laz south.laz --json"),
    parameters=[
        TyperArgument(
            param_decls=["scene"],
            type=str,
            nargs=-1,
            required=False,
            metavar="[SCENE]...",
            help="Point clouds (.las, .laz, a folder, a pattern) of one stand; a height raster "
            "(.tif); a scene file (.toml, .json, .npz, .csv); or a preset.",
        ),
        *request_options(lambda option: option.panel == "Scene" and option.name != "scene"),
        TyperOption(
            param_decls=["--save"],
            type=str,
            multiple=True,
            metavar="PATH",
            help="Write a scene file that plans at once: .toml, or .npz with the voxels.  "
            "Repeatable.",
            rich_help_panel="Output",
        ),
        flag_option("--force", "Overwrite an existing file."),
        flag_option("--quiet", "No table, no warnings."),
        json_option(),
    ],
)
