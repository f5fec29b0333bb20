"""Sweeps whose rows are kept in memory: `sweep`."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, NamedTuple, overload

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
        The rows as a polars DataFrame: the swept options (with their units), the results,
        ``status`` and ``reason``.
    scenarios
        Number of scenarios that were solved.
    """

    __slots__ = ()

    def columns(self) -> dict[str, list[Any]]:
        """The rows as columns, which pandas and polars accept."""
        found: dict[str, list[Any]] = self.frame.to_dict(as_series=False)
        return found

    def summary(self) -> tuple[str, dict[str, str]]:
        """The result as text: a headline and named values."""
        statuses = self.frame.get_column("status").value_counts().sort("status").rows()
        counted = ", ".join(f"{count} {status}" for status, count in statuses)
        headline = f"{self.frame.height} rows of {self.scenarios} scenarios"
        names = self.frame.columns
        shown = ", ".join(names[:6]) + (f" and {len(names) - 6} more" if len(names) > 6 else "")
        return headline, {"Status": counted, "Columns": shown}

    @overload
    def plot(
        self,
        ax: Axes | None = None,
        *,
        x: str | None = None,
        y: str | None = None,
        value: None = None,
        by: str | None = None,
    ) -> Axes: ...

    @overload
    def plot(
        self, ax: Axes | None = None, *, x: str, y: str, value: str, by: None = None
    ) -> Axes: ...

    @overload
    def plot(self, ax: None = None, *, x: str, y: str, value: str, by: str) -> Any: ...

    def plot(
        self,
        ax: Axes | None = None,
        *,
        x: str | None = None,
        y: str | None = None,
        value: str | None = None,
        by: str | None = None,
    ) -> Any:
        """Draw one column against another, or draw a third column as a map over two columns.

        Parameters
        ----------
        ax
            Axes to draw on; a new figure by default.
        x, y
            Columns for the two axes; ``samples`` and ``flight_time_s`` by default.
        value
            A result that is drawn as a map over x and y.
        by
            A column that colours the points, or that has a map for each of its values.

        Returns
        -------
        ax
            The axes; an array of them for several maps.
        """
        from aosplan.show.figures.axes import plotted
        from aosplan.show.figures.draw import KINDS
        from aosplan.show.figures.sweep_columns import ColumnChoice
        from aosplan.show.figures.sweep_results import frame_of

        shown = frame_of(self.frame.lazy(), ColumnChoice(x, y, value, by))
        return plotted(KINDS["sweep"], shown, ax)


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

    The rows are kept in memory.  Use ``aosplan sweep --out`` for results that do not fit into
    memory.

    Parameters
    ----------
    scenarios
        Options of `aosplan.plan` by name, or the path of a scenario file for ``aosplan sweep``.
        Each option has a value, a list of values or a range ``{"start": 20, "stop": 120, "count":
        50, "spacing": "log"}``.  All combinations are solved.  The last option varies fastest.
    columns
        Results to compute: names, or ``"all"``.
    where
        An SQL condition that selects the rows to keep: ``"samples <= 100"``.
    best, per
        For each combination of values in the columns `per`, keep only the row with the largest
        value in the column `best`. If `best` begins with a minus, the row with the smallest value
        is kept.
    workers
        Number of processes. If it is greater than 1, `multiprocessing` is used, and the script
        needs a guarded entry point (``if __name__ == "__main__":``).
    progress
        Function that is called with the number of scenarios that have been solved since its last
        call.

    Raises
    ------
    RequestError
        If a name, a value or a condition is not valid.
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

    from aosplan.sweeps.run import run
    from aosplan.sweeps.scenarios import crossing_of, polars, read_scenarios
    from aosplan.sweeps.solve_block import chosen_results
    from aosplan.sweeps.sweep import Sweep as SweepRequest
    from aosplan.sweeps.sweep import check
    from aosplan.units import whole

    if isinstance(scenarios, (str, os.PathLike)):
        path = os.fspath(scenarios)
        swept, folder = read_scenarios(path), os.path.dirname(os.path.abspath(path))
    else:
        swept, folder = crossing_of(scenarios), os.getcwd()
    if per and best is None:
        raise RequestError(
            "per needs best",
            "give best='COLUMN', the column that decides which row is kept",
        )
    names = columns if columns is None or isinstance(columns, str) else ",".join(columns)
    results = chosen_results(names, finds="find" in swept.names)
    asked = SweepRequest(swept, results, folder, where, best, tuple(per))
    check(asked)
    with tempfile.TemporaryDirectory(prefix="aosplan-") as place:
        out = os.path.join(place, "sweep.parquet")
        run(asked, out, workers=whole(workers, "workers"), progress=progress)
        # Windows cannot delete a file that is mapped into memory.
        frame = polars().read_parquet(out, memory_map=False)
    return Sweep(frame, swept.rows)
