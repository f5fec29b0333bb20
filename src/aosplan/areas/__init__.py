"""Areas: outlines to cover, sites that cover them, the order of flight, no-fly zones.

- `aosplan.areas.boundary_file`: GeoJSON, KML and KMZ files of outlines.
- `aosplan.areas.area`: an area on a local plane.
- `aosplan.areas.coverage`: the ground that enough photos see.
- `aosplan.areas.cell_runs`: sets of cells as runs along rows.
- `aosplan.areas.survey`: the sites that cover an area.
- `aosplan.areas.tour`: the order of sites.
- `aosplan.areas.no_fly`: ways around no-fly zones.
"""
