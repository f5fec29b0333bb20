"""The command ``aosplan scene``."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from aosplan.cli.options import command, flag_option, json_option, request_options
from aosplan.cli.output import check_distinct, print_json, print_warnings, progress_bar
from aosplan.cli.typer_classes import TyperArgument, TyperOption
from aosplan.errors import RequestError
from aosplan.show.text.terminal import print_notice


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
    from aosplan.planning.saved_scene import check_name, scene_bytes
    from aosplan.scenes.summary import statistics_document

    saved = save or []
    for path in saved:
        check_name(path)
        check_output(path, force=force)
    check_distinct(saved)
    first, more = (scene[0], scene[1:]) if scene else (None, [])
    if first is None and not any(flags.values()):
        raise RequestError("no scene is given", "give a point cloud, a scene file or a preset")
    # A request needs an altitude. The statistics do not depend on it.
    request = request_from({"altitude": 1.0}, overrides={"scene": first, **flags})
    with progress_bar(quiet=quiet) as bar:
        loaded = load_scene(request, progress=bar, also=more)
        table = loaded.correlogram
        if table is None and loaded.volume is not None and (as_json or saved):
            from aosplan.scenes.correlogram import correlogram

            bar.show_step("measuring the correlogram")
            table = correlogram(loaded.volume)
        if table is not None and request.edges == "wrapped":
            table = replace(table, interior=())
    print_warnings(loaded.warnings, quiet=quiet)
    if loaded.from_cache and not quiet:
        print_notice(
            "note",
            "the voxels come from the cache of an earlier run; AOSPLAN_CACHE=0 reads the "
            "file again",
        )
    write_all({path: scene_bytes(loaded, table, path) for path in saved}, force=force)
    document = statistics_document(loaded.scene, loaded.warnings, loaded.volume, table)
    if as_json:
        print_json(document)
    elif not quiet:
        from aosplan.show.text.tables import print_scene

        if loaded.volume is not None and table is None:
            from aosplan.scenes.occluder_statistics import densities_off_nadir

            document["density_by_angle"] = densities_off_nadir(loaded.volume)

        print_scene(document)


COMMAND = command(
    "scene",
    run,
    summary="Print the share of the ground that a forest hides, and the heights of its occluders.",
    examples=("aosplan scene stand.laz --save stand.npz\naosplan scene north.laz south.laz --json"),
    parameters=[
        TyperArgument(
            param_decls=["scene"],
            type=str,
            nargs=-1,
            required=False,
            metavar="[SCENE]...",
            help="Point clouds of one stand (.las, .laz, a folder or a pattern), a canopy height "
            "raster (.tif), a scene file (.toml, .json, .npz, .csv), or a preset.",
        ),
        *request_options(
            lambda option: (
                option.name == "edges" or (option.panel == "Scene" and option.name != "scene")
            )
        ),
        TyperOption(
            param_decls=["--save"],
            type=str,
            multiple=True,
            metavar="PATH",
            help="Save the scene in a file that loads quickly: .toml (statistics) or .npz "
            "(voxels).  Repeatable.",
            rich_help_panel="Output",
        ),
        flag_option("--force", "Overwrite an existing file."),
        flag_option("--quiet", "Print no table and no warnings."),
        json_option(),
    ],
)
