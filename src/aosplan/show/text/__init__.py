"""Text on a terminal: tables, drawings of grids, and the style of both."""
