"""Grouping of returns into pulses, by file order and return number, and the energy of
the returns.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from aosplan.scenes.pulses.returns import Returns

    Floats = NDArray[np.float64]

SAME_TIME_S = 1e-6
"""Largest difference between the times of returns of one pulse. It equals the interval between
pulses of the fastest lasers.
"""

PLAUSIBLE_SUM = 0.15
"""Largest plausible deviation of the mean energy from 1, for pulses with several returns."""

FEWEST_OF_A_KIND = 50
"""The mean intensity of a kind of returns is used for calibration only if there are at least this
number of returns of this kind.
"""


class Pulses(NamedTuple):
    """Complete pulses.  Each pulse has all its returns from the first one that is present to the
    last one.

    Attributes
    ----------
    first, stop
        Shape (P,): pulse i consists of returns ``first[i]`` to ``stop[i] - 1``.
    """

    first: NDArray[np.intp]
    stop: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.first)

    @property
    def last(self) -> NDArray[np.intp]:
        """Index of the last return of each pulse."""
        return self.stop - 1

    def take(self, which: NDArray[np.bool_] | NDArray[np.intp]) -> Pulses:
        """Some of the pulses, by index or mask."""
        return Pulses(self.first[which], self.stop[which])


def grouped(returns: Returns, *, timed: bool) -> tuple[Returns, Pulses, float]:
    """Group returns into pulses.

    A pulse continues while the return number increases and the number of returns, the line and the
    time stay the same.  If most pulses are incomplete, the file is not in the order of measurement,
    and the returns are first sorted by line, time and return number.

    Returns
    -------
    tuple
        The returns in the order of the pulses, the complete pulses, and the share of the pulses
        that are complete.
    """
    pulses, share = _in_order(returns, timed=timed)
    if share < 0.8 and timed:
        order = np.lexsort((returns.number, returns.time_s, returns.line))
        ordered = returns.take(order)
        again, better = _in_order(ordered, timed=timed)
        if better > share:
            return ordered, again, better
    return returns, pulses, share


def _in_order(returns: Returns, *, timed: bool) -> tuple[Pulses, float]:
    number, count = returns.number.astype(np.intp), returns.total.astype(np.intp)
    begins = np.ones(number.size, dtype=np.bool_)
    begins[1:] = (np.diff(number) <= 0) | (np.diff(count) != 0) | (np.diff(returns.line) != 0)
    if timed:
        begins[1:] |= np.abs(np.diff(returns.time_s)) > SAME_TIME_S
    first = np.flatnonzero(begins)
    stop = np.append(first[1:], number.size)
    last = stop - 1
    complete = (number[last] == count[last]) & (number[last] - number[first] == last - first)
    complete &= number[first] >= 1
    return Pulses(first[complete], stop[complete]), float(complete.mean()) if first.size else 0.0


def equal_energies(returns: Returns) -> Floats:
    """Energy of each return, assuming that all n returns of a pulse have the same energy 1/n."""
    energies: Floats = 1.0 / np.maximum(returns.total, 1)
    return energies


def intensity_energies(returns: Returns, pulses: Pulses, low: NDArray[np.bool_]) -> Floats | None:
    """Energy of each return from its intensity; None if the intensities are not consistent.

    The intensity is divided by the mean intensity of single returns of the same kind (ground or
    canopy), which have all the energy of their pulses. A wide beam has few single returns in
    foliage. If there are too few, the pulses with several returns are used if at least one of these
    returns is from the ground. The intensity that corresponds to the whole energy of a pulse is
    then the sum of the intensities of the returns of these pulses from the canopy, divided by the
    sum of the energies that do not reach the ground. If intensity is proportional to energy, the
    resulting energies of a pulse with several returns add up to about 1. The sum is larger if the
    instrument adjusted its gain or recorded ranks instead of intensities. In this case the result
    is None.  Finally, the energies of each pulse are normalised to the sum 1.

    Parameters
    ----------
    returns
        All returns.
    pulses
        The complete pulses.
    low
        Shape (n,): the returns that are ground.
    """
    intensity = returns.intensity.astype(np.float64)
    single = np.zeros(intensity.size, dtype=np.bool_)
    single[pulses.first[returns.total[pulses.first] == 1]] = True
    whole = pulses.take(returns.number[pulses.first] == 1)
    several = returns.total[whole.first]
    ground, canopy = intensity[single & low], intensity[single & ~low]
    if ground.size < FEWEST_OF_A_KIND or ground.mean() <= 0.0:
        return None
    energy = intensity / ground.mean()
    if canopy.size >= FEWEST_OF_A_KIND:
        of_canopy = float(canopy.mean())
    else:
        of_ground = sums_of(whole, energy * low)
        both = (of_ground > 0.0) & (several > 1)
        left = float((1.0 - of_ground[both]).sum())
        if np.count_nonzero(both) < FEWEST_OF_A_KIND or left <= 0.0:
            return None
        of_canopy = float(sums_of(whole, intensity * ~low)[both].sum()) / left
    if of_canopy <= 0.0:
        return None
    energy[~low] = intensity[~low] / of_canopy
    sums = sums_of(whole, energy)
    for n in range(2, int(several.max(initial=1)) + 1):
        found = sums[several == n]
        if found.size >= FEWEST_OF_A_KIND and abs(found.mean() - 1.0) > PLAUSIBLE_SUM:
            return None
    if not (several > 1).any() or np.ptp(intensity) == 0.0:
        return None
    present = sums_of(pulses, energy)
    wanted: Floats = (pulses.stop - pulses.first) / returns.total[pulses.first]
    scale = wanted / np.where(present > 0.0, present, 1.0)
    normalised = equal_energies(returns)
    of_pulse = np.repeat(scale, pulses.stop - pulses.first)
    members = members_of(pulses)
    normalised[members] = np.where(
        np.repeat(present > 0.0, pulses.stop - pulses.first),
        energy[members] * of_pulse,
        normalised[members],
    )
    return normalised


def members_of(pulses: Pulses) -> NDArray[np.intp]:
    """Indices of the returns of the pulses, pulse by pulse."""
    lengths = pulses.stop - pulses.first
    starts = np.cumsum(lengths) - lengths
    members: NDArray[np.intp] = np.arange(int(lengths.sum())) + np.repeat(
        pulses.first - starts, lengths
    )
    return members


def sums_of(pulses: Pulses, values: Floats) -> Floats:
    """Sum of a quantity of returns over each pulse, shape (P,)."""
    owner = np.repeat(np.arange(len(pulses)), pulses.stop - pulses.first)
    sums = np.bincount(owner, values[members_of(pulses)], len(pulses))
    return sums.astype(np.float64, copy=False)
