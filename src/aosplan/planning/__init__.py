"""Planning: one request, one plan.

- `aosplan.planning.request`: the request; `aosplan.planning.options` its options and defaults.
- `aosplan.planning.request_file`: requests and saved plans from files.
- `aosplan.planning.user_defaults`: the user's own defaults.
- `aosplan.planning.inputs`: from names and files to camera, scene and altitude.
- `aosplan.planning.setup`: the problem to be solved.
- `aosplan.planning.sites`: the sites over an area or along a line.
- `aosplan.planning.route`: waypoints, speeds and flights.
- `aosplan.planning.planner`: `plan`, all of it in order.
- `aosplan.planning.plan_warnings`: what the user should know of a plan.
- `aosplan.planning.sensitivity`: what becomes of a plan if the scene is another.
- `aosplan.planning.find`: the options of `--find`; `aosplan.planning.detection`: what they ask for.
- `aosplan.planning.document`: the JSON document; `aosplan.planning.plan_schema` its schema.
"""
