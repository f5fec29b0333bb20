"""A quick approximation of the measured model for targets whose rays stay on the plot.

The width of the aperture determines the targets whose rays stay on the plot. A correlogram is
computed from these targets for a few widths. The prediction for a pattern is interpolated between
the correlograms.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from aosplan.models.correlogram import CorrelogramModel
from aosplan.models.model import Prediction, at_heading
from aosplan.scenes.correlogram import INTERIOR

if TYPE_CHECKING:
    from aosplan.grid.patterns import AnyPattern
    from aosplan.scenes.correlogram import Correlogram

SHARES = (0.0, *INTERIOR)
"""Widths of the apertures for which there are correlograms, as shares of the reach."""


class InteriorSurrogate:
    """Predictions that are interpolated between correlograms for apertures of several widths.

    Parameters
    ----------
    correlogram
        The correlogram of the stand, with the correlograms of its interior.
    altitude_m, heading_deg, hold_error_m
        As in `aosplan.models.correlogram.CorrelogramModel`.
    """

    name = "correlogram"
    edges = "interior"
    rule_baseline_m = None
    rises_with_baseline = False

    def __init__(
        self,
        correlogram: Correlogram,
        altitude_m: float,
        *,
        heading_deg: float = 0.0,
        hold_error_m: float = 0.0,
    ) -> None:
        self.heading_deg = heading_deg
        self._models = [
            CorrelogramModel(table, altitude_m, heading_deg=heading_deg, hold_error_m=hold_error_m)
            for table in (correlogram, *correlogram.interior)
        ]
        self._widest_m = correlogram.reach * altitude_m

    def __getattr__(self, name: str) -> Any:
        """Take any other attribute from the model for a single view: it does not depend on the
        aperture.
        """
        if name.startswith("_"):  # The module `copy` looks up such names before the models exist.
            raise AttributeError(name)
        return getattr(self._model(0), name)

    def predict(self, pattern: AnyPattern, baseline_m: float) -> Prediction:
        """Density and shortfall of a pattern that is flown with a baseline."""
        along, across = (side * baseline_m for side in pattern.extent)
        turn = math.radians(self.heading_deg)
        sine, cosine = abs(math.sin(turn)), abs(math.cos(turn))
        # The width is the mean of the extents along both axes of the plot. For a line, the rays of
        # more targets stay on the plot than for a square of the same length, so a smaller width is
        # right for the line.
        mean_m = 0.5 * (along + across) * (sine + cosine)
        share = min(mean_m / self._widest_m, 1.0)
        above = next(i for i, each in enumerate(SHARES) if share <= each)
        if above == 0:
            return self._model(0).predict(pattern, baseline_m)
        weight = (share - SHARES[above - 1]) / (SHARES[above] - SHARES[above - 1])
        low, high = (self._model(i).predict(pattern, baseline_m) for i in (above - 1, above))
        density = low.density + weight * (high.density - low.density)
        shortfall = low.shortfall + weight * (high.shortfall - low.shortfall)
        return Prediction(density, 1.0 - density, shortfall)

    def _model(self, index: int) -> CorrelogramModel:
        """The model of one correlogram at the heading of the patterns."""
        return at_heading(self._models[index], self.heading_deg)

    def at_best(self, pattern: AnyPattern, baseline_m: float) -> Prediction:
        """The same as `predict`."""
        return self.predict(pattern, baseline_m)
