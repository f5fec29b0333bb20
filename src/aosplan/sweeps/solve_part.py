"""Solving one part of a sweep: from a block of scenarios to a file of rows."""

from __future__ import annotations

from typing import TYPE_CHECKING

from aosplan.sweeps.parts import Part, write_frame

if TYPE_CHECKING:
    from aosplan.sweeps.sweep import Sweep


def solve_part(sweep: Sweep, index: int, path: str | None, folder: str | None = None) -> Part:
    """Solve a block and write its rows to `path` (None: write nothing), by way of `folder`."""
    frame, gathered = sweep.part(index)
    size, checksum = (0, "") if path is None else write_frame(frame, path, folder)
    return Part(index, frame.height, size, checksum, gathered)
