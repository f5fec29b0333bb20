"""What ``aosplan sweep`` says of its outcome: ``--summary`` and ``--simulate``."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from aosplan import __version__
from aosplan.cli.output import print_json, waiting_bar
from aosplan.cli.simulate import read_settings
from aosplan.errors import RequestError
from aosplan.planning.document import SCHEMA
from aosplan.show.text.terminal import say
from aosplan.units import whole

if TYPE_CHECKING:
    from aosplan.simulation.compare import Settings
    from aosplan.sweeps.aggregate import (
        Gather,
        Gathered,
        Gathering,
    )
    from aosplan.sweeps.run import Sweep
    from aosplan.sweeps.scenarios import (
        Crossing,
        Table,
    )
    from aosplan.sweeps.verify import Verification


def drawn_of(simulate: str | None, seed: str | None, precision: str | None) -> Drawn | None:
    """What ``--simulate`` and the options beside it say; None without it."""
    if simulate is None:
        for option, value in (("--seed", seed), ("--precision", precision)):
            if value is not None:
                raise RequestError(
                    f"{option} without --simulate", "--simulate N says of how many rows"
                )
        return None
    from aosplan.simulation.compare import Settings
    from aosplan.sweeps.verify import MOST_ROWS

    rows = whole(simulate, "--simulate")
    if rows > MOST_ROWS:
        raise RequestError(f"--simulate {simulate} is more than {MOST_ROWS} rows")
    return Drawn(rows, read_settings(Settings(), seed, precision))


class Drawn(NamedTuple):
    """How many rows to simulate, and how."""

    rows: int
    settings: Settings


def gather_of(scenarios: Crossing | Table, best: str | None, drawn: Drawn | None) -> Gather:
    """What a sweep is to gather."""
    from aosplan.sweeps.aggregate import Gather
    from aosplan.sweeps.grouping import outline
    from aosplan.sweeps.verify import Drawing

    found = outline(scenarios, best)
    if drawn is None:
        return Gather(found)
    return Gather(found, Drawing(drawn.rows, drawn.settings.seed, found.groups))


def _verified(sweep: Sweep, gathered: Gathered, drawn: Drawn, *, quiet: bool) -> Verification:
    """The rows that were drawn, simulated."""
    from aosplan.sweeps.verify import verify

    assert sweep.gather is not None  # a draw is gathered
    assert sweep.gather.drawing is not None
    with waiting_bar("simulating", quiet=quiet) as progress:
        return verify(
            sweep.scenarios,
            gathered.draw,
            sweep.gather.drawing,
            drawn.settings,
            sweep.folder,
            progress=progress,
        )


def tell(
    sweep: Sweep,
    gathering: Gathering,
    drawn: Drawn | None,
    *,
    summary: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Simulate what was drawn, and print what was gathered: as a document, or as tables."""
    from aosplan.sweeps.summary import summary_document

    assert sweep.gather is not None  # something was gathered
    verification = None
    if drawn is not None:
        try:
            verification = _verified(sweep, gathering.gathered, drawn, quiet=quiet)
        except KeyboardInterrupt:
            if gathering.write():
                say("hint", "--resume goes on with the simulation")
            raise
    gathering.remove()
    document = {
        "schema": SCHEMA,
        "version": __version__,
        "where": sweep.where,
        **summary_document(gathering.gathered.summary, sweep.gather.outline, sweep.scenarios),
        "verification": verification and verification.document(),
    }
    if as_json:
        print_json(document)
    elif not quiet:
        from aosplan.show.text.sweep_tables import (
            print_summary,
            print_verification,
        )

        if summary:
            print_summary(document)
        if verification is not None:
            print_verification(document["verification"])
