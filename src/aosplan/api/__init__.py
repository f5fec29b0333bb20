"""The commands as Python functions.

Each function takes keyword arguments or a request, does the same as its command, and returns a
frozen result with a short ``repr``, a table for notebooks, and figures.

- `aosplan.api.request`: a request from a `PlanRequest`, a file, an earlier plan or keyword arguments.
- `aosplan.api.request_options`: the keyword arguments with their types.
- `aosplan.api.summarized`: the text and the HTML of a result.
- `aosplan.api.plans`: `plan`, `tradeoff` and `export`.
- `aosplan.api.simulations`: `simulate`.
- `aosplan.api.scenes`: `read_scene`.
- `aosplan.api.sweeps`: `sweep`.
- `aosplan.api.flown`: `review` and `thin`.
- `aosplan.api.integrals`: `integrate`.
"""
