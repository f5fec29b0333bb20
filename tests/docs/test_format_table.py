"""The table of drones and formats in the documentation agrees with the files that are written."""

import sys
from pathlib import Path

import pytest

from aosplan.cli.app import run
from aosplan.flight.drones import DRONES

EXTENSIONS = Path(__file__).parents[2] / "docs" / "extensions"


@pytest.fixture(scope="module")
def rows():
    sys.path.insert(0, str(EXTENSIONS))
    try:
        import presets
    finally:
        sys.path.remove(str(EXTENSIONS))
    header, _, *lines = [
        [cell.strip().strip("`") for cell in line.strip("|").split("|")]
        for line in presets.flown().splitlines()
    ]
    return {line[0]: dict(zip(header[1:], line[1:], strict=True)) for line in lines}


def test_the_table_of_formats_has_every_drone(rows):
    assert list(rows) == list(DRONES)


@pytest.mark.parametrize(
    ("drone", "name", "trigger"),
    [
        ("dji-m3t", "kmz", "distance"),
        ("dji-mini-4-pro", "kmz", "stop"),
        ("dji-mini-4-pro", "dji-fly", "stop"),
        ("dji-mini-4-pro", "dji-fly", "distance"),
        ("parrot-anafi-usa", "parrot", "distance"),
        ("px4-multicopter", "waypoints", "stop"),
        ("ardupilot-copter", "waypoints", "distance"),
        ("autel-evo-max-4n", "autel", "stop"),
    ],
)
def test_a_cell_of_the_table_of_formats_agrees_with_the_command(
    rows, drone, name, trigger, tmp_path
):
    camera = [] if DRONES[drone].camera else ["--camera", "flir-vue-pro-640-9mm"]
    command = ["plan", "--altitude", "40", "--origin", "48.3,14.3", "--drone", drone, *camera]
    status = run([*command, "--trigger", trigger, "--out", f"{name}:{tmp_path / 'grid'}"])
    assert (status == 0) == (trigger in rows[drone][name])
    assert ("(unverified)" in rows[drone][name]) == (
        name in DRONES[drone].mission_formats and name not in ("waypoints", "plan")
    )
