"""Generates tables of the built-in cameras, drones, scenes, formats and payloads as Markdown."""

from functools import cache

from aosplan.camera.camera import Camera
from aosplan.camera.presets import CAMERAS
from aosplan.errors import RequestError
from aosplan.flight.drones import DRONES
from aosplan.mission.dji_models import PAYLOADS
from aosplan.mission.export import formats as known_formats
from aosplan.mission.export import mission_files
from aosplan.scenes.presets import SCENES

INTRINSICS = (
    "focal_length_mm",
    "sensor_width_mm",
    "sensor_height_mm",
    "image_width_px",
    "image_height_px",
)

PRESETS = {"cameras": CAMERAS, "drones": DRONES, "scenes": SCENES}


def table(header, rows):
    """A Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)


def sources(kind):
    """Sources and assumptions of the numbers of each preset of a kind."""
    lines = []
    for name, preset in PRESETS[kind].items():
        assumed = f" Assumed: {_text(preset.assumed)}." if preset.assumed else ""
        lines.append(f"`{name}`\n: {_text(preset.source)}.{assumed}\n")
    return "\n".join(lines)


def cameras():
    """The built-in cameras."""
    rows = []
    for name, preset in CAMERAS.items():
        camera = Camera(name, *(getattr(preset, part) for part in INTRINSICS))
        wide, high = camera.fov_deg
        rows.append(
            (
                f"`{name}`",
                _text(preset.title),
                preset.band,
                f"{preset.focal_length_mm:g}",
                f"{preset.sensor_width_mm:g} × {preset.sensor_height_mm:g}",
                f"{preset.image_width_px} × {preset.image_height_px}",
                f"{wide:.1f} × {high:.1f}",
            )
        )
    header = ("name", "camera", "band", "focal length [mm]", "sensor [mm]", "image [px]", "view [°]")  # fmt: skip
    return table(header, rows)


def drones():
    """The built-in drones."""
    header = ("name", "drone", "cruise [m/s]", "acceleration [m/s²]", "climb [m/s]", "airspeed [m/s]", "endurance [min]", "waypoints", "camera", "flies")  # fmt: skip
    rows = [
        (
            f"`{name}`",
            _text(each.title),
            f"{each.speed_mps:g}",
            f"{each.acceleration_mps2:g}",
            f"{each.climb_mps:g}",
            f"{each.airspeed_mps:g}",
            "" if each.endurance_min is None else f"{each.endurance_min:g}",
            each.most_waypoints or "",
            f"`{each.camera}`" if each.camera else "",
            " ".join(f"`{form}`" for form in each.mission_formats),
        )
        for name, each in DRONES.items()
    ]
    return table(header, rows)


def scenes():
    """The built-in scenes."""
    header = ("name", "stand", "p", "occluder [m]", "volume [m]", "slice density")
    rows = []
    for name, each in SCENES.items():
        top = each.volume_base_m + each.volume_height_m
        rows.append(
            (
                f"`{name}`",
                _text(each.title),
                f"{each.integrated_density:.1%}",
                f"{each.occluder_size_m:g}",
                f"{each.volume_base_m:g} to {top:g}",
                f"{_slice_density(each):.2%}",
            )
        )
    return table(header, rows)


def _slice_density(each):
    from aosplan import slice_density

    return slice_density(each.integrated_density, each.volume_height_m, each.occluder_size_m)


def formats():
    """The formats of missions."""
    from aosplan.cli.formats import _limits_text

    header = ("name", "endings", "format", "needs a place", "heights above", "in one file")
    rows = [
        (
            f"`{each.name}`",
            " ".join(f"`{suffix}`" for suffix in each.suffixes) or f"`{each.name}:PATH`",
            each.title,
            "yes" if each.needs_place else "no",
            each.altitudes,
            _limits_text(each),
        )
        for each in known_formats().values()
    ]
    return table(header, rows)


LOADED = ("waypoints", "plan")
"""Formats whose files are loaded in the tests by the programs that fly them."""

GRID = {"altitude": 40, "origin": (48.3358, 14.3261), "samples": 9, "baseline": 4}
"""A small mission that is written for each drone."""


def flown():
    """Table of the formats that each drone flies, with the triggers of the camera.  It is found by
    writing files.
    """
    forms = [form for form in known_formats().values() if form.flown_by]
    rows = [
        (f"`{name}`", *(_cell(form, drone, _triggers(name, drone, form)) for form in forms))
        for name, drone in DRONES.items()
    ]
    return table(("drone", *(f"`{form.name}`" for form in forms)), rows)


def _cell(form, drone, triggers):
    if not triggers:
        return "refused"
    known = form.name in drone.mission_formats
    state = "" if form.name in LOADED else " (unverified)" if known else " (not known)"
    return " or ".join(triggers) + state


def _triggers(name, drone, form):
    """The triggers with which files of a format are written for a drone."""
    return [trigger for trigger in ("stop", "distance") if _is_written(name, drone, form, trigger)]


def _is_written(name, drone, form, trigger):
    mission = _mission(name, drone.camera or "flir-vue-pro-640-9mm", trigger)
    try:
        mission_files([mission], form, "grid")
    except RequestError:
        return False
    return True


@cache
def _mission(drone, camera, trigger):
    from aosplan import plan

    return plan(**GRID, drone=drone, camera=camera, trigger=trigger).mission()


def payloads():
    """Payloads of DJI drones."""
    return ", ".join(f"`{name}`" for name in PAYLOADS)


def _text(text):
    return text.replace("|", "\\|").replace("*", "\\*").replace("_", "\\_").rstrip(".")
