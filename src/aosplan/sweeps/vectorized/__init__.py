"""Solution of uniform scenarios with array operations on whole columns.

- `aosplan.sweeps.vectorized.inputs`: options as columns.
- `aosplan.sweeps.vectorized.samples`: samples and baselines.
- `aosplan.sweeps.vectorized.flights`: lengths and times of flights.
- `aosplan.sweeps.vectorized.solve_columns`: columns of results.
"""
