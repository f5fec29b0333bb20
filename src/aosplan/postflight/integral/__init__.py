"""Integral images of recordings: images with known poses are averaged on a focal surface.

- `aosplan.postflight.integral.photo_poses`: poses from the metadata of a folder of photos.
- `aosplan.postflight.integral.poses_file`: poses from the AOS project's JSON, or COLMAP's files.
- `aosplan.postflight.integral.odm_shots`: poses from OpenDroneMap.
- `aosplan.postflight.integral.focal_plane`: the focal plane, and the part of it that a view sees.
- `aosplan.postflight.integral.georeference`: location of the plane on earth; `geotiff` writes files
  with this location.
- `aosplan.postflight.integral.focus`: the height in focus, found from `agreement` and `alignment`
  of views.
- `aosplan.postflight.integral.view_subset`: all views, or some of them.
- `aosplan.postflight.integral.images`: image files as arrays, and arrays as image files.
- `aosplan.postflight.integral.integral`: the average of the chosen views, with its coverage.

Pixel coordinates start at the outer corner of the first pixel, whose centre is (0.5, 0.5).
"""
