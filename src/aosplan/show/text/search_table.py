"""Table that compares a simulated search with the predicted detection."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

from aosplan.models.seen_share import SHARES
from aosplan.show.text.tables import one_line, show

if TYPE_CHECKING:
    from aosplan.simulation.compare_search import SearchComparison


def print_search(found: SearchComparison) -> None:
    """Print predicted and simulated values, and whether they agree."""
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="bold")
    for name in ("", "predicted", "found", "standard error"):
        table.add_column(one_line(name), justify="right" if name else "left", overflow="fold")
    table.add_row(
        one_line("targets found"),
        *_percents(found.predicted, found.simulated, found.standard_error),
    )
    for share, *numbers in zip(
        SHARES, found.seen_predicted, found.seen, found.seen_errors, strict=True
    ):
        table.add_row(one_line(f"at least {share:.0%} seen"), *_percents(*numbers))
    what = (
        f"the cloud with {found.forests} random sets of radiances"
        if found.forest == "cloud"
        else f"{found.forests} {found.forest} forests"
    )
    verdict = "Predicted and simulated agree" if found.agree else "Predicted and simulated disagree"
    show(
        Text(""),
        one_line(
            f"Search of {what}, {found.targets} targets on "
            f"{found.hectares:.2f} ha, seed {found.seed}, at the predicted threshold"
        ),
        Text(""),
        table,
        Text(""),
        one_line(f"{verdict} at the predicted threshold."),
        one_line(
            f"False alarms: {found.false_alarms_per_hectare:.2g} per hectare instead of the "
            f"specified {found.stated_per_hectare:g}.  At the threshold that gives the "
            f"specified rate, {found.simulated_at_rate:.0%} of the targets are found."
        ),
    )


def _percents(*shares: float) -> list[str]:
    return [f"{100.0 * share:.1f} %" for share in shares]
