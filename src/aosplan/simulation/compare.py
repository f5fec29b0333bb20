"""Comparison of a plan's prediction with its simulation.

**Prediction.**  The model predicts what the experiment measures, which may differ from the plan.
The uniform and the layered model predict for vertical rays, but rays from a flown plan to its
target area are slanted.  A ray with slopes s = |tan x| + |tan y| meets more cubes: it is clear with
probability Π q^(1 + r s), where r is the thickness of a slice divided by the size of its occluders
(Beer-Lambert).  p is therefore the mean of p_i(t) over views i and targets t, and

    E[X²] = mean over t of (mean over i of p_i)² + K · mean of p_i (1 - p_i),

with the K of the plan.  The measured model predicts for the view of the experiment, telecentric or
perspective.  Noise patterns are the experiment of the paper; the prediction is that of the plan.

**Agreement.**  Prediction and experiment agree if each of p, V and V̂ differs by at most
`MOST_ERRORS` standard errors plus the systematic error of the experiment: the effect of voxels on
p, V and K (`TOLERANCE`), and the effect of cubes on K.  Slanted rays see cubes that are up to 1 + s
times as wide.  Their effect is therefore computed as the change of K of independent slices at a
disparity that is smaller by this factor.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.errors import RequestError
from aosplan.grid.patterns import local_sites
from aosplan.models.layered import LayeredModel
from aosplan.models.measured import MeasuredModel
from aosplan.models.model import Prediction
from aosplan.models.uniform import UniformModel
from aosplan.simulation.experiments import (
    FEWEST_SAMPLES,
    Experiment,
    ForestExperiment,
    NoiseExperiment,
    PlotExperiment,
    check_views,
)
from aosplan.simulation.forests import maker
from aosplan.simulation.moments import Estimate, estimate
from aosplan.simulation.voxel_views import VoxelViews

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from aosplan.planning.result import Plan
    from aosplan.scenes.occlusion import ViewKind
    from aosplan.scenes.scene import Scene

FORESTS = ("noise", "uniform", "layered", "clumped", "cloud")
"""Names of the forests on which a plan can be simulated."""

FOREST_OF = {"uniform": "uniform", "layered": "layered", "cloud": "cloud"}
"""The forest that corresponds to each kind of scene."""

QUANTITIES = ("density", "expected", "normalized")

MOST_ERRORS = 4.0
"""Largest difference in standard errors that can be due to chance, less than once in a thousand."""

MOST_TARGETS = 100_000_000
"""Default limit of the number of targets of a simulation."""

AREA_POINTS = 9
"""Number of points along each side of the target area over which predictions are averaged."""


TOLERANCE = {"density": 0.003, "expected": 0.003, "normalized": 0.03}
"""Systematic error of voxel volumes: of p and V, and of V̂ as a share of 1 - V̂."""


class Settings(NamedTuple):
    """How a plan is simulated.

    Attributes
    ----------
    seed
        Random seed, at least 0.
    precision
        Standard error of V and V̂ at which the simulation stops.
    forest
        One of `FORESTS`; None for the forest that corresponds to the scene.
    view
        ``perspective``: targets on the ground that all samples see, under one aperture.
        ``telecentric``: each target is at the centre of its own aperture.
    most_targets
        Number of targets after which the simulation stops at any precision, but not before
        `FEWEST_SAMPLES` volumes.
    """

    seed: int = 1
    precision: float = 0.005
    forest: str | None = None
    view: ViewKind = "perspective"
    most_targets: int = MOST_TARGETS


class Simulation(NamedTuple):
    """A plan's prediction and the result of its simulation.

    Attributes
    ----------
    plan, settings
        What was simulated and how; `settings.forest` is the name of the forest.
    predicted
        Prediction of the model for the experiment.
    simulated
        Result of the experiment, with standard errors.
    views, targets, samples
        Number of views of each target; number of targets in total; number of independent
        volumes, patterns or blocks.
    tolerance
        Systematic error of the experiment for each quantity.
    experiment
        The experiment, for pictures; None if there are no occluders.
    """

    plan: Plan
    settings: Settings
    predicted: Prediction
    simulated: Estimate
    views: int
    targets: int
    samples: int
    tolerance: dict[str, float]
    experiment: Experiment | None

    @property
    def differences(self) -> list[str]:
        """The differences between prediction and simulation, one sentence each."""
        return [
            text for name in QUANTITIES if (text := self._difference(name, self.tolerance[name]))
        ]

    @property
    def agree(self) -> bool:
        """Whether prediction and simulation agree."""
        return not self.differences

    @property
    def precise(self) -> bool:
        """Whether the standard errors reached the requested precision."""
        return _worst(self.simulated) <= self.settings.precision

    def document(self) -> dict[str, Any]:
        """The document of the plan with the results of the simulation."""
        found = {
            name: value if math.isfinite(value) else None
            for name, value in self.simulated._asdict().items()
        }
        clear = self.predicted.density == 0.0
        predicted = {name: float(getattr(self.predicted, name)) for name in QUANTITIES}
        return self.plan.document() | {
            "predicted": predicted | ({"normalized": None} if clear else {}),
            "simulated": found,
            "agree": self.agree,
            "differences": self.differences,
            "tolerance": self.tolerance,
            "forest": self.settings.forest,
            "view": None if self.settings.forest == "noise" else self.settings.view,
            "seed": self.settings.seed,
            "precision": self.settings.precision,
            "precise": self.precise,
            "views": self.views,
            "targets": self.targets,
            "volumes": self.samples,
        }

    def _difference(self, name: str, tolerance: float) -> str:
        predicted, found = getattr(self.predicted, name), getattr(self.simulated, name)
        error = getattr(self.simulated, f"{name}_standard_error")
        # V̂ is undefined if nothing is hidden; 1e-9 covers rounding.
        if math.isnan(found) or abs(predicted - found) <= MOST_ERRORS * error + tolerance + 1e-9:
            return ""
        symbol = {"density": "p", "expected": "V", "normalized": "V̂"}[name]
        return (
            f"{symbol} is {found:.4f} ± {error:.4f}, but the {self.plan.model} model "
            f"predicts {predicted:.4f}"
        )


def simulate(
    plan: Plan,
    settings: Settings | None = None,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> Simulation:
    """Simulate a plan over a forest and compare the result with its prediction.

    Parameters
    ----------
    plan
        The plan to simulate.
    settings
        Settings of the simulation; default: the forest of the plan's scene, in perspective.
    progress
        Function that is called with the number of volumes done and the expected total.

    Raises
    ------
    RequestError
        As `experiment_of` does.
    """
    settings, experiment, predicted = experiment_of(plan, settings or Settings())
    views = plan.solution.pattern.samples
    above = plan.scene.above(plan.inputs.focal_height_m)
    if experiment is None or above is None:
        return Simulation(
            plan,
            settings,
            predicted,
            Estimate(0.0, 1.0, math.nan, 0.0, 0.0, math.nan),
            views,
            0,
            0,
            dict.fromkeys(QUANTITIES, 0.0),
            None,
        )
    samples = []
    targets, check = 0, FEWEST_SAMPLES
    for counts in experiment.samples():
        samples.append(counts)
        targets += counts.targets
        if experiment.one_plot or len(samples) < FEWEST_SAMPLES:
            continue
        if targets + counts.targets > settings.most_targets:
            break
        if len(samples) < check:
            continue
        worst = _worst(estimate(samples))
        if worst <= settings.precision:
            break
        # The standard error is random, too; checking it often would stop too early.
        check = math.ceil(1.25 * len(samples))
        if progress is not None:
            progress(len(samples), math.ceil(len(samples) * (worst / settings.precision) ** 2))
    found = estimate(samples, one_plot=experiment.one_plot)
    tolerance = _tolerance(plan, above, experiment, predicted)
    return Simulation(
        plan, settings, predicted, found, views, targets, len(samples), tolerance, experiment
    )


def experiment_of(plan: Plan, settings: Settings) -> tuple[Settings, Experiment | None, Prediction]:
    """The experiment for a plan, and the prediction of the model for it.

    The returned settings have the name of the forest.  Without occluders there is no experiment.

    Raises
    ------
    RequestError
        If the forest does not suit the scene, if there is no target area, if there are more than
        `aosplan.simulation.experiments.MOST_VIEWS` views, or if the plan has position noise or oblique rays.
    """
    check_views(plan.solution.pattern.samples)
    if plan.inputs.hold_error_m > 0.0:
        raise RequestError(
            f"--hold-error {plan.inputs.hold_error_m:g}: a simulation flies to every site exactly",
            "simulate the plan without --hold-error",
        )
    if plan.inputs.rays not in (None, "nadir"):
        raise RequestError(
            f"--rays {plan.inputs.rays}: a simulation always traces the real rays",
            "simulate the plan with --rays nadir",
        )
    above = plan.scene.above(plan.inputs.focal_height_m)
    settings = settings._replace(forest=_forest(plan, settings))
    if above is None or plan.coverage is None:
        return settings, None, plan.solution.prediction
    return settings, *_experiment(plan, above, settings)


class Pictures(NamedTuple):
    """PNG files of a simulation, and the similarity (SSIM) of its images to the infinite limit.

    `picture` shows a resolution chart through the trees: in the middle view, in the integral image,
    and for infinitely many views.  `occlusion_map` is the share of views that see each target;
    white is all.
    """

    picture: bytes
    occlusion_map: bytes
    single: float
    integral: float


def pictures(simulation: Simulation) -> Pictures:
    """Draw the first volume, pattern or plot of a simulation; the far end of the area is on top.

    Raises
    ------
    RequestError
        If there are no occluders.
    MissingExtraError
        If Pillow or scikit-image is not installed.
    """
    from aosplan.simulation import pictures as p
    from aosplan.simulation.ssim import similarity

    if simulation.experiment is None:
        raise RequestError("no occluder is above the focal plane: there is nothing to draw")
    shown = p.panels(*simulation.experiment.images(), simulation.views)
    return Pictures(
        p.png(p.side_by_side([shown.single, shown.integral, shown.endless])),
        p.png(1.0 - shown.share),
        *(
            similarity(image, shown.endless, span=1.0).ssim
            for image in (shown.single, shown.integral)
        ),
    )


def _worst(found: Estimate) -> float:
    errors = (found.expected_standard_error, found.normalized_standard_error)
    return max((error for error in errors if not math.isnan(error)), default=0.0)


def _forest(plan: Plan, settings: Settings) -> str:
    """Name of the forest for the simulation, after checking that it suits the scene."""
    if plan.approximation is not None:
        raise RequestError(
            f"scene '{plan.inputs.scene_name}' contains a correlogram but no voxels to simulate",
            "simulate its point cloud or .npz, or plan with --model layered",
        )
    kind = "cloud" if plan.volume is not None else plan.scene.kind
    forest = settings.forest or FOREST_OF[kind]
    if forest == "cloud" and plan.volume is None:
        raise RequestError(
            "--forest cloud needs the voxels of a point cloud",
            "give --scene FILE.laz or FILE.npz, or another --forest",
        )
    if forest == "uniform" and plan.scene.kind != "uniform":
        raise RequestError(
            f"--forest uniform, but scene '{plan.scene.name}' has layers",
            "give --forest layered or clumped",
        )
    return forest


def _experiment(plan: Plan, above: Scene, settings: Settings) -> tuple[Experiment, Prediction]:
    """The experiment, and the prediction of the model for it."""
    h = plan.altitude_m
    if settings.forest == "noise":
        assert plan.coverage is not None  # a scene without occluders is not simulated
        in_occluders = _sites(plan, 0.0) / plan.coverage.baseline_m
        predicted = _of_one_height(plan)
        return NoiseExperiment(settings.seed, predicted.density, in_occluders), predicted
    if settings.forest == "cloud":
        assert plan.volume is not None  # the forest was checked before
        plot = VoxelViews(
            plan.volume, h, view=settings.view, focal_height_m=plan.inputs.focal_height_m
        )
        positions = _sites(plan, plan.heading_deg)
        area = plan.volume.size_m
        experiment: Experiment = PlotExperiment(plot, positions)
    else:
        positions = _sites(plan, 0.0)
        area = _target_area(plan, settings.view)
        size = min(layer.occluder_size_m for layer in above.slices())
        make = maker(above, str(settings.forest))
        flown = positions, h, above.canopy_top_m
        experiment = ForestExperiment(settings.seed, make, *flown, size, settings.view, area)
        experiment.check()
    if plan.model == "measured":
        return experiment, _measured(plan, settings.view)
    return experiment, slanted(
        _shortfall(plan, above), _lengths(above), positions, area, h, settings.view
    )


def _of_one_height(plan: Plan) -> Prediction:
    """The plan's prediction for occluders at one height, as noise patterns have."""
    assert plan.problem is not None  # a scene without occluders is not simulated
    model, solution = plan.problem.model, plan.solution
    if not isinstance(model, UniformModel) or plan.reading != "slices":
        return solution.prediction
    return model._replace(slices=None).predict(solution.pattern, solution.baseline_m)


def _shortfall(plan: Plan, above: Scene) -> float:
    """K of the plan, increased by what occluders below those of the coverage rule still share."""
    solution, shortfall = plan.solution, plan.solution.prediction.shortfall
    if plan.reading != "rule":
        return shortfall
    slices = LayeredModel(above.slices(), plan.altitude_m)
    shared = slices.predict(solution.pattern, solution.baseline_m).shortfall
    return shortfall * max(shared * solution.pattern.samples, 1.0)


def _sites(plan: Plan, heading_deg: float) -> NDArray[np.float64]:
    return np.column_stack(
        local_sites(plan.solution.pattern, plan.solution.baseline_m, heading_deg)
    )


def _target_area(plan: Plan, view: ViewKind) -> tuple[float, float]:
    """Size of the ground that all samples see, across and along the heading."""
    along, across = plan.common_footprint_m
    if view == "telecentric":
        return across, along  # no effect: each target has its own aperture
    if min(along, across) <= 0.0:
        raise RequestError(
            "no ground is seen by all samples, so there are no targets to simulate",
            "--view telecentric simulates a target in the middle of the aperture",
        )
    return across, along


def _lengths(above: Scene) -> tuple[float, float]:
    """Logarithm of the vertical transparency, and its change per unit of slope."""
    straight = slope = 0.0
    for layer in above.slices():
        cubes = (layer.top_m - layer.bottom_m) / layer.occluder_size_m
        log_clear = math.log1p(-layer.density)
        straight += log_clear
        slope += log_clear * cubes / max(round(cubes), 1)
    return straight, slope


def _tolerance(
    plan: Plan, above: Scene, experiment: Experiment, predicted: Prediction
) -> dict[str, float]:
    """Systematic error of an experiment for each quantity."""
    if isinstance(experiment, NoiseExperiment):
        return dict.fromkeys(QUANTITIES, 0.0)
    wider = 0.0
    if isinstance(experiment, ForestExperiment):
        model = LayeredModel(above.slices(), plan.altitude_m)
        pattern, baseline = plan.solution.pattern, plan.solution.baseline_m
        straight, slope = _lengths(above)
        # The mean slope along one axis, from its effect on the transparency.
        mean_slope = 0.5 * (math.log(predicted.transparency) - straight) / slope
        wide = model.predict(pattern, baseline / (1.0 + max(mean_slope, 0.0)))
        wider = wide.shortfall - model.predict(pattern, baseline).shortfall
    share = TOLERANCE["normalized"] * predicted.shortfall
    return TOLERANCE | {"normalized": share + max(wider, 0.0)}


def _measured(plan: Plan, view: ViewKind) -> Prediction:
    assert plan.volume is not None
    model = MeasuredModel(
        plan.volume,
        plan.altitude_m,
        heading_deg=plan.heading_deg,
        view=view,
        focal_height_m=plan.inputs.focal_height_m,
    )
    return model.predict(plan.solution.pattern, plan.solution.baseline_m)


def slanted(
    shortfall: float,
    log_transparency: tuple[float, float],
    positions_m: NDArray[np.float64],
    area_m: tuple[float, float],
    altitude_m: float,
    view: ViewKind,
) -> Prediction:
    """A prediction for the slanted rays of an experiment, as described in the module docstring.

    Parameters
    ----------
    shortfall
        K of the plan.
    log_transparency
        Logarithm of the vertical transparency, and its change per unit of slope.
    positions_m
        Camera positions relative to the centre of the pattern, shape (N, 2).
    area_m
        Size of the target area along x and y, for perspective views.
    altitude_m
        Altitude of the cameras above the targets.
    view
        Whether all targets are under one aperture, or each has its own.
    """
    share = (np.arange(AREA_POINTS) + 0.5) / AREA_POINTS - 0.5
    scale = 0.0 if view == "telecentric" else 1.0
    x, y = (
        np.abs(positions_m[:, axis] - scale * area_m[axis] * share[:, np.newaxis]) / altitude_m
        for axis in (0, 1)
    )
    straight, slope = log_transparency
    slopes = x[:, np.newaxis, :] + y[np.newaxis, :, :]
    clear = np.exp(straight + slope * slopes)
    p, t = 1.0 - float(clear.mean()), float(clear.mean())
    means = 1.0 - clear.mean(axis=2)
    squares = float((means * means).mean()) + shortfall * float((clear * (1.0 - clear)).mean())
    return Prediction(p, t, (squares - p * p) / (p * t))
