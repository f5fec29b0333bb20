"""Text on a terminal: tables, drawings of grids, and the styles of both."""
