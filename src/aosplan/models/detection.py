"""Probability of detection of a target below the canopy, such as a person on the ground.

s is the seen share of the target (`aosplan.models.seen_share`), u the threshold of the detector,
and sd the standard deviation of its output (`aosplan.models.clutter`).  A target of contrast C is
detected with probability

    POD = E_s Φ̄((u - M (1 - β) (T - s) - η C s)/sd'(s)).

The box contains the target, so the subtraction of the mean of the box reduces the signal; η is the
share of the signal that remains. sd' is the standard deviation of the output if there is a target,
which hides the ground below it. A curve of POD against C shows the effect of other contrasts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.grid.pair_offsets import quadrant_counts
from aosplan.grid.patterns import Pattern
from aosplan.models.clutter import Radiances, clutter_of, threshold
from aosplan.models.crown_clutter import crown_covariances
from aosplan.models.seen_share import CELL_M, UNSEEN, SeenShare, atom
from aosplan.models.signatures import FALSE_ALARMS, PERSON_M, SIGNATURES, Signature
from aosplan.models.target_window import Target
from aosplan.models.window_pairs import TABLE, Pairs, WindowPairs

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from aosplan.grid.patterns import AnyPattern
    from aosplan.models.clutter import Clutter
    from aosplan.scenes.scene import Layer

    Floats = NDArray[np.float64]

CURVE = (0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
"""Contrasts of the curve, in addition to the contrast of the signature."""

PERSON = Target(*PERSON_M)


class Detection(NamedTuple):
    """Seen share of a target and probability of its detection.

    Attributes
    ----------
    target
        Size of the target.
    signature
        Signature of the target and the canopy.
    assumed
        Name of the assumed signature; empty if the user gave the numbers.
    false_alarms
        Number of false alarms per hectare.
    seen
        Distribution of the seen share.
    threshold, deviation
        Threshold u of the detector's output, and standard deviation of the output without a
        target, both in units of σ_c.
    probability
        POD, probability of detection.
    curve
        Contrasts in increasing order, each with its POD.
    standard_error
        Standard error of `probability`, caused by the limited size of the plot; None if it is
        unknown.
    """

    target: Target
    signature: Signature
    assumed: str
    false_alarms: float
    seen: SeenShare
    threshold: float
    deviation: float
    probability: float
    curve: tuple[tuple[float, float], ...]
    standard_error: float | None = None

    @property
    def unseen(self) -> float:
        """Probability that the seen share of the target is below `UNSEEN`."""
        return 1.0 - self.seen.at_least(UNSEEN)

    def document(self) -> dict[str, Any]:
        """The object ``detection`` of a plan's JSON document."""
        return {
            "target_m": list(self.target),
            "probability": self.probability,
            "probability_by_contrast": [list(point) for point in self.curve],
            "seen_share": self.seen.document(),
            "contrast": self.signature.contrast,
            "canopy_offset": self.signature.canopy_offset,
            "crown_share": self.signature.crown_share,
            "false_alarms_per_hectare": self.false_alarms,
            "threshold": self.threshold,
            "clutter": self.deviation,
            "assumed": self.assumed or None,
            "uncertainty": self.standard_error,
        }


def contrasts(signature: Signature) -> list[float]:
    """Contrasts of the curve: the contrast of the signature, and the contrasts in `CURVE` with the
    same sign.
    """
    sign = -1.0 if signature.contrast < 0.0 else 1.0
    return sorted({sign * contrast for contrast in CURVE} | {signature.contrast})


class DetectionModel:
    """Detection of one target below the independent slices of one scene, for any pattern.

    The integrals over pairs of photos are computed once for each offset.  `for_search` makes a
    table of the integrals.  With this table, a prediction for a pattern and a baseline takes about
    a millisecond.

    Parameters
    ----------
    layers
        Slices, with heights above the ground on which the target lies.
    altitude_m
        Altitude of the cameras above that ground.
    target
        Size of the target.
    signature, false_alarms
        Parameters of the detector; see `Detection`.
    assumed
        Name of the assumed signature.
    local
        Whether the detector subtracts the mean of the box around its window.
    rigid
        As in `aosplan.models.window_pairs.WindowPairs`.
    """

    def __init__(
        self,
        layers: Sequence[Layer],
        altitude_m: float,
        target: Target = PERSON,
        signature: Signature = SIGNATURES["thermal-dawn"],
        *,
        false_alarms: float = FALSE_ALARMS,
        assumed: str = "",
        local: bool = True,
        rigid: bool = True,
    ) -> None:
        self.pairs = WindowPairs(layers, altitude_m, target, rigid=rigid)
        self.target = target
        self.signature = signature
        self.false_alarms = false_alarms
        self.assumed = assumed
        self._local = local
        self._rigid = rigid

    def for_search(self) -> DetectionModel:
        """The same model with a table of the integrals, which it interpolates."""
        self.pairs.tabulate()
        return self

    def predict(self, pattern: AnyPattern, baseline_m: float) -> Detection:
        """Detection with a pattern flown at a baseline."""
        return self._detect(*self._of_pattern(pattern, baseline_m))

    def probability(self, pattern: AnyPattern, baseline_m: float) -> float:
        """Probability of detection with a pattern, without the other results of `predict`."""
        return self._probability(*self._of_pattern(pattern, baseline_m))

    def probability_at(self, positions_m: Floats) -> float:
        """Probability of detection with photos from any positions, without the other results of
        `predict_positions`.
        """
        points = np.asarray(positions_m, dtype=np.float64)
        return self._probability(*self._statistics(points, *_apart(points)))

    def predict_positions(self, positions_m: Floats) -> Detection:
        """Detection with photos from any positions, shape (N, 2), along the axes of
        the occluders.
        """
        points = np.asarray(positions_m, dtype=np.float64)
        return self._detect(*self._statistics(points, *_apart(points)))

    def _of_pattern(self, pattern: AnyPattern, baseline_m: float) -> tuple[Clutter, SeenShare]:
        offsets = baseline_m * np.array(list(pattern.offsets()), dtype=np.float64)
        return self._statistics(offsets, *_offsets_of(pattern, baseline_m))

    def _statistics(
        self, sites_m: Floats, x_m: Floats, y_m: Floats, share: Floats
    ) -> tuple[Clutter, SeenShare]:
        """Clutter and seen share for photos.

        `x_m` and `y_m` are distances between photos, and `share` is the share of all pairs of
        photos at each of these distances.
        """
        mean = self._mean(x_m, y_m, share)
        transparency = self.pairs.transparency
        mean = self._with_crowns(mean, sites_m)
        _, *canopy = upright(self.signature)
        clutter = clutter_of(
            mean, self.pairs.kernels, transparency, Radiances(*canopy), local=self._local
        )
        looks = len(sites_m) * self.target.area_m2 / CELL_M**2
        alone = atom(
            self.pairs.layers, self.pairs.altitude_m, sites_m, self.target, rigid=self._rigid
        )
        seen = SeenShare.of_moments(transparency, float(mean.window[0, 0]), alone, looks)
        return clutter, seen

    def _mean(self, x_m: Floats, y_m: Floats, share: Floats) -> Pairs:
        """Weighted means of the integrals over offsets.  The weights are the shares of all
        pairs.
        """
        near = (x_m <= self.pairs.reach_m) & (y_m <= self.pairs.reach_m)
        if np.count_nonzero(near) > TABLE**2:
            self.pairs.tabulate()
        found, weights = self.pairs.at(x_m[near], y_m[near]), share[near]
        far = self.pairs.far
        rest = 1.0 - float(weights.sum())
        return Pairs(
            np.tensordot(weights, found.window, 1) + rest * far.window,
            np.tensordot(weights, found.box, 1) + rest * far.box,
        )

    def _with_crowns(self, mean: Pairs, sites_m: Floats) -> Pairs:
        """The means with an additional row for crowns. The row includes pairs of rays that end at
        the same occluder and independent pairs.
        """
        pairs = self.pairs
        crowns = crown_covariances(
            sites_m,
            pairs.heights_m,
            pairs.ends,
            pairs.altitude_m,
            self.target,
            pairs.kernels,
        )
        hidden = (1.0 - pairs.transparency) ** 2
        window, box = (
            np.vstack([rows, rows[0] + hidden * crown])
            for rows, crown in zip(mean, crowns, strict=True)
        )
        return Pairs(window, box)

    def _probability(self, clutter: Clutter, seen: SeenShare) -> float:
        level = threshold(clutter, seen, self.false_alarms)
        return detected(clutter, seen, level, abs(self.signature.contrast), self._kept)

    def _detect(self, clutter: Clutter, seen: SeenShare) -> Detection:
        level = threshold(clutter, seen, self.false_alarms)
        curve = tuple(
            (contrast, detected(clutter, seen, level, abs(contrast), self._kept))
            for contrast in contrasts(self.signature)
        )
        return Detection(
            self.target,
            self.signature,
            self.assumed,
            self.false_alarms,
            seen,
            level,
            clutter.total_deviation(seen.variance),
            dict(curve)[self.signature.contrast],
            curve,
        )

    @property
    def _kept(self) -> float:
        return self.target.matched * (self.target.kept if self._local else 1.0)


def upright(signature: Signature) -> Signature:
    """The equivalent signature with positive contrast.  A cold target is detected in the same way
    as a warm target.
    """
    if signature.contrast >= 0.0:
        return signature
    return Signature(-signature.contrast, -signature.canopy_offset, signature.crown_share)


def detected(
    clutter: Clutter, seen: SeenShare, level: float, contrast: float, kept: float
) -> float:
    """POD of a target with a given contrast at a given threshold; `kept` is η."""
    from scipy.special import ndtr

    share = seen.nodes
    output = clutter.mean(share) + kept * contrast * share
    found = ndtr((output - level) / clutter.deviation(share, target=True))
    return min(float(seen.weights @ found), 1.0)


def _offsets_of(pattern: AnyPattern, baseline_m: float) -> tuple[Floats, Floats, Floats]:
    """Distances along x and y between the photos of a pattern, and the share of all pairs at each
    distance.
    """
    if not isinstance(pattern, Pattern):
        return _apart(baseline_m * np.array(list(pattern.offsets())))
    # The integrals are equal in all four quadrants.
    pairs = quadrant_counts(pattern, pattern.rows - 1, pattern.columns - 1)
    y, x = np.nonzero(pairs)
    x_m: Floats = x * np.float64(baseline_m)
    y_m: Floats = y * np.float64(baseline_m * pattern.row_pitch)
    return x_m, y_m, pairs[y, x] / pattern.samples**2


def _apart(positions_m: Floats) -> tuple[Floats, Floats, Floats]:
    """Distances along x and y between photos at any positions, and the share of all pairs at each
    distance.
    """
    points = np.asarray(positions_m, dtype=np.float64)
    apart = np.round(np.abs(points[:, None] - points[None]).reshape(-1, 2), 6)
    # The distances are stored as complex numbers, because sorting these is several times as fast as
    # sorting rows.
    offsets, counts = np.unique(apart[:, 0] + 1j * apart[:, 1], return_counts=True)
    return offsets.real.copy(), offsets.imag.copy(), counts / float(len(points)) ** 2
