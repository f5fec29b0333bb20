"""Opacity from laser pulses: how much of the light each part of a stand lets through.

A voxel with a point in it is not opaque, and a voxel without a point is not empty, because points
are samples.  The pulses themselves measure the transmission.  Each file holds one step, in this order:

- `aosplan.scenes.pulses.returns`: the returns of LAS and LAZ files with what pulses need.
- `aosplan.scenes.pulses.clean`: duplicates, noise, and flight lines that never saw the ground.
- `aosplan.scenes.pulses.grouping`: from returns to pulses, and the energy of each return.
- `aosplan.scenes.pulses.track`: where the sensor was, from the pulses or from a trajectory file.
- `aosplan.scenes.pulses.trajectory`: trajectory files.
- `aosplan.scenes.pulses.trace`: the path of each pulse through the voxels, clipped at its hits.
- `aosplan.scenes.pulses.attenuation`: the attenuation of each voxel, shrunk through a pyramid,
  and its scale.
- `aosplan.scenes.pulses.realise`: a binary volume of cells of leaf size from a seed.
- `aosplan.scenes.pulses.fit`: all steps together, and the reasons why pulses cannot be used.
"""
