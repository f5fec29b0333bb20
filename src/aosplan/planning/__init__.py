"""Planning: computes a plan from a request.

- `aosplan.planning.request`: the request; `aosplan.planning.options`: the options, their defaults
  and their help; `aosplan.planning.option_parsers`: the parsers of their values.
- `aosplan.planning.option_relations`: the table of options that exclude or need each other;
  `aosplan.planning.dependent_defaults`: defaults that depend on other options;
  `aosplan.planning.aircraft`: options that the drone determines.
- `aosplan.planning.request_file`: requests from files; `aosplan.planning.saved_plan`: missions from saved
  plans; `aosplan.planning.saved_scene`: scenes as files.
- `aosplan.planning.user_defaults`: the user's own defaults.
- `aosplan.planning.planner`: `plan`, which calls the stages below in order.
- `aosplan.planning.resolve`: resolves a request to `PlanInputs`, the input of all later stages.
- `aosplan.planning.loaded_scene`: the scene of a request, which is read from a file or given by
  numbers; `aosplan.planning.cloud_crop`: the part of a point cloud that a plan needs.
- `aosplan.planning.solved_plan`: makes a problem from the inputs, and solves it.
- `aosplan.planning.sites`: the sites of one grid, over an area or along a line.
- `aosplan.planning.route`: waypoints, speeds and flights.
- `aosplan.planning.plan_warnings`: the warnings of a plan.
- `aosplan.planning.confidence`: standard errors of a prediction; `aosplan.planning.sensitivity`:
  the effect on a plan if the scene differs from the assumed scene.
- `aosplan.planning.plan_detection`: the probability of detection of the target that ``--find``
  names; `aosplan.planning.place_detection`: this probability at each place.
- `aosplan.planning.within`: the search for the best flight within a time, with
  `aosplan.planning.within_shapes`, `aosplan.planning.shape_space`, `aosplan.planning.least_time` and
  `aosplan.planning.within_result`; `aosplan.planning.cheaper_flight`: a hint for long flights.
- `aosplan.planning.gain_order`: flights in the order of gain per minute over an area with a prior,
  with `aosplan.planning.gain_places`, `aosplan.planning.block_order` and
  `aosplan.planning.gain_result`.
- `aosplan.planning.result`: `Plan`, with its values and its JSON document;
  `aosplan.planning.plan_schema`: the schema of this document.
- `aosplan.planning.within_altitude`: the best flight at one altitude.
- `aosplan.planning.guided`: sites that are chosen for one place with a point cloud of this place,
  with `aosplan.planning.guided_candidates`, `aosplan.planning.guided_result`,
  `aosplan.planning.plain_flights` and `aosplan.planning.target_area`.
"""
