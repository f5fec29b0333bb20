"""Maps of the ground: detection and coverage at each place.

- `aosplan.maps.ground_cells`: cells over an area or over the photos' footprints.
- `aosplan.maps.photo_sets`: the photos that see each place.
- `aosplan.maps.local_canopy`: the density of the canopy above each place.
- `aosplan.maps.place_detection`: the probability that a target at a place is found.
- `aosplan.maps.detection_map`: the map of this probability for a plan.
- `aosplan.maps.prior`: the expected position of the target, and the probability of success.
- `aosplan.maps.coverage_map`: the coverage of a flight, its gaps, and the sites that close the
  gaps.
- `aosplan.maps.geotiff`: writes rasters as files.
- `aosplan.maps.reciprocal_map`: maps of camera positions by the share of a target area that they see.
"""
