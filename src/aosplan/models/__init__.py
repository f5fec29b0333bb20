"""Visibility models, which predict how much of the target an integral image shows.

- `aosplan.models.model`: the interface of all models, and the prediction that they return.
- `aosplan.models.uniform`: one volume with occluders of one kind, the model of the paper.
- `aosplan.models.layered`: independent slices, each with its own height, size and density.
- `aosplan.models.layered_pairs`, `aosplan.models.layered_noise`, `aosplan.models.layered_slanted`:
  the covariance of pairs of rays through slices, for exact positions, for uncertain positions, and
  for slanted rays.
- `aosplan.models.measured`: the voxels of a stand, with `aosplan.models.plot_interior`.
- `aosplan.models.equations`: Eq. 1 to 5 of the paper.
- `aosplan.models.positions`: the shortfall of any set of positions, on a lattice or not.
- `aosplan.models.position_noise`: the effect of position errors of the drone.
- `aosplan.models.oblique_rays`: the effect of slanted rays.
- `aosplan.models.rolling`: lines of any length, with an integral of the last N photos.
- `aosplan.models.uncertainty`: standard errors of a prediction.
- `aosplan.models.detection`: probability of detection of a target below independent slices, with
  `aosplan.models.target_window`, `aosplan.models.window_pairs`, `aosplan.models.seen_share`
  and `aosplan.models.clutter`.
- `aosplan.models.counted_detection`: the same probability, counted in the voxels of a stand.
- `aosplan.models.memo`: storage of earlier predictions.
- `aosplan.models.correlogram`: predictions from a correlogram, which approximates the voxels;
  `aosplan.models.interior_surrogate`: such predictions for targets in the interior of a plot.
- `aosplan.models.ground_visibility`: visibility over the whole ground of a plan.
- `aosplan.models.area_rays`: slanted rays to all targets of an area.
- `aosplan.models.crown_clutter`: clutter from whole crowns.
- `aosplan.models.signatures`: named targets and their radiances.
- `aosplan.models.place`: the targets of one place that cameras see through a stand of voxels.
"""
