"""Simulation: experiments that check the models.

- `aosplan.simulation.noise_patterns`: averaged noise patterns, Figs. 3 and 4 of the paper.
- `aosplan.simulation.forests`: random voxel volumes: slices of cubes, and clumped stands.
- `aosplan.simulation.voxel_views`: the targets that views of a voxel volume hide.
- `aosplan.simulation.moments`: visibility and its standard error from counts.
- `aosplan.simulation.pictures`: a resolution chart seen through the trees; PNG files.
- `aosplan.simulation.search`: targets on the ground, and whether a detector finds them.
- `aosplan.simulation.compare`: comparison of a plan's prediction with its simulation.
- `aosplan.simulation.compare_search`: comparison of a predicted detection with a simulated search.

Only `compare` and `compare_search` import the models, so that the experiments are independent of
them.
"""
