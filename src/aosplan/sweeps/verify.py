"""Verification of a sweep: a sample of its rows is simulated.

**Sample.**  The sample is drawn while the sweep runs, from the kept rows with a plan. For each input with several values, it has a row with the smallest value, a row with the largest value, and a row for each text value. The remaining rows are chosen at random. Each row has a random priority that depends only on its index and the seed. The sample therefore depends only on the sweep and the seed.

**Test.** The test uses the worst of all comparisons. With many comparisons, the worst one may be
large by chance. A comparison is the difference between a prediction and its simulation, minus the
systematic error of the experiment, divided by the standard error. The chance of a comparison is the
probability of a value that is at least as large, by Student's distribution. The distribution has
one degree of freedom less than the experiment has samples. The chance of the worst of n comparisons
is the probability that at least one of them has such a small chance: 1 - (1 - chance)ⁿ (Šidák 1967;
an upper bound if comparisons depend on each other). The rows disagree if the chance of the worst
comparison is below `LEVEL`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from aosplan.errors import AosplanError
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.sweeps.grouping import scenario
from aosplan.sweeps.solve_rows import scene_for

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    import polars as pl
    from numpy.typing import NDArray

    from aosplan.planning.result import Plan
    from aosplan.scenes.occlusion import ViewKind
    from aosplan.simulation.compare import Settings, Simulation
    from aosplan.sweeps.block import Block
    from aosplan.sweeps.grouping import InputGroups
    from aosplan.sweeps.scenarios import ScenarioProduct, ScenarioTable

ROWS = 20
"""Default number of rows of a sample."""

MOST_ROWS = 10_000
"""Largest number of rows that is simulated."""

LEVEL = 0.01
"""If the chance of the worst comparison is smaller than this, the rows disagree."""

LARGEST_SEED = 2**63 - 1

Drawn = tuple[float, int, int]
"""A row of a sample: distance from the extreme, priority, and index in the sweep."""


class SamplingPlan(NamedTuple):
    """Number of rows to draw, the random seed, and the inputs whose extremes are included."""

    rows: int
    seed: int
    groups: tuple[InputGroups, ...]


class RowSample(NamedTuple):
    """Rows that were drawn from some scenarios: random rows, and the row nearest to the extreme of
    each stratum.
    """

    random: tuple[tuple[int, int], ...] = ()
    strata: Mapping[str, Drawn] = {}

    def joined(self, other: RowSample, *, rows: int) -> RowSample:
        """The rows that are drawn from the scenarios of both samples."""
        strata = dict(self.strata)
        for name, drawn in other.strata.items():
            strata[name] = min(drawn, strata.get(name, drawn))
        return RowSample(tuple(sorted({*self.random, *other.random})[:rows]), strata)

    def state(self) -> list[Any]:
        """The rows as plain values, to be stored in a file."""
        return [self.random, self.strata]

    @classmethod
    def of_state(cls, state: list[Any]) -> RowSample:
        """The inverse of `state`."""
        random, strata = state
        return cls(tuple(map(tuple, random)), {name: tuple(each) for name, each in strata.items()})


def draw_rows(
    drawing: SamplingPlan, block: Block, frame: pl.DataFrame, kept: NDArray[np.intp]
) -> RowSample:
    """Draw rows from one block.  `frame` has one row per scenario of the block."""
    status = frame.get_column("status").to_physical().to_numpy()
    met = kept[status[kept] == 0]
    if not len(met):
        return RowSample()
    priorities = priorities_of(block.start + met, drawing.seed)
    first = np.argpartition(priorities, min(drawing.rows, len(met)) - 1)[: drawing.rows]
    random = sorted(
        zip(priorities[first].tolist(), (block.start + met[first]).tolist(), strict=True)
    )
    strata: dict[str, Drawn] = {}
    for groups in drawing.groups:
        column = block.columns[groups.name]
        values = np.broadcast_to(column, block.shape).reshape(-1)[met]
        for name, far in zip(strata_of([groups]), _strata(groups, values), strict=True):
            if not np.isfinite(far).any():
                continue
            nearest = np.flatnonzero(far == far.min())
            chosen = nearest[priorities[nearest].argmin()]
            place = block.start + int(met[chosen])
            strata[name] = far[chosen].item(), int(priorities[chosen]), place
    return RowSample(tuple(random), strata)


def strata_of(groups: Iterable[InputGroups]) -> list[str]:
    """Names of the strata of inputs, in order."""
    return [
        f"{each.name} {name}"
        for each in groups
        for name in (
            *(("least", "most") if each.numbers else ()),
            *("left out" if word is None else str(word) for word in each.words),
        )
    ]


def _strata(groups: InputGroups, values: NDArray[Any]) -> Iterator[NDArray[np.float64]]:
    """Distance of each row from each stratum of an input.  It is infinite if the value has another
    type.
    """
    places = groups.places(values)
    if groups.numbers:
        numbers = places < len(groups.numbers)
        found = np.full(len(values), math.inf)
        found[numbers] = values[numbers].astype(np.float64)
        yield found
        yield np.where(numbers, -found, math.inf)
    for place in range(len(groups.numbers), groups.size - 1):
        yield np.where(places == place, 0.0, math.inf)


def priorities_of(rows: NDArray[np.int64], seed: int) -> NDArray[np.int64]:
    """Random numbers from 0 to 2⁶³ - 1.  They depend only on the row of a sweep and the seed.

    Notes
    -----
    The finalizer of SplitMix64 is applied twice: Steele, Lea and Flood, "Fast splittable
    pseudorandom number generators", OOPSLA 2014.
    """
    mixed = _mix(np.array([seed], dtype=np.uint64)) + rows.astype(np.uint64)
    return (_mix(_mix(mixed)) >> np.uint64(1)).astype(np.int64)


def _mix(z: NDArray[np.uint64]) -> NDArray[np.uint64]:
    z = z + np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


class SampledRow(NamedTuple):
    """A row to simulate, and the strata for which it was drawn.  There are no strata if it was
    drawn at random.
    """

    row: int
    strata: tuple[str, ...]


def sample(draw: RowSample, drawing: SamplingPlan) -> list[SampledRow]:
    """The drawn rows in order: first one row for each stratum, then random rows."""
    rows = drawing.rows
    chosen: dict[int, list[str]] = {}
    for name in filter(draw.strata.__contains__, strata_of(drawing.groups)):
        row = draw.strata[name][-1]
        if row in chosen or len(chosen) < rows:
            chosen.setdefault(row, []).append(name)
    for _, row in draw.random:
        if len(chosen) < rows:
            chosen.setdefault(row, [])
    return [SampledRow(row, tuple(names)) for row, names in sorted(chosen.items())]


class Comparison(NamedTuple):
    """Comparison of one prediction with its simulation.

    `beyond` is the difference minus the systematic error of the experiment, in standard errors.
    `chance` is the probability of at least such a difference.
    """

    row: int
    quantity: str
    difference: float
    standard_errors: float
    beyond: float
    chance: float


class Check(NamedTuple):
    """The simulation of a row, or the reason why it was not simulated."""

    chosen: SampledRow
    request: dict[str, Any]
    seed: int
    simulation: Simulation | None
    reason: str

    def comparisons(self) -> Iterator[Comparison]:
        """Comparisons of all quantities that the simulation can estimate."""
        if self.simulation is None:
            return
        from aosplan.simulation.compare import QUANTITIES

        predicted, found = self.simulation.predicted, self.simulation.simulated
        for name in QUANTITIES:
            value, error = getattr(found, name), getattr(found, f"{name}_standard_error")
            if not (math.isfinite(value) and math.isfinite(error)):
                continue
            difference = value - float(getattr(predicted, name))
            # Differences that are caused by rounding and by voxels are subtracted.
            excess = max(abs(difference) - self.simulation.tolerance[name] - 1e-9, 0.0)
            if error == 0.0 and excess == 0.0:
                continue  # Nothing is hidden, or everything is hidden.
            beyond = excess / error if error else math.inf
            yield Comparison(
                self.chosen.row,
                name,
                difference,
                abs(difference) / error if error else math.inf,
                beyond,
                chance_of(beyond, self.simulation.samples),
            )


def chance_of(standard_errors: float, samples: int) -> float:
    """Two-sided probability of a difference in standard errors, by Student's distribution."""
    from scipy.special import stdtr

    return 2.0 * float(stdtr(max(samples - 1, 1), -standard_errors))


def chance_of_worst(chance: float, comparisons: int) -> float:
    """Probability that the smallest chance of several independent comparisons is at most `chance`."""
    if chance >= 1.0:
        return 1.0
    return -math.expm1(comparisons * math.log1p(-chance))


def worst_expected(comparisons: int, chance: float = 0.5) -> float:
    """Number of standard errors that the worst of several comparisons exceeds with a given
    probability, if all predictions are correct.

    Parameters
    ----------
    comparisons
        Number of comparisons, at least one.
    chance
        Probability.  The default of 1/2 gives the median of the worst comparison.
    """
    from statistics import NormalDist

    single = -math.expm1(math.log1p(-chance) / comparisons)
    return -NormalDist().inv_cdf(single / 2.0)


class Verification(NamedTuple):
    """A sample of rows with their simulations, and rows that could not be simulated."""

    seed: int
    precision: float
    checks: tuple[Check, ...]
    left_out: tuple[str, ...]

    @property
    def comparisons(self) -> list[Comparison]:
        """Comparisons of all rows, in order."""
        return [each for check in self.checks for each in check.comparisons()]

    @property
    def worst(self) -> Comparison | None:
        """The comparison whose difference is least probable by chance."""
        return min(
            self.comparisons, key=lambda each: (each.chance, -each.standard_errors), default=None
        )

    @property
    def agree(self) -> bool | None:
        """Whether the worst comparison can be explained by chance; None without comparisons."""
        worst = self.worst
        return worst and chance_of_worst(worst.chance, len(self.comparisons)) >= LEVEL

    def document(self) -> dict[str, Any]:
        """The verification as plain values, with rows counted from 1 and described by their inputs."""
        found, worst = self.comparisons, self.worst
        largest = max(found, key=lambda each: abs(each.difference), default=None)
        return {
            "seed": self.seed,
            "precision": self.precision,
            "level": LEVEL,
            "agree": self.agree,
            "simulated": sum(check.simulation is not None for check in self.checks),
            "comparisons": len(found),
            "expected_worst": worst_expected(len(found)) if found else None,
            "critical": worst_expected(len(found), LEVEL) if found else None,
            "worst": worst
            and _comparison(worst) | {"chance_of_worst": chance_of_worst(worst.chance, len(found))},
            "largest_difference": largest and _comparison(largest),
            "strata_left_out": list(self.left_out),
            "rows": [_row(check) for check in self.checks],
        }


def _comparison(found: Comparison) -> dict[str, Any]:
    values = found._asdict() | {"row": found.row + 1}
    return {
        # If the samples do not vary, there is no standard error.
        name: None if value == math.inf else value
        for name, value in values.items()
    }


def _row(check: Check) -> dict[str, Any]:
    shared = {
        "row": check.chosen.row + 1,
        "request": check.request,
        "strata": list(check.chosen.strata),
        "seed": check.seed,
        "reason": check.reason or None,
    }
    if check.simulation is None:
        return shared
    document = check.simulation.document()
    names = ("samples", "predicted", "simulated", "tolerance", "forest", "view", "precise")
    return shared | {
        **{name: document[name] for name in names},
        "volumes": document["volumes"],
        "targets": document["targets"],
        "comparisons": [
            {name: value for name, value in _comparison(each).items() if name != "row"}
            for each in check.comparisons()
        ],
    }


def verify(
    scenarios: ScenarioProduct | ScenarioTable,
    draw: RowSample,
    drawing: SamplingPlan,
    settings: Settings,
    folder: str = "",
    *,
    progress: Callable[[int, int], None] | None = None,
) -> Verification:
    """Simulate the drawn rows and compare the results with the predictions.

    Parameters
    ----------
    scenarios, draw, drawing
        The scenarios, the drawn rows, and the settings of the draw.
    settings
        Settings of the simulation.  The seed of a row is computed from the seed of the settings and
        the index of the row.
    folder
        Folder in which files of the scenarios are looked for first.
    progress
        Function that is called with the number of finished rows and the total.
    """
    rows = sample(draw, drawing)
    checks = []
    for done, chosen in enumerate(rows):
        if progress is not None:
            progress(done, len(rows))
        checks.append(_checked(scenarios, chosen, settings, folder))
    taken = {name for chosen in rows for name in chosen.strata}
    left_out = tuple(sorted(draw.strata.keys() - taken, key=strata_of(drawing.groups).index))
    return Verification(drawing.seed, settings.precision, tuple(checks), left_out)


def _checked(
    scenarios: ScenarioProduct | ScenarioTable, chosen: SampledRow, settings: Settings, folder: str
) -> Check:
    from aosplan.simulation.compare import simulate

    values = scenario(scenarios, chosen.row)
    seed = (settings.seed + chosen.row) % (LARGEST_SEED + 1)
    try:
        request = PlanRequest(**values)
        planned = plan(request, folder=folder, loaded=scene_for(request, folder))
        own = settings._replace(seed=seed, view=_view(request, planned))
        return Check(chosen, values, seed, simulate(planned, own), "")
    except AosplanError as error:
        return Check(chosen, values, seed, None, error.message)


def _view(request: PlanRequest, planned: Plan) -> ViewKind:
    """The requested view.  The default is perspective if all samples see some common ground,
    otherwise telecentric.
    """
    if request.view is not None:
        return cast("ViewKind", request.view)
    return "perspective" if min(planned.common_footprint_m) > 0.0 else "telecentric"
