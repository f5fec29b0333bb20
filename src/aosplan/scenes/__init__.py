"""Scenes: the occluders between the camera and the ground.

- `aosplan.scenes.scene`: uniform and layered scenes.
- `aosplan.scenes.presets`: the scene presets, each with its source.
- `aosplan.scenes.inventory`: scenes from stems, crowns and leaf area.
- `aosplan.scenes.voxels`: a stand as voxels.
- `aosplan.scenes.occlusion`: the targets that each view through the voxels sees.
- `aosplan.scenes.hidden_counts`: the number of views in which each target is hidden, and the number
  of targets that are hidden in both views of a pair.
- `aosplan.scenes.integral_image`: integral images of the ground below occluders with radiances.
- `aosplan.scenes.matched_window`: the detector that searches integral images for a target.
- `aosplan.scenes.correlogram`: correlation of two views as a function of the distance between their
  cameras.
- `aosplan.scenes.occluder_statistics`: layers and occluder sizes from voxels.
- `aosplan.scenes.summary`: the statistics of a scene as a document and as a file.
- `aosplan.scenes.files`: the readers of scene files.
- `aosplan.scenes.density`: Eq. 1 of the paper and its inverse.
- `aosplan.scenes.opacity`: the method by which the opacity of a stand was found.
- `aosplan.scenes.packed_columns`: columns of targets as bits, for fast views of voxels.
- `aosplan.scenes.perspective`: positions at which rays of perspective views meet slices.
- `aosplan.scenes.plates`: cells that rays meet in slices of plates.
- `aosplan.scenes.sampled_targets`: occlusion of a sample of the targets.
- `aosplan.scenes.plot_frame`: conversion of positions to the axes of a plot with a location.
- `aosplan.scenes.local_canopy`: the density of the canopy above each place.
"""
