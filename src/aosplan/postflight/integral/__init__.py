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
- `aosplan.postflight.integral.camera_pose`: pose and intrinsics of a view.
- `aosplan.postflight.integral.colmap`: poses from COLMAP.
- `aosplan.postflight.integral.recording`: poses and a folder of images above a focal plane.
- `aosplan.postflight.integral.warping`: images that are warped by OpenCV.
- `aosplan.postflight.integral.seeing`: exposure, blending and contrast of integral images.
- `aosplan.postflight.integral.hot_spots`: candidates of targets.
- `aosplan.postflight.integral.layers`: integral images at several heights.
- `aosplan.postflight.integral.distance_scan`: the distance of the ground if heights are not known.
- `aosplan.postflight.integral.surface`: focal surfaces from elevation models.
- `aosplan.postflight.integral.integral_warnings`: warnings about an integral image.
- `aosplan.postflight.integral.photo_choice`: the photos of a folder that are taken from about the same
  height.

Pixel coordinates start at the outer corner of the first pixel, whose centre is (0.5, 0.5).
"""
