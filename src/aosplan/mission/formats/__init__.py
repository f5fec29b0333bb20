"""Formats of mission files, one module each: a `FORMAT` and a ``render(mission) -> bytes``."""
