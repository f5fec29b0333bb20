"""Simulation: the experiment that the models are held against.

- `aosplan.simulation.noise_patterns`: averaged noise patterns, the paper's Figs. 3 and 4.
- `aosplan.simulation.forests`: volumes of voxels from a seed: slices of cubes, clumped stands.
- `aosplan.simulation.voxel_views`: what views of a volume of voxels hide.
- `aosplan.simulation.moments`: visibility and its standard error from counts.
- `aosplan.simulation.pictures`: a resolution chart seen through the trees; PNG files.
- `aosplan.simulation.search`: targets on the ground, found by a detector or not.
- `aosplan.simulation.compare`: a plan's prediction beside its simulation.
- `aosplan.simulation.compare_search`: a predicted detection beside a search.

None of them but `compare` and `compare_search` know the models: theory and experiment
meet there alone.
"""
