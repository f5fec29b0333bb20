"""Messages of a plan: what bound it, and what the user should know."""

from __future__ import annotations

from typing import NamedTuple


class Limit(NamedTuple):
    """What bound the result: a quantity, its value, the bound it met, and why."""

    quantity: str
    value: float
    bound: float
    message: str


class Message(NamedTuple):
    """A warning: a short code for programs, a sentence for people."""

    code: str
    message: str


SCHEMA = 1
"""Version of the JSON documents."""
