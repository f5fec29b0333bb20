"""Cameras and scenes by name, each with its source."""
