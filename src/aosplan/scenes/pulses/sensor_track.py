"""Positions of the sensor, computed from pulses with several returns.

The straight line through the first and the last return of a pulse passes through the sensor. In
each flight line, the sensor is assumed to move with constant velocity: S(t) = S₀ + V t. S₀ and V
are found by a robust fit (Tukey's biweight), which minimises the distances between the sensor and
the lines of the pulses. The weight of a pulse contains the square of the distance between its two
returns.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.scenes.pulses.grouping import Pulses
    from aosplan.scenes.pulses.returns import Returns

    Floats = NDArray[np.float64]

FEWEST_PULSES = 100
"""Smallest number of pulses with several returns to which the track of a flight line is fitted."""

SHORTEST_LEVER_M = 1.0
LARGEST_RESIDUAL_DEG = 0.5
"""Largest median residual of a valid track.  If the fit ignored the motion of the sensor, the
residual would be 1 to 3°.
"""

TUKEY = 4.685
ROUNDS = 20
DRAWS = 60
DRAWN = 12
"""Number of pulses per random sample.  If 10 % of the pulses are outliers, about every fourth
sample contains no outlier.
"""

JUDGES = 1000
DRAW_SEED = 1
MOST_PULSES = 20_000


class SensorTrack(NamedTuple):
    """Motion of the sensor in one flight line: its position at time `middle_s`, and its velocity.

    `residual_deg` is the median angle between the pulses and the directions to the sensor.
    """

    position_m: Floats
    velocity_mps: Floats
    middle_s: float
    residual_deg: float
    pulses: int

    def at(self, time_s: Floats) -> Floats:
        """Positions of the sensor at the given times, shape (3, n)."""
        since = time_s - self.middle_s
        places: Floats = self.position_m[:, np.newaxis] + self.velocity_mps[:, np.newaxis] * since
        return places


def fitted(returns: Returns, pulses: Pulses) -> SensorTrack | None:
    """The track of a flight line; None if it has too few pulses with several returns.

    Parameters
    ----------
    returns, pulses
        Pulses of one flight line.
    """
    top, bottom = returns.xyz_m[:, pulses.first], returns.xyz_m[:, pulses.last]
    lever = top - bottom
    length = np.sqrt((lever * lever).sum(axis=0))
    used = np.flatnonzero((length >= SHORTEST_LEVER_M) & (lever[2] > 0.0))
    if used.size < FEWEST_PULSES:
        return None
    if used.size > MOST_PULSES:
        used = used[:: -(-used.size // MOST_PULSES)]
    length, direction = length[used], lever[:, used] / length[used]
    middle = 0.5 * (top + bottom)[:, used]
    time_s = returns.time_s[pulses.first[used]]
    middle_s = float(np.median(time_s))
    spread_s = max(float(np.ptp(time_s)), 1e-9)
    # The times are scaled to about 1, because the equations are then well conditioned.
    since = (time_s - middle_s) / spread_s
    found = _start(middle, direction, since, length)
    for _ in range(ROUNDS):
        place = found[:3, np.newaxis] + found[3:, np.newaxis] * since
        angle, distance = _angles(place - middle, direction)
        # The error of the angle of a pulse is the position error of its returns divided by the
        # distance between them.
        scaled = angle * length
        # If the errors along two axes are normal, the distance is Rayleigh distributed, with the
        # median 1.1774 σ.
        spread = float(np.median(scaled)) / 1.1774 + 1e-12
        share = np.clip(scaled / (TUKEY * spread), 0.0, 1.0)
        weight = length * length * (1.0 - share * share) ** 2 / np.maximum(distance, 1.0) ** 2
        better = _least_squares(middle, direction, since, weight)
        moved = np.abs(better - found).max()
        found = better
        if moved < 1e-3:
            break
    heavy = length >= np.median(length)
    return SensorTrack(
        found[:3],
        found[3:] / spread_s,
        middle_s,
        float(np.degrees(np.median(angle[heavy]))),
        int(used.size),
    )


def _start(middle: Floats, direction: Floats, since: Floats, length: Floats) -> Floats:
    """Start values of S₀ and V for the robust fit.

    They are fitted to many small random samples of pulses, and the values that fit the largest
    number of pulses are chosen. A least-squares fit to all pulses would be dominated by outliers.
    Outliers occur if returns of two pulses were grouped into one pulse. Such returns are far apart,
    and outliers therefore have large weights.
    """
    rng = np.random.Generator(np.random.PCG64(DRAW_SEED))
    judges = rng.choice(length.size, min(length.size, JUDGES), replace=False)
    best, least = np.zeros(6), np.inf
    for _ in range(DRAWS):
        few = rng.choice(length.size, DRAWN, replace=False)
        found = _least_squares(middle[:, few], direction[:, few], since[few], np.ones(DRAWN))
        place = found[:3, np.newaxis] + found[3:, np.newaxis] * since[judges]
        to_sensor = place - middle[:, judges]
        angle, _ = _angles(to_sensor, direction[:, judges])
        # The sensor is above the returns, so directions to sensors below them are wrong.
        angle[to_sensor[2] < 0.0] = np.pi
        missed = float(np.median(angle * length[judges]))
        if missed < least:
            best, least = found, missed
    return best


def _least_squares(middle: Floats, direction: Floats, since: Floats, weight: Floats) -> Floats:
    """S₀ and V that minimise Σ w |(I - d dᵀ)(S₀ + V t - m)|², shape (6,)."""
    across = np.eye(3)[:, :, np.newaxis] - direction[:, np.newaxis] * direction[np.newaxis]
    of_middle = np.einsum("ijn,jn->in", across, middle)
    powers = [weight, weight * since, weight * since * since]
    moment = [(across * power).sum(axis=2) for power in powers]
    matrix = np.block([[moment[0], moment[1]], [moment[1], moment[2]]])
    right = np.concatenate([(of_middle * power).sum(axis=1) for power in powers[:2]])
    solution: Floats = np.linalg.lstsq(matrix, right, rcond=None)[0]
    return solution


def _angles(to_sensor: Floats, direction: Floats) -> tuple[Floats, Floats]:
    """Angles [rad] between the lines of the pulses and the directions to the sensor, and distances
    to the sensor.
    """
    distance = np.sqrt((to_sensor * to_sensor).sum(axis=0))
    cross = np.cross(to_sensor.T, direction.T)
    sine = np.sqrt((cross * cross).sum(axis=1)) / distance
    return np.arcsin(np.minimum(sine, 1.0)), distance
