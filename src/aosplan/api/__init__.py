"""The commands as Python functions.

Each function takes keyword arguments or a request, and does the same as the command with its name.
The result cannot be changed.  It has a short ``repr``, a table for notebooks, and methods that draw
figures.

- `aosplan.api.request`: a request from a `PlanRequest`, a file, an earlier plan or keyword arguments.
- `aosplan.api.request_options`: the keyword arguments with their types.
- `aosplan.api.summarized`: the text and the HTML of a result.
- `aosplan.api.plans`: `plan`, `tradeoff` and `export`.
- `aosplan.api.simulations`: `simulate`.
- `aosplan.api.scenes`: `read_scene`.
- `aosplan.api.sweeps`: `sweep`.
- `aosplan.api.flown`: `review` and `thin`.
- `aosplan.api.integrals`: `integrate`.
- `aosplan.api.papers`: `paper_figure`.
"""
