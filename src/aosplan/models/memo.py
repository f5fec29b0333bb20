"""Storage of a model's predictions, for searches and for scenarios that share the model."""

from __future__ import annotations

from functools import wraps
from typing import TYPE_CHECKING, Protocol, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

    from aosplan.grid.patterns import AnyPattern
    from aosplan.models.model import Prediction

    Known = dict[tuple[AnyPattern, float, float | None, float], Prediction]

MOST_KEPT = 4096
"""Largest number of predictions that one model stores."""


class StoredPredictions(Protocol):
    """A model that stores its predictions. The storage is shared with copies of the model at other
    headings.
    """

    hold_error_m: float

    @property
    def heading_deg(self) -> float | None:
        """As in `aosplan.models.model.VisibilityModel`."""

    _predictions: Known


Model = TypeVar("Model", bound=StoredPredictions)


def remembered(
    predict: Callable[[Model, AnyPattern, float], Prediction],
) -> Callable[[Model, AnyPattern, float], Prediction]:
    """Decorate a method ``predict`` so that it returns a stored prediction if there is one."""

    @wraps(predict)
    def recalled(self: Model, pattern: AnyPattern, baseline_m: float) -> Prediction:
        key = pattern, baseline_m, self.heading_deg, self.hold_error_m
        known = self._predictions
        if key not in known:
            if len(known) >= MOST_KEPT:
                known.clear()
            known[key] = predict(self, pattern, baseline_m)
        return known[key]

    return recalled
