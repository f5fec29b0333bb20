"""Sweeps: thousands to billions of scenarios, each a row of the result.

- `aosplan.sweep.scenarios`: what is swept, a crossing of lists and ranges or a table of rows.
- `aosplan.sweep.columns`: uniform scenarios solved as whole columns: `aosplan.sweep.inputs` reads
  options, `aosplan.sweep.bounds` finds samples and baselines over `aosplan.sweep.lattices`,
  `aosplan.sweep.layouts` flies them, and `aosplan.sweep.verdicts` keeps what was refused and why.
- `aosplan.sweep.rows`: the rest, one draft of a plan a row, with what rows have in common kept.
- `aosplan.sweep.run`: block by block to a file, resumable.
- `aosplan.sweep.summary`, over `outline`: what came out, added up block by block.
- `aosplan.sweep.verify`: a sample of the rows beside their simulations.
- `aosplan.sweep.gather`: both on the way, and while a sweep is interrupted.
"""
