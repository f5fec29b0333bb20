"""Built-in cameras, drones, scenes, formats and payloads as Markdown."""

from aosplan.camera.camera import Camera
from aosplan.camera.presets import CAMERAS
from aosplan.flight.drones import DRONES
from aosplan.mission.dji_models import PAYLOADS
from aosplan.mission.export import formats as known_formats
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
    """A table of text."""
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
"""Formats whose files are loaded in the tests by the programs that use them."""


def flown():
    """The formats of each drone, and how they trigger its camera."""
    forms = [form for form in known_formats().values() if form.flown_by]
    rows = []
    for name, drone in DRONES.items():
        cells = []
        for form in forms:
            takes = drone.autopilot in form.flown_by
            if form.asks_drone:
                takes = takes and form.name in drone.mission_formats
            state = "" if form.name in LOADED else " (unverified)"
            cells.append(" or ".join(form.triggers) + state if takes else "refused")
        rows.append((f"`{name}`", *cells))
    return table(("drone", *(f"`{form.name}`" for form in forms)), rows)


def payloads():
    """Payloads of DJI drones."""
    return ", ".join(f"`{name}`" for name in PAYLOADS)


def _text(text):
    return text.replace("|", "\\|").replace("*", "\\*").replace("_", "\\_").rstrip(".")
