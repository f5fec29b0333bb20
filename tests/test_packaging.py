"""The oldest supported version of each dependency is the same in the package, in the tests that use
it, and in the recipe.
"""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parent.parent
REQUIREMENT = re.compile(r"([A-Za-z][\w-]*)(?:\[\w+\])?\s*[>=]=\s*([\d.]+)")


def floors(text):
    """Versions by name, without trailing zeros."""
    return {
        name.lower(): re.sub(r"(\.0)+$", "", version) for name, version in REQUIREMENT.findall(text)
    }


def test_oldest_versions_agree():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    needed = floors("\n".join(project["dependencies"]))
    extras = ("lidar", "raster", "sweep", "cluster", "figures", "pictures", "report")
    optional = floors(str([project["optional-dependencies"][extra] for extra in extras]))
    assert len(needed) == 9
    assert len(optional) > 8
    tested = floors((ROOT / "tests" / "oldest.txt").read_text())
    assert {name: tested.get(name) for name in needed | optional} == needed | optional
    recipe = (ROOT / "CONTRIBUTING.md").read_text().partition("  run:\n")[2].partition("tests:")[0]
    assert {name: v for name, v in floors(recipe).items() if name != "python"} == needed
