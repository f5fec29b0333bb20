"""Simulation: the experiment that the models are held against.

- `aosplan.simulate.noise`: averaged noise patterns, the paper's Figs. 3 and 4.
- `aosplan.simulate.forests`: volumes of voxels from a seed: slices of cubes, clumped stands.
- `aosplan.simulate.voxels`: what views of a volume of voxels hide.
- `aosplan.simulate.moments`: visibility and its standard error from counts.
- `aosplan.simulate.picture`: a resolution chart seen through the trees; PNG files.
- `aosplan.simulate.compare`: a plan's prediction beside its simulation.

None of them but `compare` knows the models: theory and experiment meet there alone.
"""
