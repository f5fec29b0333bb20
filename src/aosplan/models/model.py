"""Visibility models: what a set of sample positions will show of the target.

One file a model, one interface: `VisibilityModel`.  A model is made for one scene at one
altitude; it predicts the integrated density and the shortfall of a pattern flown at a
baseline.  Everything else follows from those in `Prediction`, the same for every model.

- `aosplan.models.uniform`: one volume of occluders of one kind, the paper's model.
- `aosplan.models.layered`: independent slices, each with its own height, size and density.
- `aosplan.models.measured`: the voxels of a stand themselves.

Below them, functions of numbers: `aosplan.models.equations`, Eq. 1 to 5 of the paper;
`aosplan.models.positions`, the shortfall of any set of positions, on a lattice or scattered;
`aosplan.models.position_noise`, the same where the drone does not hold its place, with
`aosplan.models.layered_noise` for whole stacks of slices; and `aosplan.models.oblique_rays`, rays off nadir.
`aosplan.models.memo` keeps predictions that are asked for again.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from aosplan.grid.patterns import Sites

    Floats = NDArray[np.float64]

MODELS = ("uniform", "layered", "measured")
"""Visibility models by name."""

RAYS = ("nadir", "oblique", "cubes")
"""Rays of the uniform and the layered model, by name (`aosplan.models.oblique_rays`)."""


def contrast_squared(density: Any, transparency: Any, shortfall: Any) -> Any:
    """Square of the target's contrast over the noise of the occluders, (1-p)/(p K)."""
    return 1.0 / shortfall * transparency / density


class Prediction(NamedTuple):
    """What a model predicts for one set of samples.

    `density` is p, the share of the target that one sample does not see; `transparency` is
    1 - p with the digits that p has lost; `shortfall` is K = 1 - V̂.
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
        """V̂ = 1 - K."""
        return 1.0 - self.shortfall

    @property
    def expected(self) -> float:
        """Visibility V = T (1 + p V̂)."""
        return self.transparency * (1.0 + self.density * self.normalized)

    @property
    def mean_squared_error(self) -> float:
        """1 - V = p (p + T K)."""
        return self.density * (self.density + self.transparency * self.shortfall)

    @property
    def effective_samples(self) -> float:
        """1/K: how many independent samples would do as well."""
        return 1.0 / self.shortfall if self.shortfall > 0.0 else math.inf

    @property
    def contrast(self) -> float:
        """Contrast of the target over the noise of the occluders, √((1-p)/(p K))."""
        if self.density == 0.0 or self.shortfall <= 0.0:
            return math.inf
        return math.sqrt(contrast_squared(*self))


class VisibilityModel(Protocol):
    """What the solver asks of a model."""

    @property
    def name(self) -> str:
        """Name of the model."""

    @property
    def density(self) -> float:
        """p of a single nadir sample."""

    @property
    def transparency(self) -> float:
        """1 - p of a single nadir sample."""

    @property
    def independent_baseline_m(self) -> float:
        """Baseline from which neighbouring samples share no occluder: K = 1/N; may be inf."""

    @property
    def sharp_baseline_m(self) -> float:
        """The same, were every site flown without position noise."""

    @property
    def widest_aperture_m(self) -> float:
        """Largest extent [m] of which the scene can tell something; inf where any."""

    @property
    def rises_with_baseline(self) -> bool:
        """Whether V̂ and V never fall as the baseline grows."""

    @property
    def rule_baseline_m(self) -> float | None:
        """Baseline that the model's own rule prefers, or None where wider is never in vain."""

    @property
    def heading_deg(self) -> float | None:
        """Heading of the patterns, clockwise from the scene's north; None if it has no directions."""

    def at_heading(self, heading_deg: float) -> VisibilityModel:
        """The same model for patterns at another heading; itself if the scene has no directions."""

    def predict(self, pattern: Sites, baseline_m: float) -> Prediction:
        """Density and shortfall of a pattern flown at a baseline."""

    def predict_positions(self, positions_m: ArrayLike) -> Prediction:
        """Density and shortfall of samples at known positions, shape (N, 2), from the middle.

        A model with a `heading_deg` takes them east and north.  A model without one takes them
        along the heading and to its right.
        """

    def hidden_at(self, positions_m: ArrayLike) -> Floats:
        """Share of the target that a sample at each of these positions does not see, shape (N,)."""

    def correlation(self, x_m: Floats, y_m: Floats) -> Floats:
        """Correlation of what two samples see by their offset along the same axes, elementwise."""

    def at_best(self, pattern: Sites, baseline_m: float) -> Prediction:
        """A quick prediction that is no worse; asked for only where `rises_with_baseline`."""


def prediction_document(prediction: Prediction) -> dict[str, float | None]:
    """A prediction's numbers; what nothing hides has no normalised visibility."""
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
