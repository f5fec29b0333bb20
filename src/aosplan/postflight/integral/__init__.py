"""Real recordings: images with known poses, averaged on a focal surface.

- `aosplan.postflight.integral.photo_poses`: poses from the tags of a folder of photos.
- `aosplan.postflight.integral.poses_file`: poses from the AOS project's JSON, or COLMAP's files.
- `aosplan.postflight.integral.odm_shots`: poses from OpenDroneMap.
- `aosplan.postflight.integral.focal_plane`: the focal plane, what a view sees of it, the homography between.
- `aosplan.postflight.integral.georeference`: where on earth the plane lies; `geotiff` writes it there.
- `aosplan.postflight.integral.focus`: the height in focus; `agreement` of halves, `alignment` of poses.
- `aosplan.postflight.integral.view_subset`: all views, or some of them.
- `aosplan.postflight.integral.images`: image files as arrays, and back.
- `aosplan.postflight.integral.integral`: the average of the chosen views, with its coverage.

Pixels are counted from the outer corner of the first one, whose centre is (0.5, 0.5).
"""
