"""Formats of mission files, one module each, with a `FORMAT` and a ``render(mission) -> bytes``."""
