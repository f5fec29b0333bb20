"""Simulation: experiments that check the models.

- `aosplan.simulation.noise_patterns`: averaged noise patterns, as in Figs. 3 and 4 of the paper.
- `aosplan.simulation.forests`: random voxel volumes, which are slices of cubes or clumped stands.
- `aosplan.simulation.voxel_views`: the targets that views of a voxel volume hide.
- `aosplan.simulation.experiments`: independent samples of a forest, each with the same views.
- `aosplan.simulation.moments`: visibility and its standard error, computed from counts.
- `aosplan.simulation.pictures`: pictures of a resolution chart behind trees, and PNG files.
- `aosplan.simulation.search`: a search for targets on the ground with a detector.
- `aosplan.simulation.compare`: comparison of a plan's prediction with its simulation.
- `aosplan.simulation.compare_search`: comparison of a predicted detection with a simulated search.
- `aosplan.simulation.leaf_stands`: stands of individual leaves, scanned by laser pulses.
- `aosplan.simulation.ssim`: similarity of two images.

Only `compare` and `compare_search` import the models.  The experiments are therefore independent of
the models.
"""
