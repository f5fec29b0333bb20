"""Folders of input files."""

from pathlib import Path

TESTS = Path(__file__).parents[1]
ROOT = TESTS.parent
AREAS = TESTS / "support" / "areas"
SHARED = ROOT.parent / "shared"
"""Folder of larger inputs outside the project.  Tests that need them are skipped if the folder is
missing.
"""

CLOUDS = SHARED / "data"
