"""Planning: one request, one plan.

- `aosplan.planning.request`: the request; `aosplan.planning.options`: its options, their defaults and
  their help; `aosplan.planning.option_parsers`: how their values are read.
- `aosplan.planning.option_relations`: which options exclude each other, which need another, and
  defaults that depend on others; `aosplan.planning.aircraft`: what the drone decides.
- `aosplan.planning.request_file`: requests from files; `aosplan.planning.saved_plan`: missions from saved
  plans; `aosplan.planning.saved_scene`: scenes as files.
- `aosplan.planning.user_defaults`: the user's own defaults.
- `aosplan.planning.planner`: `plan`, which calls the stages below in order.
- `aosplan.planning.resolve`: from a request to `PlanInputs`, which all later stages take.
- `aosplan.planning.loaded_scene`: the scene of a request, read from its file or made of numbers;
  `aosplan.planning.cloud_crop`: the part of a point cloud that a plan needs.
- `aosplan.planning.solved_plan`: from the inputs to a problem, and to its solution.
- `aosplan.planning.sites`: the sites of one grid, over an area or along a line.
- `aosplan.planning.route`: waypoints, speeds and flights.
- `aosplan.planning.plan_warnings`, `aosplan.planning.measured_warnings`: the warnings of a plan.
- `aosplan.planning.confidence`: standard errors of a prediction; `aosplan.planning.sensitivity`: how a
  plan changes if the scene differs from what was assumed.
- `aosplan.planning.plan_detection`: the probability of detection of what ``--find`` names.
- `aosplan.planning.within`: the search for the best flight within a time, with
  `aosplan.planning.within_shapes`, `aosplan.planning.shape_space`, `aosplan.planning.least_time` and
  `aosplan.planning.within_result`; `aosplan.planning.cheaper_flight`: a hint for long flights.
- `aosplan.planning.plan_data`: the values of a plan; `aosplan.planning.result`: `Plan`, with its
  JSON document; `aosplan.planning.plan_schema`: the schema of this document.
"""
