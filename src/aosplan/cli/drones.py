"""The command ``aosplan drones``."""

from __future__ import annotations

from aosplan.cli.options import command, json_option
from aosplan.cli.output import print_json
from aosplan.flight.drones import DRONES


def run(*, as_json: bool) -> None:
    """List the drones."""
    if as_json:
        print_json([{"name": name, **preset._asdict()} for name, preset in DRONES.items()])
        return
    from aosplan.show.text.tables import one_line, print_rows, show

    rows = [
        (
            name,
            f"{drone.speed_mps:g}",
            f"{drone.airspeed_mps:g}",
            _known(drone.endurance_min),
            _known(drone.photo_interval_s),
            drone.camera or "-",
        )
        for name, drone in DRONES.items()
    ]
    print_rows(("name", "speed", "airspeed", "time", "interval", "camera"), rows)
    show(
        one_line(""),
        one_line(
            "speed: cruise speed [m/s]; airspeed: largest speed through the air [m/s]; time: flight "
            "time in still air [min]; interval: shortest time between photos [s]"
        ),
        one_line("Sources and assumptions: aosplan drones --json"),
    )


def _known(value: float | None) -> str:
    return "-" if value is None else f"{value:g}"


COMMAND = command(
    "drones",
    run,
    summary="List the built-in drones.  --json prints all values and their sources.",
    examples="aosplan drones\naosplan drones --json",
    parameters=[json_option()],
)
