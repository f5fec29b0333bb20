"""Sweeps: thousands to billions of scenarios, each a row of the result.

- `aosplan.sweeps.scenarios`: what is swept, a crossing of lists and ranges or a table of rows.
- `aosplan.sweeps.vectorized.solve`: uniform scenarios solved as whole columns: `aosplan.sweeps.vectorized.inputs` reads
  options, `aosplan.sweeps.vectorized.samples` finds samples and baselines over `aosplan.sweeps.vectorized.grids`,
  `aosplan.sweeps.vectorized.flights` flies them, and `aosplan.sweeps.status` keeps what was refused and why.
- `aosplan.sweeps.row_solver`: the rest, one row at a time, with a memo of what rows have in common.
- `aosplan.sweeps.run`: block by block to a file, resumable.
- `aosplan.sweeps.summary`, over `grouping`: what came out, added up block by block.
- `aosplan.sweeps.verify`: a sample of the rows beside their simulations.
- `aosplan.sweeps.aggregate`: both on the way, and while a sweep is interrupted.
"""
