"""Comparison of a plan's prediction with its simulation.

**Prediction.**  The prediction is made for the rays of the experiment, which differ from the rays of the plan. A plan is for a target below the middle of its grid, and the uniform and the layered model assume vertical rays. In the experiment, rays to the targets of an area are slanted. They cross more leaves, or side faces of cubes (`aosplan.models.area_rays`). The measured model makes its prediction for the kind of view in the experiment, telecentric or perspective. For noise patterns, which are the experiment of the paper, the prediction of the plan is used.

**Agreement.**  Prediction and experiment agree if the difference of each of p, V and V̂ is at most `MOST_ERRORS` standard errors plus the systematic error of the experiment. The systematic error is the effect of voxels on p, V and K (`TOLERANCE`), plus the effect of cubes on K. For a ray with the slope s, cubes are effectively wider by the factor 1 + s. Their effect is therefore computed for independent slices, as the change of K if the disparity is divided by this factor.

**As flown.**  Even if prediction and experiment agree, the numbers of the plan may differ from the experiment, because their rays differ. `as_flown` lists these differences.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.errors import RequestError
from aosplan.grid.patterns import local_sites
from aosplan.models.area_rays import cube_terms, cubes, leaves, slanted
from aosplan.models.layered import LayeredModel
from aosplan.models.measured import MeasuredModel
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

    from aosplan.models.model import Prediction
    from aosplan.planning.result import Plan
    from aosplan.scenes.occlusion import ViewKind
    from aosplan.scenes.scene import Scene

OCCLUDERS = ("cubes", "leaves")
"""Kinds of occluders in the volumes of a simulation: cubes with side faces, or leaves of random
direction.
"""

FORESTS = ("noise", "uniform", "layered", "clumped", "cloud")
"""Names of the forests on which a plan can be simulated."""

OF_OCCLUDERS = ("uniform", "layered", "clumped")
"""The forests that are generated."""

FOREST_OF = {"uniform": "uniform", "layered": "layered", "cloud": "cloud"}
"""The forest that corresponds to each kind of scene."""

QUANTITIES = ("density", "expected", "normalized")

SYMBOLS = {"density": "p", "expected": "V", "normalized": "V̂"}

LEAST_UNLIKE = 0.01
"""Differences from the numbers of the plan that are smaller than this are not reported."""

MOST_ERRORS = 4.0
"""Largest difference in standard errors that chance can explain.  Larger differences occur by
chance in less than one of a thousand comparisons.
"""

MOST_TARGETS = 100_000_000
"""Default for the largest number of targets of a simulation."""

TOLERANCE = {"density": 0.003, "expected": 0.003, "normalized": 0.03}
"""Systematic error of voxel volumes: the error of p and V, and the error of V̂ as a share of 1 -
V̂.
"""


class Settings(NamedTuple):
    """Settings of a simulation.

    Attributes
    ----------
    seed
        Random seed, at least 0.
    precision
        Standard error of V and V̂ at which the simulation stops.
    forest
        One of `FORESTS`; None for the forest that corresponds to the scene.
    view
        ``perspective``: the targets are on the ground that all samples see, below one aperture.
        ``telecentric``: each target is at the centre of its own aperture.
    occluders
        One of `OCCLUDERS`, for generated volumes.
    most_targets
        Number of targets at which the simulation stops, even if `precision` is not reached.  It
        does not stop before `FEWEST_SAMPLES` volumes.
    """

    seed: int = 1
    precision: float = 0.005
    forest: str | None = None
    view: ViewKind = "perspective"
    most_targets: int = MOST_TARGETS
    occluders: str = "cubes"


class Simulation(NamedTuple):
    """A plan's prediction and the result of its simulation.

    Attributes
    ----------
    plan, settings
        The plan, and the settings of the simulation.  `settings.forest` is the name of the forest.
    predicted
        Prediction of the model for the experiment.
    simulated
        Result of the experiment, with standard errors.
    views, targets, samples
        Number of views of each target, total number of targets, and number of independent volumes,
        patterns or blocks.
    tolerance
        Systematic error of the experiment for each quantity.
    experiment
        The experiment, from which pictures are made; None if there are no occluders.
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
    def as_flown(self) -> list[str]:
        """The numbers of the plan that are not valid for its photos, in one sentence each."""
        return [text for name in QUANTITIES if (text := self._unlike_the_plan(name))]

    @property
    def occluders(self) -> str | None:
        """Kind of occluders in the volumes; None if the volumes were not generated."""
        return self.settings.occluders if self.settings.forest in OF_OCCLUDERS else None

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
            "as_flown": self.as_flown,
            "tolerance": self.tolerance,
            "forest": self.settings.forest,
            "occluders": self.occluders,
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
        # V̂ is not defined if nothing is hidden. The term 1e-9 is for rounding errors.
        if math.isnan(found) or abs(predicted - found) <= MOST_ERRORS * error + tolerance + 1e-9:
            return ""
        return (
            f"{SYMBOLS[name]} is {found:.4f} ± {error:.4f}, but the {self.plan.model} model "
            f"predicts {predicted:.4f}"
        )

    def _unlike_the_plan(self, name: str) -> str:
        planned = getattr(self.plan.solution.prediction, name)
        found = getattr(self.simulated, name)
        error = getattr(self.simulated, f"{name}_standard_error")
        if self.settings.forest == "noise" or math.isnan(found):
            return ""
        # The prediction itself differs from the experiment, so the rays are not the reason.
        if self._difference(name, self.tolerance[name]):
            return ""
        if abs(planned - found) <= MOST_ERRORS * error + max(self.tolerance[name], LEAST_UNLIKE):
            return ""
        measured = self.plan.model == "measured"
        rays = "the targets that it counts" if measured else "vertical rays"
        return (
            f"{SYMBOLS[name]} is {found:.1%}; the value of the plan, {planned:.1%}, is for {rays}"
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
        Settings of the simulation.  Default: the forest of the plan's scene, in perspective.
    progress
        Function that is called with the number of finished volumes and the expected total.

    Raises
    ------
    RequestError
        In the same cases as `experiment_of`.
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
        # The standard error is random too. Frequent checks would therefore stop the simulation too
        # early.
        check = math.ceil(1.25 * len(samples))
        if progress is not None:
            progress(len(samples), math.ceil(len(samples) * (worst / settings.precision) ** 2))
    found = estimate(samples, one_plot=experiment.one_plot)
    tolerance = _tolerance(plan, above, experiment, predicted, settings)
    return Simulation(
        plan, settings, predicted, found, views, targets, len(samples), tolerance, experiment
    )


def experiment_of(plan: Plan, settings: Settings) -> tuple[Settings, Experiment | None, Prediction]:
    """The experiment for a plan, and the prediction of the model for it.

    The returned settings have the name of the forest.  Without occluders, there is no experiment.

    Raises
    ------
    RequestError
        If the kind of forest is not possible for the scene, if there is no target area, if there
        are more than `aosplan.simulation.experiments.MOST_VIEWS` views, or if the plan has position
        noise or oblique rays.
    """
    check_views(plan.solution.pattern.samples)
    if plan.inputs.hold_error_m > 0.0:
        raise RequestError(
            f"--hold-error {plan.inputs.hold_error_m:g} cannot be simulated, because a simulation "
            "takes each photo exactly at its site",
            "simulate the plan without --hold-error",
        )
    if plan.inputs.rays not in (None, "nadir"):
        raise RequestError(
            f"a plan with --rays {plan.inputs.rays} cannot be simulated, because a simulation always "
            "traces the slanted rays",
            "simulate the plan with --rays nadir",
        )
    above = plan.scene.above(plan.inputs.focal_height_m)
    settings = settings._replace(forest=_forest(plan, settings))
    if settings.occluders != "cubes" and settings.forest not in OF_OCCLUDERS:
        raise RequestError(
            f"--occluders {settings.occluders} cannot be used with --forest {settings.forest}",
            f"give --occluders only with the generated forests {', '.join(OF_OCCLUDERS)}",
        )
    if above is None or plan.coverage is None:
        return settings, None, plan.solution.prediction
    return settings, *_experiment(plan, above, settings)


class Pictures(NamedTuple):
    """PNG files of a simulation, and the similarity (SSIM) of its images to the image of infinitely
    many views.

    `picture` shows a resolution chart behind the trees: in the middle view, in the integral image,
    and for infinitely many views.  `occlusion_map` shows the share of views that see each target.
    White means that all views see it.
    """

    picture: bytes
    occlusion_map: bytes
    single: float
    integral: float


def pictures(simulation: Simulation) -> Pictures:
    """Draw the first volume, pattern or plot of a simulation.  The far end of the area is at the
    top.

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
        raise RequestError("no occluder is above the focal plane, so there is nothing to draw")
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
    """Name of the forest for the simulation.  It is checked that this kind of forest is possible
    for the scene.
    """
    if plan.approximation is not None:
        raise RequestError(
            f"scene '{plan.inputs.scene_name}' contains a correlogram, but no voxels that "
            "could be simulated",
            "give the point cloud or a .npz as --scene, or give --model layered",
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
            f"--forest uniform cannot be used for scene '{plan.scene.name}', because this scene has layers",
            "give --forest layered or clumped",
        )
    return forest


def _experiment(plan: Plan, above: Scene, settings: Settings) -> tuple[Experiment, Prediction]:
    """The experiment, and the prediction of the model for it."""
    h = plan.altitude_m
    if settings.forest == "noise":
        assert plan.coverage is not None  # Scenes without occluders are not simulated.
        in_occluders = _sites(plan, 0.0) / plan.coverage.baseline_m
        predicted = _of_one_height(plan)
        return NoiseExperiment(settings.seed, predicted.density, in_occluders), predicted
    if settings.forest == "cloud":
        assert plan.volume is not None  # `_forest` has checked that there are voxels.
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
        of_leaves = settings.occluders == "leaves"
        make = maker(above, str(settings.forest), of_leaves=of_leaves)
        flown = positions, h, above.canopy_top_m
        experiment = ForestExperiment(settings.seed, make, *flown, size, settings.view, area)
        experiment.check()
    if plan.model == "measured":
        return experiment, _measured(plan, settings.view)
    log_clear = leaves(above) if settings.occluders == "leaves" else cubes(above)
    return experiment, slanted(
        _shortfall(plan, above), log_clear, positions, area, h, settings.view
    )


def _of_one_height(plan: Plan) -> Prediction:
    """The plan's prediction for occluders at a single height, because noise patterns have only one
    height.
    """
    assert plan.problem is not None  # Scenes without occluders are not simulated.
    model, solution = plan.problem.model, plan.solution
    if not isinstance(model, UniformModel) or plan.reading != "slices":
        return solution.prediction
    return model._replace(slices=None).predict(solution.pattern, solution.baseline_m)


def _shortfall(plan: Plan, above: Scene) -> float:
    """K of the plan, increased by the effect of occluders below the occluder that determines the
    coverage rule.
    """
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
        return across, along  # The size has no effect, because each target has its own aperture.
    if min(along, across) <= 0.0:
        raise RequestError(
            "no ground is in all photos, so there are no targets to simulate",
            "give --view telecentric, so that each target is below the centre of its own grid",
        )
    return across, along


def _tolerance(
    plan: Plan, above: Scene, experiment: Experiment, predicted: Prediction, settings: Settings
) -> dict[str, float]:
    """Systematic error of an experiment for each quantity."""
    if isinstance(experiment, NoiseExperiment):
        return dict.fromkeys(QUANTITIES, 0.0)
    wider = 0.0
    if isinstance(experiment, ForestExperiment) and settings.occluders == "cubes":
        model = LayeredModel(above.slices(), plan.altitude_m)
        pattern, baseline = plan.solution.pattern, plan.solution.baseline_m
        straight, slope = cube_terms(above)
        # The mean slope of rays along one axis is computed from its effect on the transparency.
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
