"""The uniform model: one volume of occluders of one kind (Kurmi, Schedl and Bimber, 2019).

The paper takes d̂ at one height, that of the occluder which decides the coverage rule.  At the
baseline of that rule neighbours are independent and V̂ = 1 - 1/N.  Below it the occluders of most
heights still have d̂ close to 1, and one d̂ for all of them would predict far too little: 49 samples
1 m apart from 50 m have V̂ = 0.957 in simulated volumes of the default scene, and 0.816 by the d̂ of
the rule.  So below the rule's baseline the volume counts as slices one occluder thick
(`aosplan.models.layered`), which predict 0.965.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.grid.spiral import Spiral
from aosplan.models.model import Prediction
from aosplan.models.positions import pattern_shortfall, positions_shortfall
from aosplan.numerics import triangle

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from aosplan.grid.patterns import Sites
    from aosplan.models.model import VisibilityModel

    Floats = NDArray[np.float64]


class UniformModel(NamedTuple):
    """Integrated density, and the baseline at which neighbours become independent.

    `unit_baseline_m` has d̂ = 1; by the paper's rule that is the smallest baseline at which
    the wanted share of the occluders has d̂ >= 1 (`aosplan.camera.disparity.coverage_baseline`).
    `hold_error_m` is the standard deviation of the positions about their sites, per axis
    (`aosplan.models.position_noise`); `rays` other than ``nadir`` need the `altitude_m`
    (`aosplan.models.oblique_rays`).
    `slices` makes the model of the volume as slices; without it one d̂ serves at every baseline.
    """

    density: float
    transparency: float
    unit_baseline_m: float
    hold_error_m: float = 0.0
    rays: str = "nadir"
    altitude_m: float = math.inf
    slices: Callable[[], VisibilityModel] | None = None

    @property
    def name(self) -> str:
        """Name of the model."""
        return "uniform"

    @property
    def heading_deg(self) -> None:
        """None: the volume is the same from every direction."""
        return None

    def at_heading(self, heading_deg: float) -> UniformModel:  # noqa: ARG002 (the interface has it)
        """The model itself."""
        return self

    @property
    def independent_baseline_m(self) -> float:
        """Baseline from which K = 1/N; under noise, but for less than rounding."""
        if self.hold_error_m == 0.0:
            return self.unit_baseline_m
        from aosplan.models.position_noise import NEGLIGIBLE

        return self.unit_baseline_m + NEGLIGIBLE * math.sqrt(2.0) * self.hold_error_m

    @property
    def sharp_baseline_m(self) -> float:
        """Baseline from which K = 1/N without noise."""
        return self.unit_baseline_m

    @property
    def widest_aperture_m(self) -> float:
        """Any aperture will do."""
        return math.inf

    @property
    def rises_with_baseline(self) -> bool:
        """Not where rays may be oblique: they pass more wood the wider the aperture is.

        With nadir rays V̂ never falls, nor under noise: a triangle that is symmetric and falls on
        either side stays so when it is blurred by a Gaussian (Wintner), so each pair shares less
        the farther it is apart.
        """
        return self.rays == "nadir"

    @property
    def rule_baseline_m(self) -> float | None:
        """The paper's optimal baseline: wider ones gain nothing but what noise takes."""
        return self.unit_baseline_m

    def predict(self, pattern: Sites, baseline_m: float) -> Prediction:
        """Density and shortfall of a pattern flown at a baseline."""
        if self.slices is not None and self.counts_slices(pattern, baseline_m):
            return self._with_own_digits(self.slices().predict(pattern, baseline_m))
        if self.rays != "nadir":
            return self._predict_oblique(pattern, baseline_m)
        dhat = baseline_m / self.unit_baseline_m
        shortfall = pattern_shortfall(pattern, dhat, self._spread)
        if self.slices is not None and self.hold_error_m > 0.0 and pattern.samples > 1:
            # Noise takes more from one d̂ for all heights than from the slices: were it not for the
            # smaller of both, V̂ would fall at the rule's baseline.
            shortfall = min(shortfall, self.slices().predict(pattern, baseline_m).shortfall)
        return Prediction(self.density, self.transparency, shortfall)

    def counts_slices(self, pattern: Sites, baseline_m: float) -> bool:
        """Whether a prediction takes the volume as slices: below the baseline of the rule."""
        below = baseline_m * pattern.nearest < self.unit_baseline_m * (1.0 - 1e-12)
        return self.slices is not None and pattern.samples > 1 and below

    def _with_own_digits(self, prediction: Prediction) -> Prediction:
        """A prediction of the slices with the density as it was given."""
        if self.rays != "nadir":
            return prediction
        return Prediction(self.density, self.transparency, prediction.shortfall)

    def predict_positions(self, positions_m: ArrayLike) -> Prediction:
        """Density and shortfall of samples at known positions, shape (N, 2), from the middle."""
        import numpy as np

        points = np.asarray(positions_m, dtype=np.float64)
        shortfall = positions_shortfall(points, self.unit_baseline_m)
        apart = shortfall * len(points) <= 1.0 + 1e-9  # no two are nearer than the rule's baseline
        if self.slices is not None and not apart:
            return self._with_own_digits(self.slices().predict_positions(points))
        if self.rays != "nadir":
            return self._predict_oblique_at(points, 0.0)
        return Prediction(self.density, self.transparency, shortfall)

    def hidden_at(self, positions_m: ArrayLike) -> Floats:
        """p of samples at known positions, shape (N,); rays off nadir pass more."""
        from aosplan.models.oblique_rays import hidden_shares

        log_t = math.log(self.transparency)
        return hidden_shares(positions_m, self.altitude_m, self.rays, log_t)

    def correlation(self, x_m: Floats, y_m: Floats) -> Floats:
        """Overlap of the occluders of two nadir samples: a triangle along either axis."""
        if self.slices is not None:
            return self.slices().correlation(x_m, y_m)
        import numpy as np

        along_x, along_y = (triangle(apart / self.unit_baseline_m, np) for apart in (x_m, y_m))
        overlap: Floats = along_x * along_y
        return overlap

    def at_best(self, pattern: Sites, baseline_m: float) -> Prediction:
        """The prediction itself, which is quick; of slices, their bound."""
        if self.slices is not None and self.counts_slices(pattern, baseline_m):
            return self._with_own_digits(self.slices().at_best(pattern, baseline_m))
        return self.predict(pattern, baseline_m)

    @property
    def _spread(self) -> float:
        """Standard deviation of the distance of a pair along one axis, over the unit baseline."""
        return math.sqrt(2.0) * self.hold_error_m / self.unit_baseline_m

    def _predict_oblique(self, pattern: Sites, baseline_m: float) -> Prediction:
        import numpy as np

        from aosplan.models.oblique_rays import bundle
        from aosplan.models.position_noise import overlaps

        if isinstance(pattern, Spiral):
            points = baseline_m * np.array(list(pattern.offsets()))
            return self._predict_oblique_at(points, self._spread)
        log_t = math.log(self.transparency)
        rays = bundle(pattern, baseline_m, self.altitude_m, self.rays, log_t)
        dhat = baseline_m / self.unit_baseline_m
        along_x = overlaps(pattern.columns, dhat, self._spread)
        along_y = overlaps(pattern.rows, dhat * pattern.row_pitch, self._spread)

        def shared(dy: int, dx: int, lengths: Any) -> Any:
            overlap = along_y[dy] * along_x[dx] if dy or dx else 1.0
            return overlap * np.expm1(np.minimum(-log_t * lengths, 700.0))

        return rays.predict((len(along_y) - 1, len(along_x) - 1), shared)

    def _predict_oblique_at(self, positions_m: ArrayLike, spread: float) -> Prediction:
        import numpy as np

        from aosplan.models.oblique_rays import predict_scattered
        from aosplan.models.position_noise import blurred_overlap

        log_t = math.log(self.transparency)

        def between(x: Any, y: Any, lengths: Any) -> Any:
            apart = np.array([x, y]) / self.unit_baseline_m
            overlap = blurred_overlap(apart, spread).prod(axis=0)
            return overlap * np.expm1(np.minimum(-log_t * lengths, 700.0))

        points = np.asarray(positions_m, dtype=np.float64)
        return predict_scattered(points, self.altitude_m, self.rays, log_t, between)
