"""Write the golden files:  PYTHONPATH=tests python tests/golden/make.py.  Then read the difference.

They are small missions in every format that are compared byte by byte. Zip files are compared
member by member, because compression differs between machines. Only a few parts of the plan's
summary are kept. A release or a new option therefore does not change the files.
"""

import io
import zipfile
from dataclasses import replace
from pathlib import Path

from support.flights import flown_in

from aosplan.mission.export import formats, render
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest

FOLDER = Path(__file__).parent

REQUESTS = {
    "placed": PlanRequest(altitude=40, vhat=0.8, origin=(48.3358, 14.3261), heading=30),
    "antimeridian": PlanRequest(altitude=40, vhat=0.75, origin=(-16.5, 180.0), heading=90),
    "local": PlanRequest(altitude=50, vhat=0.8, grid="line"),
}
"""Small plans, by name."""


SUMMARY = ("schema", "samples", "scene", "camera")
"""Parts of the plan's summary that the files keep."""


def missions():
    """The missions by name; `through` has lines with turns, a slope and a take-off."""
    made = {name: plan(request).mission() for name, request in REQUESTS.items()}
    stop = made["placed"]
    count = len(stop.waypoints)
    ground = [300.0 + 0.5 * index for index in range(count)]
    ways = replace(stop.waypoints, ground_m=ground, photo=[index != 2 for index in range(count)])
    settings = stop.settings._replace(
        trigger="distance",
        spacing_m=stop.summary["baseline_m"],
        autopilot="ardupilot",
        takeoff_latitude=48.3355,
        takeoff_longitude=14.3255,
        takeoff_ground_m=290.25,
    )
    made["through"] = stop._replace(waypoints=ways, settings=settings)
    return {
        name: mission._replace(summary={part: mission.summary[part] for part in SUMMARY})
        for name, mission in made.items()
    }


def flown_by(mission, form):
    """The mission for its own autopilot if the format supports it, or else for the format's first."""
    autopilot = mission.settings.autopilot
    if not form.flown_by or autopilot in form.flown_by:
        return mission
    return mission._replace(settings=mission.settings._replace(autopilot=form.flown_by[0]))


def contents():
    """The current content of the golden files, by name."""
    files = {}
    for name, mission in missions().items():
        for form in formats().values():
            if mission.has_place or not form.needs_place:
                content = render(flown_in(flown_by(mission, form), form.name), form)
                if zipfile.is_zipfile(io.BytesIO(content)):
                    archive = zipfile.ZipFile(io.BytesIO(content))
                    prefix = name if form.name == "kmz" else f"{name}-{form.name}"
                    for member in archive.namelist():
                        files[f"{prefix}-{Path(member).name}"] = archive.read(member)
                else:
                    ending = form.suffixes[0] if form.suffixes else f"-{form.name}.csv"
                    files[f"{name}{ending}"] = content
    return files


if __name__ == "__main__":
    for file, content in contents().items():
        (FOLDER / file).write_bytes(content)
        print(FOLDER / file)
