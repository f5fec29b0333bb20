"""Options of ``aosplan integrate``."""

from __future__ import annotations

from typing import Any

from typer.core import TyperOption

from aosplan.cli.options import file_argument, flag_option, json_option, text_option


def integrate_options() -> list[Any]:
    """The parameters of the command."""
    lens, plane, choice = "Photos", "Focal plane", "Choice of views"
    return [
        file_argument(
            "photos",
            "Folder of photos with positions in EXIF or XMP; or poses: JSON with 3 x "
            "4 matrices in the format of the AOS project, a COLMAP folder, or "
            "OpenDroneMap's shots.geojson.",
        ),
        file_argument(
            "images", "Folder of the images, if the first argument gives poses.", required=False
        ),
        text_option(
            "--focal-height", "M", "Height of the plane along the world's upward axis [0].", plane
        ),
        text_option(
            "--focal-surface",
            "DEM",
            "GeoTIFF of ground heights; the focal surface follows the ground.",
            plane,
        ),
        text_option(
            "--slope",
            "X,Y",
            "Slope of the plane to the east and to the north, such as 5%,-3%.",
            plane,
        ),
        text_option(
            "--stack",
            "HEIGHTS",
            "Several planes, such as 0..20:2, with --out a.tif (pages) or a.gif (animation).",
            plane,
        ),
        text_option(
            "--focus",
            "H",
            "Find the height of the ground: auto, or within H1..H2; a number sets --focal-height.",
            plane,
        ),
        text_option(
            "--align",
            "WHAT",
            "With --focus: what to correct in the poses: positions, yaw or none [positions for photos].",
            plane,
        ),
        text_option(
            "--focus-figure",
            "PATH",
            "Draw the agreement against the height: .png, .svg, .pdf.",
            "Output",
        ),
        text_option(
            "--up",
            "AXIS",
            "Upward axis of the world: z, -z, y or -y [z or -z, opposite to the view].",
            plane,
        ),
        text_option("--gsd", "M", "Pixel size of the integral image [that of the images].", plane),
        text_option(
            "--extent",
            "BOX",
            "XMIN,YMIN,XMAX,YMAX on the plane; all: the ground of all views; centre: "
            "the ground of the middle view [centre].",
            plane,
        ),
        text_option(
            "--camera",
            "NAME",
            "Camera (name or file), if the poses have none, or instead of that of the photos.",
            lens,
        ),
        text_option("--fov", "DEG", "Horizontal field of view, instead of a camera.", lens),
        text_option(
            "--band",
            "NAME",
            "Camera to use, if there are several: thermal, visible, wide or zoom.",
            lens,
        ),
        text_option(
            "--plan",
            "FILE",
            "Plan, for values that the photos do not have: camera, altitude, heading  "
            "[plan.json in the folder].",
            lens,
        ),
        text_option(
            "--altitude", "M", "Mean height above the ground, if the photos do not have it.", lens
        ),
        text_option("--heading", "DEG", "Direction of the top of photos without a yaw.", lens),
        text_option(
            "--views",
            "LIST",
            "Views to use: numbers from 1, ranges or names, such as 1-9,12; or a file of them.",
            choice,
        ),
        text_option("--aperture", "M", "Use the views within a square of this side.", choice),
        text_option(
            "--pitch", "M", "Use views at least this far apart, from the middle outwards.", choice
        ),
        text_option(
            "--min-views",
            "N",
            "Pixels that fewer views see are transparent: a number, or a share [10%].",
            choice,
        ),
        text_option(
            "--compare",
            "CHOICE",
            "Compare by SSIM with another choice: all, or pitch=M, aperture=M, views=LIST.",
            choice,
        ),
        TyperOption(
            param_decls=["--out"],
            type=str,
            multiple=True,
            metavar="PATH",
            help=(
                "Write .png (8 bits), .tif (float32, georeferenced) or .npz (with "
                "coverage).  Repeatable."
            ),
            rich_help_panel="Output",
        ),
        flag_option(
            "--stretch",
            "Stretch the PNG from the 1st to the 99th percentile, also for 8-bit images.",
        ),
        text_option(
            "--local", "M", "Increase the PNG's local contrast, within this distance.", "Output"
        ),
        flag_option("--scale", "Add a scale bar and a north arrow to the PNG."),
        flag_option("--equalize", "Equalise the exposure of the photos first."),
        flag_option(
            "--feather", "Reduce the weight of photos towards their edges, to avoid seams."
        ),
        text_option(
            "--anomalies",
            "PATH",
            "Write the share of photos in which each place is anomalous (RX): .tif, .png.",
            "Output",
        ),
        text_option(
            "--hot-spots",
            "PATH",
            "Write the anomalous places as .geojson, with size and contrast.",
            "Output",
        ),
        flag_option("--force", "Overwrite existing files."),
        flag_option("--quiet", "Print no table and no warnings."),
        json_option(),
    ]
