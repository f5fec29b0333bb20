"""Schema of the JSON document that `aosplan sweep --json` prints."""

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
"""Index of a scenario in the sweep, from 1."""

Share = Annotated[float, Field(ge=0.0, le=1.0)]


class ScenarioDocument(OpenDocument):
    """A scenario with its index.  `request` has the options with which `aosplan plan` solves it
    again.
    """

    row: Row
    request: dict[str, Any]


class ExtremeDocument(ScenarioDocument):
    """The smallest or largest value of a result, and the first scenario that has it."""

    value: int | Finite


class ResultDocument(OpenDocument):
    """Summary of a result over the kept rows with a plan.  The mean is correctly rounded."""

    count: int
    mean: Finite | None
    minimum: ExtremeDocument | None
    maximum: ExtremeDocument | None


class FirstDocument(ScenarioDocument):
    """The first scenario with a kind of reason, with the full text of the reason."""

    reason: str


class ReasonDocument(OpenDocument):
    """A kind of reason why scenarios have no plan: a sentence with # in place of its numbers."""

    status: Literal["infeasible", "invalid"]
    reason: str
    count: int
    first: FirstDocument


class GroupDocument(OpenDocument):
    """Summary of the scenarios with one `value` of an input, with numbers from `first` to `last`,
    or with all other values.

    `rows` is the number of kept rows. `met` is the number of kept rows with a plan, and `met_share`
    is `met` divided by `rows`.
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
    """The result whose best values are given for each input, and the error of its medians."""

    column: str
    best: Literal["least", "most"]
    median_error: Finite


class StatusesDocument(OpenDocument):
    """Numbers of scenarios with a plan (`ok`), without a plan that meets the target (`infeasible`),
    and with a request that is not valid (`invalid`).
    """

    ok: int
    infeasible: int
    invalid: int


class ComparisonsDocument(OpenDocument):
    """Simulated minus predicted value of a quantity.

    `beyond` is the difference minus the systematic error of the experiment, in standard errors.
    `chance` is the probability of at least such a difference.  They are null if the samples do not
    vary.
    """

    quantity: Literal["density", "expected", "normalized"]
    difference: Finite
    standard_errors: Finite | None
    beyond: Finite | None
    chance: Share


class PlacedComparisonDocument(ComparisonsDocument):
    """A comparison for one row."""

    row: Row


class WorstDocument(PlacedComparisonDocument):
    """The least probable comparison.  `chance_of_worst` is the probability that the worst of all
    comparisons is at least this improbable (Šidák).
    """

    chance_of_worst: Share


class CheckedRowDocument(ScenarioDocument):
    """A row with its simulation, or the reason why it was not simulated."""

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
    """A sample of rows with their simulations.

    Suppose that the predictions and simulations of all rows agree. Then the worst comparison
    exceeds `expected_worst` standard errors with probability 1/2, and `critical` standard errors
    with probability `level`. The rows are said to agree if the probability of the worst comparison
    is at least `level`.
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
    """The document that `aosplan sweep --json` prints.

    `statuses` and `reasons` are for all scenarios; `results` and `inputs` are for the rows that
    meet `where`.  `fixed` inputs have a single value.
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
