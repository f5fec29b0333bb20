"""The JSON document that `aosplan sweep --json` prints, for its schema."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from aosplan.simulation.simulation_schema import (
    PredictedDocument,
    SimulatedDocument,
    ToleranceDocument,
)
from aosplan.validation import Finite, OpenDocument

Row = Annotated[int, Field(ge=1)]
"""Place of a scenario in the sweep, from 1."""

Share = Annotated[float, Field(ge=0.0, le=1.0)]


class ScenarioDocument(OpenDocument):
    """A scenario by its place; `request` is what `aosplan plan` takes to solve it again."""

    row: Row
    request: dict[str, Any]


class ExtremeDocument(ScenarioDocument):
    """The least or the most of a result, and the first scenario that has it."""

    value: int | Finite


class ResultDocument(OpenDocument):
    """A result over the rows that are met and kept; the mean is correctly rounded."""

    count: int
    mean: Finite | None
    minimum: ExtremeDocument | None
    maximum: ExtremeDocument | None


class FirstDocument(ScenarioDocument):
    """The first scenario with a kind of reason, and its own words."""

    reason: str


class ReasonDocument(OpenDocument):
    """Why scenarios are not met: one sentence, # for its numbers."""

    status: Literal["infeasible", "invalid"]
    reason: str
    count: int
    first: FirstDocument


class GroupDocument(OpenDocument):
    """Scenarios with one `value` of an input, with numbers from `first` to `last`, or the others.

    `rows` are those of the `scenarios` that are kept, `met` those of them with a plan, `met_share`
    their share.
    """

    value: Any = None
    first: int | Finite | None = None
    last: int | Finite | None = None
    others: bool = False
    scenarios: int
    rows: int
    met: int
    met_share: Share | None
    best: int | Finite | None
    approximate_median: int | Finite | None


class InputDocument(OpenDocument):
    """An input with several values."""

    name: str
    groups: list[GroupDocument]


class ObjectiveDocument(OpenDocument):
    """The result of which each input's best values are shown, and how near medians are to it."""

    column: str
    best: Literal["least", "most"]
    median_error: Finite


class StatusesDocument(OpenDocument):
    """How many of all scenarios have a plan, none that meets the target, or a wrong request."""

    ok: int
    infeasible: int
    invalid: int


class ComparisonsDocument(OpenDocument):
    """A quantity as simulated less as predicted.

    `beyond` are the standard errors by which they differ more than the experiment's own error;
    `chance` is that of as many.  Null where nothing scatters.
    """

    quantity: Literal["density", "expected", "normalized"]
    difference: Finite
    standard_errors: Finite | None
    beyond: Finite | None
    chance: Share


class PlacedComparisonDocument(ComparisonsDocument):
    """The same, of a row."""

    row: Row


class WorstDocument(PlacedComparisonDocument):
    """The comparison that chance explains least; `chance_of_worst` is Šidák's, of them all."""

    chance_of_worst: Share


class CheckedRowDocument(ScenarioDocument):
    """A row beside its simulation, or the reason why there is none."""

    strata: list[str]
    seed: int
    reason: str | None
    samples: int | None = None
    predicted: PredictedDocument | None = None
    simulated: SimulatedDocument | None = None
    tolerance: ToleranceDocument | None = None
    forest: str | None = None
    view: Literal["telecentric", "perspective"] | None = None
    precise: bool | None = None
    volumes: int | None = None
    targets: int | None = None
    comparisons: list[ComparisonsDocument] | None = None


class VerificationDocument(OpenDocument):
    """A sample of rows beside their simulations.

    If all agree, the worst comparison exceeds `expected_worst` standard errors by even chances,
    and `critical` with the chance `level`; they agree where its chance is not below that.
    """

    seed: int
    precision: Finite
    level: Share
    agree: bool | None
    simulated: int
    comparisons: int
    expected_worst: Finite | None
    critical: Finite | None
    worst: WorstDocument | None
    largest_difference: PlacedComparisonDocument | None
    strata_left_out: list[str]
    rows: list[CheckedRowDocument]


class SweepDocument(OpenDocument):
    """What `aosplan sweep --json` prints.

    `statuses` and `reasons` are of all scenarios, `results` and `inputs` of the rows that `where`
    keeps; `fixed` inputs have one value.
    """

    schema_: Literal[1] = Field(alias="schema")
    version: str
    where: str | None
    scenarios: int
    rows: int
    statuses: StatusesDocument
    reasons: list[ReasonDocument]
    other_reasons: int
    results: dict[str, ResultDocument]
    objective: ObjectiveDocument
    inputs: list[InputDocument]
    fixed: dict[str, Any]
    verification: VerificationDocument | None
