"""The command ``aosplan cameras``."""

from __future__ import annotations

from aosplan.camera.presets import CAMERAS, find_camera
from aosplan.cli.options import command, json_option
from aosplan.cli.output import print_json


def run(*, as_json: bool) -> None:
    """List the cameras."""
    if as_json:
        print_json([{"name": name, **preset._asdict()} for name, preset in CAMERAS.items()])
        return
    from aosplan.show.text.tables import print_rows

    rows = []
    for name, preset in CAMERAS.items():
        width, height = find_camera(name).fov_deg
        size = f"{preset.image_width_px} x {preset.image_height_px}"
        rows.append((name, preset.band, size, f"{width:.0f} x {height:.0f}"))
    print_rows(("name", "band", "pixels", "field of view [deg]"), rows)
    print("\nSources and assumptions: aosplan cameras --json")


COMMAND = command(
    "cameras",
    run,
    summary="List the built-in cameras.  --json prints all values and their sources.",
    examples="aosplan cameras\naosplan cameras --json",
    parameters=[json_option()],
)
