"""The command ``aosplan scenes``."""

from __future__ import annotations

from aosplan.cli.options import command, file_argument, json_option
from aosplan.cli.output import print_json
from aosplan.errors import RequestError
from aosplan.scenes.presets import SCENES, scenes_by_word


def run(*, word: str | None, as_json: bool) -> None:
    """List the scene presets, or those that match a word."""
    found = SCENES
    if word is not None:
        found = {name: SCENES[name] for name in scenes_by_word(word)}
        if not found:
            raise RequestError(
                f"no built-in scene is of the species or type '{word}'",
                "aosplan scenes lists all scenes",
            )
    if as_json:
        print_json([{"name": name, **preset._asdict()} for name, preset in found.items()])
        return
    from aosplan.show.text.tables import print_rows

    rows = [
        (
            name,
            preset.title,
            f"{100.0 * preset.integrated_density:.0f} %",
            f"{preset.volume_base_m:.1f} to {preset.volume_base_m + preset.volume_height_m:.1f}",
            f"{preset.occluder_size_m:.2f}",
        )
        for name, preset in found.items()
    ]
    print_rows(("name", "stand", "p", "heights [m]", "o [m]"), rows)
    print("\nSources and assumptions: aosplan scenes --json")


COMMAND = command(
    "scenes",
    run,
    summary="List the built-in scenes.  --json prints their sources and assumptions as well.",
    examples="aosplan scenes\naosplan scenes spruce --json",
    parameters=[
        file_argument(
            "word",
            "List only scenes of this species or type of forest, such as spruce, oak or winter.",
            required=False,
        ),
        json_option(),
    ],
)
