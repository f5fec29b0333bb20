"""The solver: baseline and number of samples for a requirement.

- `aosplan.solver.problem`: what is asked: target, bounds, kind of grid, objective.
- `aosplan.solver.solve_monotone`: models whose visibility rises with the baseline.
- `aosplan.solver.solve_by_scan`: models whose visibility need not rise.
- `aosplan.solver.solution`: the answer, and what bound it.
- `aosplan.solver.alternatives`: the best of several grids and headings.
- `aosplan.solver.tradeoff`: cost and benefit by number of samples.
"""
