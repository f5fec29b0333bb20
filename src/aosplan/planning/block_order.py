"""The order in which the blocks of a flight are flown so that a target is found early.

A *block* is a part of a flight over an area that is flown in one piece, in one of two directions.
The photos of a block add to those of the blocks before it, because a place may need photos of
several blocks.  If the target is found at all, it is found by the time t with the probability
P(t) / P(end), where P is the probability of success.  The mean time until it is found is therefore
the integral of 1 - P(t) / P(end).  P is assumed to be linear within a block.

An order is built by repeatedly adding the block with the largest gain of P per time.  This time
includes the way to the block.  This is done for each possible first block.  The best orders are
then improved by moving and exchanging blocks and by reversing parts, until no such change improves
them further.  If the ways between blocks take no time and the gains of the blocks are independent,
the order by gain per time is optimal (Smith, 1956, Various optimizers for single-stage production).
"""

from __future__ import annotations

import itertools
import math
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Whole = NDArray[np.int64]

LEVELS = 100
"""Number of steps into which the share of the photos of a place is divided. The probability of
detection is stored for each step.
"""

STARTS = 3
"""Number of orders by gain per time that are improved."""

BETTER = 1e-9
"""Smallest relative improvement that counts."""

Order = tuple[tuple[int, int], ...]
"""Blocks in flight order, each with its direction: 0, or 1 for the reverse."""


class Places(NamedTuple):
    """The places of an area.

    Attributes
    ----------
    weights
        Shape (places,): probability that the target is at the place and found with all photos.
    photos
        Shape (places,): number of all photos that see the place.
    found
        Shape (`LEVELS` + 1,): probability of detection with 0 %, 1 % … 100 % of the photos of a
        place, divided by that with all of them.
    """

    weights: Floats
    photos: Whole
    found: Floats

    def success(self, counts: Whole) -> Floats:
        """Probability of success after the given numbers of photos have been taken.

        Parameters
        ----------
        counts
            Shape (…, places): number of photos of each place.
        """
        level = (counts * LEVELS) // np.maximum(self.photos, 1)
        success: Floats = self.found[np.minimum(level, LEVELS)] @ self.weights
        return success


class Blocks(NamedTuple):
    """The blocks of a flight.

    Attributes
    ----------
    counts
        Shape (blocks, places): number of photos of each block that see each place.
    time_s
        Shape (blocks, 2): time from the first point to the last, in both directions.
    ends_m
        Shape (blocks, 2, 2): first and last point, metres east and north.
    """

    counts: Whole
    time_s: Floats
    ends_m: Floats

    def start(self, block: int, way: int) -> tuple[float, float]:
        """The point at which a block begins if it is flown in the given direction."""
        east, north = self.ends_m[block, way].tolist()
        return east, north

    def stop(self, block: int, way: int) -> tuple[float, float]:
        """The point at which a block ends if it is flown in the given direction."""
        return self.start(block, 1 - way)


class Ways(NamedTuple):
    """Ways between blocks.

    Attributes
    ----------
    leg_s
        Function with the time between two points, metres east and north.
    climb_s
        Time of the climb after take-off, and of the descent before landing.
    home
        The take-off point; None: below the first point of the first block.
    battery_s
        Longest time of a flight.
    """

    leg_s: Callable[[tuple[float, float], tuple[float, float]], float]
    climb_s: float = 0.0
    home: tuple[float, float] | None = None
    battery_s: float = math.inf


class Step(NamedTuple):
    """A block in an order.

    Attributes
    ----------
    begun_s, ended_s, back_s
        Times at which it begins and ends, and at which the drone would be back.
    flight_s
        Time since the battery was changed.
    part
        Part of the block that is flown.
    """

    begun_s: float
    ended_s: float
    back_s: float
    flight_s: float
    part: float = 1.0


class BlockOrder:
    """The search for an order.

    Parameters
    ----------
    places, blocks, ways
        The problem.
    longest_s
        Time in which the drone must be back.  A block for which the time is too short is flown in
        part, and its gain is assumed to be proportional to this part.  Later blocks are not flown.
    """

    def __init__(
        self, places: Places, blocks: Blocks, ways: Ways, longest_s: float = math.inf
    ) -> None:
        self.places, self.blocks, self.ways, self.longest_s = places, blocks, ways, longest_s
        self._whole = float(places.weights.sum())
        self._legs: dict[tuple[tuple[float, float], tuple[float, float]], float] = {}

    # --- Value of an order ---

    def value(self, order: Order) -> tuple[float, float]:
        """Probability of success within the time, and the negative of the mean time [s] until the
        target is found.  Larger values are better, and the first value is more important than the
        second.
        """
        steps = self._steps(order)
        counts = np.cumsum(self.blocks.counts[[block for block, _ in order[: len(steps)]]], axis=0)
        if not len(counts):
            return 0.0, 0.0
        success = [0.0, *self.places.success(counts).tolist()]
        success[-1] = success[-2] + steps[-1].part * (success[-1] - success[-2])
        last = success[-1]
        if last <= 0.0:
            return 0.0, -steps[-1].ended_s
        missing_s = before_s = 0.0
        for step, low, high in zip(steps, success, success[1:], strict=False):
            missing_s += (step.begun_s - before_s) * (last - low)
            missing_s += (step.ended_s - step.begun_s) * (last - 0.5 * (low + high))
            before_s = step.ended_s
        return last, -missing_s / last

    def _steps(self, order: Order) -> list[Step]:
        found: list[Step] = []
        home = self._home(order)
        for number, (block, way) in enumerate(order):
            before = order[number - 1] if number else None
            step = self._step(found[-1] if found else None, before, block, way, home)
            over_s = step.back_s - self.longest_s
            if over_s > BETTER * self.longest_s:
                own_s = step.ended_s - step.begun_s
                if own_s > over_s:
                    ended_s, back_s = step.ended_s - over_s, self.longest_s
                    part = 1.0 - over_s / own_s
                    found.append(step._replace(ended_s=ended_s, back_s=back_s, part=part))
                break
            found.append(step)
        return found

    def _home(self, order: Order) -> tuple[float, float]:
        if self.ways.home is not None or not order:
            return self.ways.home or (0.0, 0.0)
        return self.blocks.start(*order[0])

    def _step(
        self,
        last: Step | None,
        before: tuple[int, int] | None,
        block: int,
        way: int,
        home: tuple[float, float],
    ) -> Step:
        """The next block of an order, with a new battery if the old one is not sufficient."""
        start, stop = self.blocks.start(block, way), self.blocks.stop(block, way)
        own_s, ways = float(self.blocks.time_s[block, way]), self.ways
        out_s, back_s = ways.climb_s + self._leg(home, start), self._leg(stop, home) + ways.climb_s
        flights = 1
        if out_s + own_s + back_s > ways.battery_s:  # The block needs several batteries.
            room_s = max(ways.battery_s - out_s - back_s, 1.0)
            flights = math.ceil(own_s / room_s)
        more_s = (flights - 1) * (out_s + back_s)
        if last is not None and before is not None:
            leg_s = self._leg(self.blocks.stop(*before), start)
            flight_s = last.flight_s + leg_s + own_s
            if flight_s + back_s <= ways.battery_s:
                begun_s = last.ended_s + leg_s
                return Step(begun_s, begun_s + own_s, begun_s + own_s + back_s, flight_s)
        begun_s = out_s if last is None else last.back_s + out_s
        ended_s = begun_s + own_s + more_s
        return Step(begun_s, ended_s, ended_s + back_s, out_s + own_s / flights)

    def _leg(self, start: tuple[float, float], stop: tuple[float, float]) -> float:
        key = start, stop
        if key not in self._legs:
            self._legs[key] = self.ways.leg_s(start, stop)
        return self._legs[key]

    # --- Search ---

    def built(self, usual: Order) -> list[Order]:
        """The usual order, and for each block the better of the two orders by gain per time that
        begin with it: one for each direction of the block.  The best order is the first one.
        """
        greedy = [
            max((self._greedy((block, way)) for way in (0, 1)), key=self.value)
            for block, _ in usual
        ]
        return sorted(dict.fromkeys([usual, *greedy]), key=self.value, reverse=True)

    def best(self, orders: list[Order]) -> Order:
        """The best order after some of the first orders have been improved.

        With a longest time, several orders are improved, because they may contain different blocks.
        """
        starts = 1 if math.isinf(self.longest_s) else STARTS
        return max(map(self.improved, orders[:starts]), key=self.value)

    def _greedy(self, first: tuple[int, int]) -> Order:
        """An order that begins with a block and continues with the largest gain per time."""
        order = [first]
        home = self._home((first,))
        step = self._step(None, None, *first, home)
        counts = self.blocks.counts[first[0]].copy()
        left = [block for block in range(len(self.blocks.counts)) if block != first[0]]
        success = float(self.places.success(counts))
        while left:
            gains = self.places.success(counts + self.blocks.counts[left]) - success
            following = {
                (block, way): (self._step(step, order[-1], block, way, home), gain)
                for block, gain in zip(left, gains.tolist(), strict=True)
                for way in (0, 1)
            }

            def rate(
                place: tuple[int, int],
                following: dict[tuple[int, int], tuple[Step, float]] = following,
                done_s: float = step.ended_s,
            ) -> tuple[bool, float]:
                next_step, gain = following[place]
                fits = next_step.back_s <= self.longest_s * (1.0 + BETTER)
                return fits, gain / max(next_step.ended_s - done_s, BETTER)

            chosen = max(following, key=rate)
            step, gain = following[chosen]
            order.append(chosen)
            counts += self.blocks.counts[chosen[0]]
            success += gain
            left.remove(chosen[0])
        return tuple(order)

    def improved(self, order: Order) -> Order:
        """An order that no change improves: no move of a block, no exchange of two blocks, and no
        reversal of a part.
        """
        value, tried = self.value(order), 0
        changes = list(self._changes(len(order)))
        for change in itertools.cycle(changes):
            other = change(order)
            found = self.value(other)
            if self._is_better(found, value):
                order, value, tried = other, found, 0
            tried += 1
            if tried > len(changes):
                break
        return order

    def _is_better(self, one: tuple[float, float], other: tuple[float, float]) -> bool:
        if abs(one[0] - other[0]) > BETTER * self._whole:
            return one[0] > other[0]
        return one[1] > other[1] + BETTER * abs(other[1])

    @staticmethod
    def _changes(size: int) -> Iterator[Callable[[Order], Order]]:
        """Yield the changes that are tried."""
        for place, to, turn in itertools.product(range(size), range(size), (0, 1)):
            if place != to or turn:
                yield partial(_moved, place, to, turn)
        for first, last in itertools.combinations(range(size), 2):
            yield partial(_exchanged, first, last)
            yield partial(_reversed, first, last)


def _moved(place: int, to: int, turn: int, order: Order) -> Order:
    block, way = order[place]
    rest = order[:place] + order[place + 1 :]
    return (*rest[:to], (block, way ^ turn), *rest[to:])


def _exchanged(first: int, last: int, order: Order) -> Order:
    changed = list(order)
    changed[first], changed[last] = order[last], order[first]
    return tuple(changed)


def _reversed(first: int, last: int, order: Order) -> Order:
    part = tuple((block, 1 - way) for block, way in order[first : last + 1][::-1])
    return order[:first] + part + order[last + 1 :]
