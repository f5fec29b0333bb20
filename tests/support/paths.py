"""Folders that tests read."""

from pathlib import Path

TESTS = Path(__file__).parents[1]
ROOT = TESTS.parent
AREAS = TESTS / "support" / "areas"
SHARED = ROOT.parent / "shared"
"""Larger inputs beside the project; tests that need them are skipped where they are absent."""

CLOUDS = SHARED / "data"
