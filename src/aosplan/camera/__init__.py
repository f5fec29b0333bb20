"""Cameras: intrinsics, presets, and the disparity of occluders in the images.

- `aosplan.camera.camera`: intrinsics, ground resolution and footprint.
- `aosplan.camera.presets`: the built-in cameras, each with its source, and a function that finds a
  camera by the name of a preset or by the path of a file.
- `aosplan.camera.disparity`: disparity of occluders, and the baseline of the coverage rule.
- `aosplan.camera.camera_file`: cameras in files.
"""
