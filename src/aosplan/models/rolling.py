"""Integrals of the last N photos on a long line.

The integral moves along with the drone.  The camera takes one photo per baseline b, that is every
b/v seconds at the speed v.  If b/v is less than the shortest interval τ of the camera, the distance
between photos is v τ instead.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.grid.patterns import Pattern

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.models.model import VisibilityModel

SPEEDS_MPS = (1.0, 2.0, 5.0, 10.0, 15.0)
"""Speeds for which an integral is predicted, in addition to the speed of the plan."""


class LineIntegral(NamedTuple):
    """The integral of N consecutive photos on a line: spacing, length and prediction."""

    samples: int
    spacing_m: float
    length_m: float
    speed_mps: float
    interval_s: float
    duration_s: float
    expected: float
    normalized: float


class Continuous(NamedTuple):
    """Integrals along a line: for several numbers of photos at the speed of the plan, and for the
    planned number of photos at several speeds.

    `fastest_mps` is b/τ, the highest speed at which photos are one baseline apart.  `fastest_mps`
    is None if the camera's shortest interval is not known.
    """

    by_samples: tuple[LineIntegral, ...]
    by_speed: tuple[LineIntegral, ...]
    fastest_mps: float | None

    def document(self) -> dict[str, Any]:
        """The table as plain values, ``continuous`` in a plan's JSON document."""
        return {
            "fastest_mps": self.fastest_mps,
            "by_samples": [integral._asdict() for integral in self.by_samples],
            "by_speed": [integral._asdict() for integral in self.by_speed],
        }


def continuous_of(
    model: VisibilityModel,
    samples: int,
    baseline_m: float,
    *,
    speed_mps: float,
    shortest_interval_s: float | None = None,
    photos: int | None = None,
) -> Continuous:
    """Integrals along a line of any length.

    Parameters
    ----------
    model
        Model that predicts a line of samples.
    samples, baseline_m
        N and b of the plan.
    speed_mps
        Speed of the plan.
    shortest_interval_s
        τ of the camera, if it is known.
    photos
        Number of photos on the whole line.  Integrals of more photos are left out.
    """

    def integral(count: int, speed: float) -> LineIntegral:
        interval = max(baseline_m / speed, shortest_interval_s or 0.0)
        spacing = interval * speed
        predicted = model.predict(Pattern(1, count), spacing)
        return LineIntegral(
            samples=count,
            spacing_m=spacing,
            length_m=(count - 1) * spacing,
            speed_mps=speed,
            interval_s=interval,
            duration_s=(count - 1) * interval,
            expected=predicted.expected,
            normalized=predicted.normalized,
        )

    def told(integrals: Iterator[LineIntegral]) -> tuple[LineIntegral, ...]:
        widest = model.widest_aperture_m * (1.0 + 1e-9)
        return tuple(found for found in integrals if found.length_m <= widest)

    counts = {1, max(samples // 4, 1), max(samples // 2, 1), samples, 2 * samples}
    counts = {count for count in counts if photos is None or count <= photos}
    return Continuous(
        by_samples=told(integral(count, speed_mps) for count in sorted(counts)),
        by_speed=told(integral(samples, v) for v in sorted({*SPEEDS_MPS, speed_mps})),
        fastest_mps=None if shortest_interval_s is None else baseline_m / shortest_interval_s,
    )
