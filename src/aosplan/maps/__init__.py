"""Maps of the ground: detection and coverage at each place.

- `aosplan.maps.detection_map`: the map of the probability of detection for a plan.
- `aosplan.maps.coverage_map`: the coverage of a flight, its gaps, and the sites that close the
  gaps.
- `aosplan.maps.reciprocal_map`: maps of camera positions by the share of a target area that they see.
"""
