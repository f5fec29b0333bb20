"""Schema of the document that ``aosplan tradeoff --json`` prints."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from aosplan.validation import Finite, OpenDocument


class TradeoffRowDocument(OpenDocument):
    """A pattern at a baseline: at the smallest that meets the target, or the nearest to it.

    On the front, no row that meets the target is as good in samples, extent and time and better
    in one; under the objectives that are maximised, no row at all, and in their value too.
    """

    grid: str
    samples: int
    rows: int
    columns: int
    baseline_m: Finite
    aperture_m: Finite
    extent_x_m: Finite
    extent_y_m: Finite
    pitch_y_m: Finite
    length_m: Finite
    time_s: Finite
    density: Finite
    expected: Finite
    normalized: Finite | None
    effective_samples: Finite | None
    contrast: Finite | None
    detection: Finite | None = None
    meets: bool
    front: bool
    chosen: bool


class TradeoffDocument(OpenDocument):
    """What `aosplan tradeoff --json` prints."""

    schema_: Literal[1] = Field(alias="schema")
    version: str
    request: dict[str, Any]
    rows: list[TradeoffRowDocument]
