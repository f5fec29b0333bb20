"""Grids: positions of the samples relative to each other, in baselines.

- `aosplan.grid.patterns`: trimmed grids, rectangles, lines and lanes.
- `aosplan.grid.spiral`: spirals.
"""
