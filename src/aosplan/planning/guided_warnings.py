"""Warnings of guided positions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.messages import Message

if TYPE_CHECKING:
    from collections.abc import Iterator

    from aosplan.models.model import Prediction
    from aosplan.planning.guided_result import GuidedResult

BY_CHANCE = 0.05
"""A warning is given if the values of V from the two halves of the pulses differ by at
least this.
"""


def guided_warnings(guided: GuidedResult, prediction: Prediction) -> Iterator[Message]:
    """Yield warnings for the user of guided positions."""
    if guided.chosen_expected - prediction.expected > BY_CHANCE:
        yield Message(
            "guided_by_chance",
            f"V is {guided.chosen_expected:.3g} by the half of the pulses that the positions were "
            f"chosen with, but {prediction.expected:.3g} by the other half: the pulses are too few "
            "to choose by; a denser point cloud gives better positions",
        )
