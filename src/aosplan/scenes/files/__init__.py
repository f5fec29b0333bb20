"""Readers of scene files, one module per kind of file.

- `aosplan.scenes.files.point_cloud`: conversion of LAS and LAZ point clouds to voxels.  It uses
  `aosplan.scenes.files.las` for the records and `aosplan.scenes.files.ground` for the ground.
- `aosplan.scenes.files.canopy_raster`: conversion of canopy height rasters to voxels.
- `aosplan.scenes.files.toml_file`: scene files in TOML and JSON.  It uses
  `aosplan.scenes.files.scene_schema` for their schema and `aosplan.scenes.files.correlogram_table`
  for the correlogram in them.
- `aosplan.scenes.files.slice_table`: tables of slices.
- `aosplan.scenes.files.voxel_file`: saved voxels (``.npz``).
- `aosplan.scenes.files.cache`: voxels of point clouds that were read before.
- `aosplan.scenes.files.crop`: cropping of a point cloud while it is read.
- `aosplan.scenes.files.las_crs`: coordinate reference systems of LAS and LAZ files.
- `aosplan.scenes.files.outliers`: warnings about points that are far from all others.
- `aosplan.scenes.files.spool`: temporary storage of points.
- `aosplan.scenes.files.tiles`: checks that the files of one point cloud belong together.
- `aosplan.scenes.files.cloud_doubts`: warnings about a point cloud that was read into voxels.
"""
