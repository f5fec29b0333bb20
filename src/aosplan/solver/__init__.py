"""The solver, which finds the baseline and the number of samples for a requirement.

- `aosplan.solver.problem`: the problem: target, bounds, kind of grid, objective.
- `aosplan.solver.solve`: the solution of a problem, by one of the two solvers below, and the best
  solution for several grids and headings.
- `aosplan.solver.solve_monotone`: the solver for models whose visibility increases with the
  baseline.
- `aosplan.solver.solve_by_scan`: the solver for models whose visibility may decrease.
- `aosplan.solver.solution`: the solution, and the limits that determined it.
- `aosplan.solver.refusals`: the text of errors for targets that cannot be met.
- `aosplan.solver.tradeoff`: cost and benefit by number of samples.
- `aosplan.solver.guided_sites`: sites with the highest integral visibility of one place.
"""
