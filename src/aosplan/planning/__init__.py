"""Planning: one request, one plan.

- `aosplan.planning.request`: the request; `aosplan.planning.options`: its options, their defaults and
  their help; `aosplan.planning.option_parsers`: how their values are read.
- `aosplan.planning.option_relations`: which options exclude each other, which need another, and
  defaults that depend on others; `aosplan.planning.aircraft`: what the drone decides.
- `aosplan.planning.request_file`: requests and saved plans from files.
- `aosplan.planning.user_defaults`: the user's own defaults.
- `aosplan.planning.loaded_scene`: the scene of a request, read from its file or made of numbers.
- `aosplan.planning.resolve`: from a request to `PlanInputs`, which all later stages take.
- `aosplan.planning.solved_plan`: from the inputs to a problem, and to its solution.
- `aosplan.planning.sites`: the sites over an area or along a line.
- `aosplan.planning.route`: waypoints, speeds and flights.
- `aosplan.planning.planner`: `plan`, all of it in order.
- `aosplan.planning.plan_warnings`, `aosplan.planning.measured_warnings`: the warnings of a plan.
- `aosplan.planning.confidence`: standard errors of a prediction; `aosplan.planning.sensitivity`: how a
  plan changes if the scene differs from what was assumed.
- `aosplan.planning.detection`: the probability of detection of what ``--find`` names.
- `aosplan.planning.document`: the JSON document; `aosplan.planning.plan_schema` its schema.
"""
