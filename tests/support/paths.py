"""Folders of input files."""

from pathlib import Path

TESTS = Path(__file__).parents[1]
ROOT = TESTS.parent
AREAS = TESTS / "support" / "areas"
SHARED = ROOT.parent / "shared"
"""Larger inputs outside the project; tests that need them are skipped if they are missing."""

CLOUDS = SHARED / "data"
