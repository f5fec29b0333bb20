"""Sweeps: thousands to billions of scenarios, each a row of the result.

- `aosplan.sweeps.scenarios`: the scenarios: combinations of lists and ranges, or rows of a table.
- `aosplan.sweeps.vectorized.solve_columns`: uniform scenarios solved as whole columns.
  `aosplan.sweeps.vectorized.inputs` reads options, `aosplan.sweeps.vectorized.samples` finds
  samples and baselines, and `aosplan.sweeps.vectorized.flights` computes flights.  `aosplan.sweeps.block` stores which
  scenarios were refused and why.
- `aosplan.sweeps.solve_rows`: the other scenarios, one row at a time, with shared models.
- `aosplan.sweeps.run`: block by block to a file, resumable.
- `aosplan.sweeps.summary`, with `grouping`: summary of the results, added up block by block.
- `aosplan.sweeps.verify`: simulation of a sample of the rows.
- `aosplan.sweeps.aggregate`: summary and sample during a sweep, kept if it is interrupted.
"""
