"""Opacity from laser pulses.

The points of a cloud are only samples.  A voxel that contains a point need not be opaque, and a
voxel without a point need not be empty.  The laser pulses measure the share of light that each part
of a stand transmits.  Each module performs one step, in this order:

- `aosplan.scenes.pulses.returns`: reads the returns in LAS and LAZ files, with the attributes of
  their pulses.
- `aosplan.scenes.pulses.clean`: removes duplicates, noise, and flight lines without ground.
- `aosplan.scenes.pulses.grouping`: groups returns into pulses, and finds the energy of each return.
- `aosplan.scenes.pulses.sensor_track`: fits positions of the sensor to the pulses.
- `aosplan.scenes.pulses.trajectory`: reads positions of the sensor from trajectory files.
- `aosplan.scenes.pulses.trace`: computes the path of each pulse through the voxels up to its last
  return.
- `aosplan.scenes.pulses.attenuation`: estimates the attenuation of each voxel, and a scale factor
  for all voxels.
- `aosplan.scenes.pulses.realise`: draws a volume of opaque and empty cells of leaf size from a
  random seed.
- `aosplan.scenes.pulses.fit`: executes all steps. If the pulses cannot be used, it reports the
  reason.
"""
