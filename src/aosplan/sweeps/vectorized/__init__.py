"""Uniform scenarios solved as whole columns.

- `aosplan.sweeps.vectorized.inputs`: options as columns.
- `aosplan.sweeps.vectorized.grids`: shortfalls of grids, elementwise.
- `aosplan.sweeps.vectorized.samples`: samples and baselines.
- `aosplan.sweeps.vectorized.flights`: lengths and times.
- `aosplan.sweeps.vectorized.solve`: columns of results.
"""
