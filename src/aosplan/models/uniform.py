"""The uniform model: one volume with occluders of one kind (Kurmi, Schedl and Bimber, 2019).

The paper uses d̂ at a single height: the height of the occluder that determines the coverage rule.
At the baseline of this rule, neighbouring samples are independent, and V̂ = 1 - 1/N. At smaller
baselines, the occluders at most other heights still have d̂ close to 1. A prediction with the
single d̂ of that height would be much too small. For example, 49 samples that are 1 m apart at 50 m
have V̂ = 0.957 in simulated volumes of the default scene, but V̂ = 0.816 is predicted with the d̂
of the rule. Below the baseline of the rule, the volume is therefore treated as slices that are one
occluder thick (`aosplan.models.layered`). In this example, the prediction with slices is 0.965.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.grid.patterns import Pattern
from aosplan.models.model import Prediction
from aosplan.models.positions import pattern_shortfall, positions_shortfall
from aosplan.numerics import triangle

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from aosplan.grid.patterns import AnyPattern
    from aosplan.models.model import VisibilityModel

    Floats = NDArray[np.float64]


class UniformModel(NamedTuple):
    """Integrated density, and the baseline at which neighbouring samples become independent.

    - `unit_baseline_m`: the baseline with d̂ = 1.  By the coverage rule of the paper, it is the
      smallest baseline at which the required share of the occluders has d̂ >= 1
      (`aosplan.camera.disparity.coverage_baseline`).
    - `hold_error_m`: standard deviation of the positions around their sites, per axis
      (`aosplan.models.position_noise`).
    - `rays`: the kind of rays (`aosplan.models.oblique_rays`).  All kinds except ``nadir`` need
      `altitude_m`.
    - `slices`: function that returns the volume as a layered model. If it is None, a single d̂ is
      used at every baseline.
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
        """None, because the volume has no direction."""
        return None

    @property
    def independent_baseline_m(self) -> float:
        """Smallest baseline at which K = 1/N. With position noise, K = 1/N is true within rounding
        errors.
        """
        if self.hold_error_m == 0.0:
            return self.unit_baseline_m
        from aosplan.models.position_noise import NEGLIGIBLE

        return self.unit_baseline_m + NEGLIGIBLE * math.sqrt(2.0) * self.hold_error_m

    @property
    def sharp_baseline_m(self) -> float:
        """Smallest baseline at which K = 1/N without position noise."""
        return self.unit_baseline_m

    @property
    def widest_aperture_m(self) -> float:
        """inf, because the volume has no horizontal limits."""
        return math.inf

    @property
    def rises_with_baseline(self) -> bool:
        """Whether V̂ never decreases if the baseline increases. This is true only for nadir rays,
        because slanted rays meet more occluders if the aperture is wider.

        With nadir rays, it is true even with position noise. The reason is a theorem of Wintner: if
        a symmetric function decreases on both sides, its convolution with a Gaussian also decreases
        on both sides. The expected overlap of a pair of samples therefore decreases with their
        distance.
        """
        return self.rays == "nadir"

    @property
    def rule_baseline_m(self) -> float | None:
        """The optimal baseline of the paper. A larger baseline is useful only if there is position
        noise.
        """
        return self.unit_baseline_m

    def predict(self, pattern: AnyPattern, baseline_m: float) -> Prediction:
        """Density and shortfall of a pattern that is flown with a baseline."""
        if self.slices is not None and self.counts_slices(pattern, baseline_m):
            return self._with_own_digits(self.slices().predict(pattern, baseline_m))
        if self.rays != "nadir":
            return self._predict_oblique(pattern, baseline_m)
        dhat = baseline_m / self.unit_baseline_m
        shortfall = pattern_shortfall(pattern, dhat, self._spread)
        if self.slices is not None and self.hold_error_m > 0.0 and pattern.samples > 1:
            # With position noise, one d̂ for all heights gives a smaller V̂ than slices. If only
            # one of the two models were used on each side of the baseline of the rule, V̂ would
            # drop there. The smaller one of the shortfalls of the two models is therefore used.
            shortfall = min(shortfall, self.slices().predict(pattern, baseline_m).shortfall)
        return Prediction(self.density, self.transparency, shortfall)

    def counts_slices(self, pattern: AnyPattern, baseline_m: float) -> bool:
        """Whether the volume is treated as slices. This is the case if the baseline is smaller than
        the baseline of the coverage rule.
        """
        below = baseline_m * pattern.nearest < self.unit_baseline_m * (1.0 - 1e-12)
        return self.slices is not None and pattern.samples > 1 and below

    def _with_own_digits(self, prediction: Prediction) -> Prediction:
        """A prediction from the slices, in which the density is replaced by the given density of
        the volume.
        """
        if self.rays != "nadir":
            return prediction
        return Prediction(self.density, self.transparency, prediction.shortfall)

    def predict_positions(self, positions_m: ArrayLike) -> Prediction:
        """Density and shortfall of samples at known positions from the centre, shape (N, 2)."""
        import numpy as np

        points = np.asarray(positions_m, dtype=np.float64)
        shortfall = positions_shortfall(points, self.unit_baseline_m)
        # In this case, no two samples are closer than the baseline of the coverage rule.
        apart = shortfall * len(points) <= 1.0 + 1e-9
        if self.slices is not None and not apart:
            return self._with_own_digits(self.slices().predict_positions(points))
        if self.rays != "nadir":
            return self._predict_oblique_at(points, 0.0)
        return Prediction(self.density, self.transparency, shortfall)

    def hidden_at(self, positions_m: ArrayLike) -> Floats:
        """p of samples at known positions, shape (N,). The values differ, because rays meet more
        occluders if they are more slanted.
        """
        from aosplan.models.oblique_rays import hidden_shares

        log_t = math.log(self.transparency)
        return hidden_shares(positions_m, self.altitude_m, self.rays, log_t)

    def correlation(self, x_m: Floats, y_m: Floats) -> Floats:
        """Overlap of the occluders of two nadir samples: the product of one triangle function along
        each axis.
        """
        if self.slices is not None:
            return self.slices().correlation(x_m, y_m)
        import numpy as np

        along_x, along_y = (triangle(apart / self.unit_baseline_m, np) for apart in (x_m, y_m))
        overlap: Floats = along_x * along_y
        return overlap

    def at_best(self, pattern: AnyPattern, baseline_m: float) -> Prediction:
        """The same as `predict`.  If the volume is treated as slices, the result is the fast upper
        bound of the visibility from the layered model.
        """
        if self.slices is not None and self.counts_slices(pattern, baseline_m):
            return self._with_own_digits(self.slices().at_best(pattern, baseline_m))
        return self.predict(pattern, baseline_m)

    @property
    def _spread(self) -> float:
        """Standard deviation of the distance of a pair along one axis, divided by the unit
        baseline.
        """
        return math.sqrt(2.0) * self.hold_error_m / self.unit_baseline_m

    def _predict_oblique(self, pattern: AnyPattern, baseline_m: float) -> Prediction:
        import numpy as np

        from aosplan.models.oblique_rays import bundle
        from aosplan.models.position_noise import overlaps

        if not isinstance(pattern, Pattern):
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
