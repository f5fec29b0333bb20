"""Messages of a plan: limits that took effect, and warnings."""

from __future__ import annotations

from typing import NamedTuple


class Limit(NamedTuple):
    """A limit that determined a value: the quantity, its value, the bound that the value reached,
    and the reason for the bound.
    """

    quantity: str
    value: float
    bound: float
    message: str


class Message(NamedTuple):
    """A warning: a short code for programs and a sentence for people."""

    code: str
    message: str


SCHEMA = 1
"""Version of the JSON documents."""
