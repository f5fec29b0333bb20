"""`Plan`: the values of a plan with the methods that make documents and files of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from aosplan.errors import RequestError
from aosplan.mission.mission import FlightShare, Mission, split
from aosplan.planning.plan_data import PlanData

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aosplan.solver.tradeoff import TradeoffRow


class Plan(PlanData):
    """A plan: what is flown and what it is predicted to show.

    Attributes are those of `aosplan.planning.plan_data.PlanData`.
    """

    def document(self) -> dict[str, Any]:
        """The plan as plain values: what ``plan --json`` prints."""
        from aosplan.planning.document import plan_document

        return plan_document(self)

    def tradeoff(self) -> list[TradeoffRow]:
        """Cost and benefit of each number of samples, for every kind of grid of the request.

        Raises
        ------
        RequestError
            If no occluder is above the focal plane, so that there is no trade-off.
        """
        from aosplan.solver.tradeoff import tradeoff

        if self.inputs.objective == "detection":
            raise RequestError(
                "the trade-off is between samples, aperture and time at a target, not for "
                "--optimize detection",
                "plan --within MIN shows the plans for half and twice the time; tradeoff "
                "--find person has the probability of detection of every row",
            )
        if self.problem is None:
            raise RequestError("no occluder is above the focal plane: one photo shows everything")
        problems = [self.problem._replace(grid=kind) for kind in self.inputs.grids]
        return tradeoff(problems, self.problem, self.solution)

    def tradeoff_document(self, rows: Sequence[TradeoffRow]) -> dict[str, Any]:
        """Rows of `tradeoff` as plain values: what ``tradeoff --json`` prints.

        If the plan looks for a target, rows have its probability of detection; None in rows for
        which it was not counted.
        """
        from aosplan import __version__
        from aosplan.messages import SCHEMA

        documents = [row.document() for row in rows]
        if self.inputs.find is not None:
            from aosplan.planning.plan_detection import detections_of_rows

            asked = [(row.pattern, row.baseline_m, row.front or row.chosen) for row in rows]
            found = detections_of_rows(self.inputs, asked)
            for document, detection in zip(documents, found, strict=True):
                document["detection"] = None if detection is None else detection.probability
        return {
            "schema": SCHEMA,
            "version": __version__,
            "request": self.request.document(),
            "rows": documents,
        }

    def mission(self) -> Mission:
        """The mission that file formats take."""
        document = self.document()
        del document["waypoints"]
        return Mission(self.waypoints, document, self.settings)

    def missions(self) -> tuple[Mission, ...]:
        """A mission for each flight, in order; their waypoints together are the plan's."""
        return split(
            self.mission(),
            [
                FlightShare(flight.first, flight.last, flight.climb_m, flight.return_m)
                for flight in self.route.flights
            ],
        )

    def write(
        self,
        path: str,
        *,
        format: str | None = None,  # noqa: A002 (the option's name)
        force: bool = False,
    ) -> list[str]:
        """Write the waypoints to a file, completely or not at all.

        Parameters
        ----------
        path
            The extension decides the format, or a name before a colon: ``csv:grid.txt``.
        format
            Name of the format, for any extension.
        force
            Whether an existing file is overwritten.

        Returns
        -------
        paths
            The files that were written: `path`, or numbered files if one cannot hold all waypoints.

        Raises
        ------
        RequestError
            If the format is unknown or needs a location, the file exists, or the mission exceeds
            the limits of the program that reads the format.
        SurroundingsError
            If the file cannot be written.
        """
        from aosplan.files import write_all
        from aosplan.mission.export import choose_format, mission_files

        chosen, path = choose_format(str(path), format)
        contents = mission_files(self.missions(), chosen, path)
        write_all(contents, force=force)
        return list(contents)
