"""Functions for use after the flight: review of the photos, selection of photos, and integral
images.

- `aosplan.postflight.positions_file`: positions from tables, missions and logs;
  `aosplan.postflight.photo_positions`: positions from photos.
- `aosplan.postflight.registration`: matching of positions to the sites of a plan.
- `aosplan.postflight.review`: the visibility of the photos of a flight, and its missing photos.
- `aosplan.postflight.views`: recorded positions as views of a scene.
- `aosplan.postflight.best_views` and `aosplan.postflight.thin`: the best N of many views.
- `aosplan.postflight.integral`: the average of images on a focal surface.
- `aosplan.postflight.photo_metadata`: metadata of photos about the camera.
- `aosplan.postflight.wpml_route`: sites in WPML routes.
- `aosplan.postflight.saved_missions`: missions from saved plans and mission files.
- `aosplan.postflight.topup`: the flight that takes the missing photos.
"""
