"""The interface of visibility models, and the prediction that they share.

Each model is a module with a class that has the methods of `VisibilityModel`. A model is created
for one scene and one altitude. It predicts the integrated density and the shortfall of a pattern
that is flown with a baseline. `Prediction` computes all other quantities from these two, in the
same way for every model.

- `aosplan.models.uniform`: one volume with occluders of one kind, the model of the paper.
- `aosplan.models.layered`: independent slices, each with its own height, size and density.
- `aosplan.models.measured`: the voxels of a stand.

The models use functions in other modules. `aosplan.models.equations` has Eq. 1 to 5 of the paper.
`aosplan.models.positions` has the shortfall of any set of positions, whether or not they are on a
lattice. `aosplan.models.position_noise` adds position noise for one volume, and
`aosplan.models.layered_noise` for stacks of slices. `aosplan.models.oblique_rays` has the effect of
slanted rays. `aosplan.models.memo` stores predictions.
"""

from __future__ import annotations

import math
from copy import copy
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeVar

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from aosplan.grid.patterns import AnyPattern

    Floats = NDArray[np.float64]

MODELS = ("uniform", "layered", "measured")
"""Names of the visibility models."""

RAYS = ("nadir", "oblique", "cubes")
"""Names of the kinds of rays in the uniform and the layered model
(`aosplan.models.oblique_rays`).
"""


def contrast_squared(density: Any, transparency: Any, shortfall: Any) -> Any:
    """The square of the ratio (contrast between target and occluders) / (noise that the occluders
    cause): (1-p)/(p K).
    """
    return 1.0 / shortfall * transparency / density


class Prediction(NamedTuple):
    """Prediction of a model for one set of samples.

    `density` is p, the share of the target that one sample does not see. `transparency` is 1 - p.
    It is stored separately because it would not be accurate if it were computed from a p that is
    close to 1. `shortfall` is K = 1 - V̂.
    """

    density: float
    transparency: float
    shortfall: float

    @property
    def minimum(self) -> float:
        """Visibility of a single sample, 1 - p."""
        return self.transparency

    @property
    def maximum(self) -> float:
        """Visibility of infinitely many independent samples, 1 - p²."""
        return self.transparency * (1.0 + self.density)

    @property
    def normalized(self) -> float:
        """Normalised visibility V̂ = 1 - K."""
        return 1.0 - self.shortfall

    @property
    def expected(self) -> float:
        """Visibility V = T (1 + p V̂)."""
        return self.transparency * (1.0 + self.density * self.normalized)

    @property
    def mean_squared_error(self) -> float:
        """Mean squared error 1 - V = p (p + T K)."""
        return self.density * (self.density + self.transparency * self.shortfall)

    @property
    def effective_samples(self) -> float:
        """1/K: number of independent samples with the same shortfall."""
        return 1.0 / self.shortfall if self.shortfall > 0.0 else math.inf

    @property
    def contrast(self) -> float:
        """Contrast between target and occluders, divided by the noise that the occluders cause:
        √((1-p)/(p K)).
        """
        if self.density == 0.0 or self.shortfall <= 0.0:
            return math.inf
        return math.sqrt(contrast_squared(*self))


class VisibilityModel(Protocol):
    """The methods that a model has to have, because the solver uses them."""

    @property
    def name(self) -> str:
        """Name of the model."""

    @property
    def density(self) -> float:
        """Density p of a single nadir sample."""

    @property
    def transparency(self) -> float:
        """1 - p of a single nadir sample."""

    @property
    def independent_baseline_m(self) -> float:
        """Smallest baseline at which neighbouring samples do not share occluders, and therefore K =
        1/N. It may be inf.
        """

    @property
    def sharp_baseline_m(self) -> float:
        """The same as `independent_baseline_m`, but without position noise."""

    @property
    def widest_aperture_m(self) -> float:
        """Largest extent [m] of a pattern for which the scene is large enough; inf without a limit."""

    @property
    def rises_with_baseline(self) -> bool:
        """Whether V̂ and V never decrease when the baseline increases."""

    @property
    def rule_baseline_m(self) -> float | None:
        """Baseline that the model recommends; None if a larger baseline is always better."""

    @property
    def heading_deg(self) -> float | None:
        """Heading of the patterns, clockwise from the scene's north; None if the scene does not
        depend on direction.
        """

    def predict(self, pattern: AnyPattern, baseline_m: float) -> Prediction:
        """Density and shortfall of a pattern that is flown with a baseline."""

    def predict_positions(self, positions_m: ArrayLike) -> Prediction:
        """Density and shortfall of samples at known positions from the centre, shape (N, 2).

        For a model with a `heading_deg`, positions are metres east and north.  For a model without
        one, they are metres along the heading and to its right.
        """

    def hidden_at(self, positions_m: ArrayLike) -> Floats:
        """Share of the target that a sample at each of these positions does not see, shape (N,)."""

    def correlation(self, x_m: Floats, y_m: Floats) -> Floats:
        """Correlation of two samples as a function of their offset along the axes of
        `predict_positions`, elementwise.
        """

    def at_best(self, pattern: AnyPattern, baseline_m: float) -> Prediction:
        """A fast upper bound of `predict`: its visibility is at least as high.

        It is only used if `rises_with_baseline` is true.
        """


AnyModel = TypeVar("AnyModel", bound=VisibilityModel)


def at_heading(model: AnyModel, heading_deg: float) -> AnyModel:
    """The same model for patterns at another heading. Both models use the same stored results.

    If the scene does not depend on direction, the result is this model itself.
    """
    if model.heading_deg in (None, heading_deg):
        return model
    turned: Any = copy(model)
    turned.heading_deg = heading_deg
    found: AnyModel = turned
    return found


def prediction_document(prediction: Prediction) -> dict[str, float | None]:
    """The numbers of a prediction. Without occluders, the normalised visibility is not defined, and
    its value is None.
    """
    clear = prediction.density == 0.0
    return {
        "density": prediction.density,
        "minimum": prediction.minimum,
        "maximum": prediction.maximum,
        "expected": prediction.expected,
        "normalized": None if clear else prediction.normalized,
        "shortfall": None if clear else prediction.shortfall,
        "effective_samples": None if clear else _finite(prediction.effective_samples),
        "contrast": None if clear else _finite(prediction.contrast),
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
