"""Presentation of results: figures, the report page, and text on a terminal."""
