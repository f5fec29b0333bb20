"""Real recordings: images with known poses, averaged on a focal plane.

- `aosplan.recordings.poses`: where each image was taken, from the AOS project's JSON or COLMAP.
- `aosplan.recordings.plane`: the focal plane, what a view sees of it, the homography between.
- `aosplan.recordings.choice`: all views, or some of them.
- `aosplan.recordings.pictures`: image files as arrays, and back.
- `aosplan.recordings.integral`: the average of the chosen views, with its coverage.

Pixels are counted from the outer corner of the first one, whose centre is (0.5, 0.5).
"""
