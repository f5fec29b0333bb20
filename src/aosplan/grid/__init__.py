"""Grids: relative positions of the samples, in units of the baseline.

- `aosplan.grid.patterns`: trimmed grids, rectangles, lines and lanes.
- `aosplan.grid.spiral`: spirals.
- `aosplan.grid.pair_offsets`: counts of pairs of sites by their offset.
"""
