"""The uniform model: one volume of occluders of one kind (Kurmi, Schedl and Bimber, 2019)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from aosplan.models import Prediction
from aosplan.models.sites import pattern_shortfall

if TYPE_CHECKING:
    from aosplan.pattern import Sites


class UniformModel(NamedTuple):
    """Integrated density, and the baseline at which neighbours become independent.

    `unit_baseline_m` has d̂ = 1; by the paper's rule that is the smallest baseline at which
    the wanted share of the occluders has d̂ >= 1 (`aosplan.geometry.coverage_baseline`).
    """

    density: float
    transparency: float
    unit_baseline_m: float

    @property
    def name(self) -> str:
        """Name of the model."""
        return "uniform"

    @property
    def independent_baseline_m(self) -> float:
        """Baseline from which K = 1/N."""
        return self.unit_baseline_m

    @property
    def widest_aperture_m(self) -> float:
        """Any aperture will do."""
        return math.inf

    @property
    def rises_with_baseline(self) -> bool:
        """V̂ never falls as the baseline grows."""
        return True

    @property
    def rule_baseline_m(self) -> float | None:
        """The paper's optimal baseline: wider ones gain nothing."""
        return self.unit_baseline_m

    def predict(self, pattern: Sites, baseline_m: float) -> Prediction:
        """Density and shortfall of a pattern flown at a baseline."""
        dhat = baseline_m / self.unit_baseline_m
        return Prediction(self.density, self.transparency, pattern_shortfall(pattern, dhat))
