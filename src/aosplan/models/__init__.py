"""Visibility models: what a set of sample positions will show of the target.

- `aosplan.models.model`: the interface, and the prediction that all models share.
- `aosplan.models.uniform`: one volume of occluders of one kind, the paper's model.
- `aosplan.models.layered`: independent slices, each with its own height, size and density.
- `aosplan.models.layered_pairs`, `aosplan.models.layered_noise`, `aosplan.models.layered_slanted`: what
  pairs of rays through slices share, if positions are uncertain and if rays are slanted.
- `aosplan.models.measured`: the voxels of a stand themselves.
- `aosplan.models.equations`: Eq. 1 to 5 of the paper.
- `aosplan.models.positions`: the shortfall of any set of positions, on a lattice or scattered.
- `aosplan.models.position_noise`: sites that are not held exactly.
- `aosplan.models.oblique_rays`: rays off nadir.
- `aosplan.models.rolling`: lines that are flown on, the last N photos integrated.
- `aosplan.models.uncertainty`: standard errors of a prediction.
- `aosplan.models.detection`: whether a target on the ground is found, through independent slices;
  from `aosplan.models.target_window`, `aosplan.models.window_pairs`, `aosplan.models.seen_share`
  and `aosplan.models.clutter`.
- `aosplan.models.counted_detection`: the same, counted in the voxels of a stand.
- `aosplan.models.memo`: predictions that are asked for again.
"""
