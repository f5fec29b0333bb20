"""Sweeps in Python: a row for each scenario, as columns."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.api.summarized import Summarized
from aosplan.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import polars as pl
    from matplotlib.axes import Axes


class _Frame(NamedTuple):
    frame: pl.DataFrame
    scenarios: int


class Sweep(Summarized, _Frame):
    """The rows of a sweep.

    Attributes
    ----------
    frame
        The rows that were kept, a polars DataFrame: the options that were swept (with their units),
        the results, ``status`` and ``reason``.
    scenarios
        How many scenarios were solved.
    """

    __slots__ = ()

    def columns(self) -> dict[str, list[Any]]:
        """The rows as columns, as pandas and polars take them."""
        found: dict[str, list[Any]] = self.frame.to_dict(as_series=False)
        return found

    def summary(self) -> tuple[str, dict[str, str]]:
        """The headline and the named values, for people."""
        statuses = self.frame.get_column("status").value_counts().sort("status").rows()
        counted = ", ".join(f"{count} {status}" for status, count in statuses)
        headline = f"{self.frame.height} rows of {self.scenarios} scenarios"
        names = self.frame.columns
        shown = ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")
        return headline, {"Status": counted, "Columns": shown}

    def plot(
        self,
        ax: Axes | None = None,
        *,
        x: str | None = None,
        y: str | None = None,
        value: str | None = None,
    ) -> Axes:
        """Draw two results against each other, or a third one as a map over two columns.

        Parameters
        ----------
        ax
            Axes to draw on; a new figure by default.
        x, y
            Columns; ``samples`` and ``flight_time_s`` by default.
        value
            A result to map over x and y.
        """
        from aosplan.show.figures.axes import plotted
        from aosplan.show.figures.draw import KINDS
        from aosplan.show.figures.sweep import frame_of

        found: Axes = plotted(KINDS["sweep"], frame_of(self.frame.lazy(), x, y, value), ax)
        return found


def sweep(
    scenarios: Mapping[str, Any] | str | os.PathLike[str],
    *,
    columns: Sequence[str] | str | None = None,
    where: str | None = None,
    best: str | None = None,
    per: Sequence[str] = (),
    workers: int = 1,
    progress: Callable[[int], None] | None = None,
) -> Sweep:
    """Solve many scenarios.

    The rows are held in memory; ``aosplan sweep --out`` writes results that do not fit there.

    Parameters
    ----------
    scenarios
        Options of `aosplan.plan` by name, each a value, a list of values or a range
        ``{"start": 20, "stop": 120, "count": 50, "spacing": "log"}``, crossed in their order (the
        last one fastest); or a file as ``aosplan sweep`` takes it.
    columns
        Results that the rows have: names, or ``"all"``.
    where
        Keep the rows for which this SQL condition holds: ``"samples <= 100"``.
    best, per
        Keep the row with the most of the column `best` (after a minus: the least), for each
        combination of the values of the columns `per`.
    workers
        Processes that solve.  More than one need a script that guards its entry
        (``if __name__ == "__main__":``), as `multiprocessing` does.
    progress
        Called with the number of scenarios done since the last call.

    Raises
    ------
    RequestError
        If a name, a value or a condition is wrong.
    MissingExtraError
        If polars is not installed.

    Examples
    --------
    >>> import aosplan
    >>> found = aosplan.sweep({"altitude": [30, 40], "vhat": [0.9, 0.98]})
    >>> found.columns()["samples"]
    [10, 50, 10, 50]
    """
    import tempfile

    from aosplan.sweeps.block_frame import chosen_results
    from aosplan.sweeps.run import run
    from aosplan.sweeps.scenarios import crossing_of, polars, read_scenarios
    from aosplan.sweeps.sweep import Sweep as Asked
    from aosplan.sweeps.sweep import check
    from aosplan.units import whole

    if isinstance(scenarios, (str, os.PathLike)):
        path = os.fspath(scenarios)
        swept, folder = read_scenarios(path), os.path.dirname(os.path.abspath(path))
    else:
        swept, folder = crossing_of(scenarios), os.getcwd()
    if per and best is None:
        raise RequestError("per without best", "best='COLUMN' says which row is the best")
    names = columns if columns is None or isinstance(columns, str) else ",".join(columns)
    results = chosen_results(names, finds="find" in swept.names)
    asked = Asked(swept, results, folder, where, best, tuple(per))
    check(asked)
    with tempfile.TemporaryDirectory(prefix="aosplan-") as place:
        out = os.path.join(place, "sweep.parquet")
        run(asked, out, workers=whole(workers, "workers"), progress=progress)
        # A file that is mapped into memory cannot be deleted on Windows.
        frame = polars().read_parquet(out, memory_map=False)
    return Sweep(frame, swept.rows)
