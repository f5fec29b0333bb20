"""Grids: where samples lie relative to each other, in units of the baseline.

- `aosplan.grid.patterns`: trimmed grids, rectangles, lines and lanes.
- `aosplan.grid.spiral`: spirals.
"""
