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
    """A scenario by its index; `request` has the options of `aosplan plan` that solve it again."""

    row: Row
    request: dict[str, Any]


class ExtremeDocument(ScenarioDocument):
    """The smallest or largest value of a result, and the first scenario that has it."""

    value: int | Finite


class ResultDocument(OpenDocument):
    """A result over the kept rows with a plan; the mean is correctly rounded."""

    count: int
    mean: Finite | None
    minimum: ExtremeDocument | None
    maximum: ExtremeDocument | None


class FirstDocument(ScenarioDocument):
    """The first scenario with a kind of reason, with the full text of the reason."""

    reason: str


class ReasonDocument(OpenDocument):
    """Why scenarios have no plan: one sentence, with # instead of its numbers."""

    status: Literal["infeasible", "invalid"]
    reason: str
    count: int
    first: FirstDocument


class GroupDocument(OpenDocument):
    """Scenarios with one `value` of an input, with numbers from `first` to `last`, or all others.

    `rows` is the number of kept rows, `met` the number of those with a plan, and `met_share` the
    share of these.
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
    """The result whose best values are shown for each input, and the error of its medians."""

    column: str
    best: Literal["least", "most"]
    median_error: Finite


class StatusesDocument(OpenDocument):
    """Numbers of scenarios with a plan, without one that meets the target, and with a wrong
    request.
    """

    ok: int
    infeasible: int
    invalid: int


class ComparisonsDocument(OpenDocument):
    """A quantity: simulated minus predicted value.

    `beyond` is the difference in excess of the experiment's systematic error, in standard errors.
    `chance` is the probability of such a difference or a larger one.  Null if there is no
    variation.
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
    """The least probable comparison; `chance_of_worst` is its probability among all (Šidák)."""

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

    If all rows agree, the worst comparison exceeds `expected_worst` standard errors with
    probability one half, and `critical` with probability `level`.  Rows are reported to agree if
    its probability is at least `level`.
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
