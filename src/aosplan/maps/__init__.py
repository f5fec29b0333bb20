"""Maps of the ground: what photos show of it, place by place.

- `aosplan.maps.ground_cells`: cells over an area or over the photos' footprints.
- `aosplan.maps.photo_sets`: which photos see each of them.
- `aosplan.maps.local_canopy`: through what canopy.
- `aosplan.maps.place_detection`: how likely a target is found there.
- `aosplan.maps.detection_map`: all of it for a plan.
- `aosplan.maps.prior`: where the target is expected, and the probability of success.
- `aosplan.maps.coverage_map`: what was shown by a flight, what remains, and which sites close it.
- `aosplan.maps.geotiff`: rasters as files.
"""
