"""Areas: boundaries, sites that cover an area, their order, and no-fly zones.

- `aosplan.areas.boundary_file`: boundaries in GeoJSON, KML and KMZ files.
- `aosplan.areas.area`: an area on a local plane.
- `aosplan.areas.coverage`: the coverage rule, which determines the ground that is seen in enough
  photos.
- `aosplan.areas.cell_runs`: sets of cells, stored as runs along rows.
- `aosplan.areas.survey`: the sites that cover an area.
- `aosplan.areas.tour`: the order of the sites.
- `aosplan.areas.no_fly`: paths around no-fly zones.
- `aosplan.areas.around_points`: areas around points.
- `aosplan.areas.crossings`: counts the crossings of boundaries.
- `aosplan.areas.extent`: size of an area along a heading, and lower bounds of the number of sites
  that cover the area.
- `aosplan.areas.nearest`: search for nearest points.
- `aosplan.areas.reprojection`: boundaries in other coordinate reference systems.
- `aosplan.areas.vector_file`: boundaries in GeoPackage, shapefile, GPX, FlatGeobuf and MapInfo
  files.
- `aosplan.areas.ground_cells`: cells over an area or over the photos' footprints.
- `aosplan.areas.photo_sets`: the photos that see each place.
- `aosplan.areas.prior`: the expected position of a target.
- `aosplan.areas.geotiff`: writes rasters as files.
"""
