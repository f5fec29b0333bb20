"""Schema of the document that ``aosplan tradeoff --json`` prints."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from aosplan.validation import Finite, OpenDocument


class TradeoffRowDocument(OpenDocument):
    """A pattern at the smallest baseline that meets the target, or at the best baseline if no
    baseline meets the target.

    `front` is true if no other row that meets the target dominates the row in samples, extent and
    time.  If the objective is maximised, its value is also compared, and all rows are included in
    the comparison.
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
    """The output of `aosplan tradeoff --json`."""

    schema_: Literal[1] = Field(alias="schema")
    version: str
    request: dict[str, Any]
    rows: list[TradeoffRowDocument]
