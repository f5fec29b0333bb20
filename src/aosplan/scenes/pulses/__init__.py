"""Opacity from laser pulses: the share of light that each part of a stand transmits.

A voxel that contains a point is not opaque, and a voxel without a point is not empty, because
points are samples.  The pulses measure the transmission.  Each module is one step, in this order:

- `aosplan.scenes.pulses.returns`: the returns in LAS and LAZ files with the attributes of pulses.
- `aosplan.scenes.pulses.clean`: removal of duplicates, noise, and flight lines without ground.
- `aosplan.scenes.pulses.grouping`: grouping of returns into pulses, and the energy of each return.
- `aosplan.scenes.pulses.sensor_track`: positions of the sensor, fitted to the pulses.
- `aosplan.scenes.pulses.trajectory`: trajectory files.
- `aosplan.scenes.pulses.trace`: the path of each pulse through the voxels up to its last return.
- `aosplan.scenes.pulses.attenuation`: the attenuation of each voxel, shrunk through a pyramid,
  and its scale.
- `aosplan.scenes.pulses.realise`: a binary volume of cells of leaf size, from a random seed.
- `aosplan.scenes.pulses.fit`: all steps together, and the reasons why pulses cannot be used.
"""
