"""Sweeps: solve thousands to billions of scenarios.  Each scenario is a row of the result.

- `aosplan.sweeps.scenarios`: the scenarios, which are combinations of lists and ranges, or rows of
  a table.
- `aosplan.sweeps.vectorized.solve_columns`: solves uniform scenarios with array operations on whole
  columns.  `aosplan.sweeps.vectorized.inputs` reads options, `aosplan.sweeps.vectorized.samples`
  finds samples and baselines, and `aosplan.sweeps.vectorized.flights` computes flights.
  `aosplan.sweeps.block` stores the scenarios that were refused, with the reasons.
- `aosplan.sweeps.solve_rows`: solves the other scenarios one row at a time, with shared models.
- `aosplan.sweeps.run`: writes the result to a file, block by block.  An interrupted run can be
  resumed.
- `aosplan.sweeps.summary`, with `grouping`: summary of the results, which is added up block by
  block.
- `aosplan.sweeps.verify`: simulation of a sample of the rows.
- `aosplan.sweeps.aggregate`: summary and sample during a sweep.  They are stored in a file if the
  sweep is interrupted.
- `aosplan.sweeps.sweep`: a sweep and conditions for the rows to keep.
- `aosplan.sweeps.solve_block`: one block as a data frame.
- `aosplan.sweeps.parts`: parts of the result in a folder; `aosplan.sweeps.parquet_folder`: a result
  that is a folder.
- `aosplan.sweeps.cluster`: workers of a Dask cluster.
- `aosplan.sweeps.input_files`: files that the scenarios use.
- `aosplan.sweeps.user_defaults`: the user's own defaults for scenarios.
"""
