"""Writes the golden files: `python tests/golden/make.py`, then read the difference.

A small plan in every format that is compared byte for byte.  The version is left out, so a
release does not change them.
"""

from pathlib import Path

from aosplan.export import formats, render
from aosplan.planning import plan
from aosplan.request import PlanRequest

FOLDER = Path(__file__).parent

REQUESTS = {
    "placed": PlanRequest(altitude=40, vhat=0.8, origin=(48.3358, 14.3261), heading=30),
    "antimeridian": PlanRequest(altitude=40, vhat=0.75, origin=(-16.5, 180.0), heading=90),
    "local": PlanRequest(altitude=50, vhat=0.8, grid="line"),
}
"""Small plans by name."""


def contents():
    """The golden files by name, as they would be written now."""
    files = {}
    for name, request in REQUESTS.items():
        mission = plan(request).mission()
        mission = mission._replace(summary=mission.summary | {"version": "golden"})
        for form in formats().values():
            if mission.has_place or not form.needs_place:
                files[f"{name}{form.suffixes[0]}"] = render(mission, form)
    return files


if __name__ == "__main__":
    for file, content in contents().items():
        (FOLDER / file).write_bytes(content)
        print(FOLDER / file)
