"""Options of ``aosplan integrate``."""

from __future__ import annotations

from typing import Any

from aosplan.cli.options import file_argument, flag_option, json_option, text_option
from aosplan.cli.typer_classes import TyperOption


def integrate_options() -> list[Any]:
    """The parameters of the command."""
    lens, choice, plane, image = "Photos", "Choice of photos", "Focal plane", "Image"
    return [
        file_argument(
            "photos",
            "Folder of photos whose EXIF or XMP tags contain the positions.  Or a source of "
            "poses: JSON in the format of the AOS project, a COLMAP folder, or OpenDroneMap's "
            "shots.geojson.",
        ),
        file_argument(
            "images", "Folder of the images, if PHOTOS is a source of poses.", required=False
        ),
        text_option(
            "--plan",
            "FILE",
            "Plan that gives the camera, the altitude and the heading if the tags do not.  "
            "[plan.json in the folder]",
            lens,
        ),
        text_option(
            "--camera",
            "NAME|FILE",
            "Camera of the photos, instead of the camera in the tags or poses.",
            lens,
        ),
        text_option(
            "--fov", "DEG", "Horizontal field of view of the photos, instead of --camera.", lens
        ),
        text_option(
            "--band",
            "NAME",
            "Photos to use, if a folder contains photos of several cameras: thermal, visible, "
            "wide or zoom.",
            lens,
        ),
        text_option(
            "--altitude",
            "M",
            "Mean height of the photos above the ground, if their tags do not contain it.",
            lens,
        ),
        text_option(
            "--heading",
            "DEG",
            "Direction of the upper edge of photos whose tags contain no yaw.",
            lens,
        ),
        text_option(
            "--views",
            "LIST",
            "Photos to use: numbers from 1, ranges or names, such as 1-9,12; or a file that lists "
            "them.",
            choice,
        ),
        text_option(
            "--aperture", "M", "Use only the photos within a square with sides of M.", choice
        ),
        text_option(
            "--pitch",
            "M",
            "Use only photos that are at least M apart, starting in the middle.",
            choice,
        ),
        text_option(
            "--compare",
            "CHOICE",
            "Print the similarity (SSIM) to the integral of another choice of photos: give "
            "all, or a part such as pitch=M, aperture=M, views=LIST.",
            choice,
        ),
        text_option(
            "--focus",
            "H",
            "Find the height of the ground: auto, or between two heights H1..H2.  A single number "
            "has the effect of --focal-height.",
            plane,
        ),
        text_option(
            "--align",
            "WHAT",
            "Part of the poses that --focus corrects: positions (and yaw), yaw, or none.  "
            "[positions for photos]",
            plane,
        ),
        text_option(
            "--focal-height",
            "M",
            "Height of the focal plane along the upward axis of the world.  [0]",
            plane,
        ),
        text_option(
            "--focal-surface",
            "DEM.tif",
            "Focus on the ground of an elevation model (GeoTIFF) instead of a plane.",
            plane,
        ),
        text_option(
            "--slope",
            "X,Y",
            "Slope of the focal plane to the east and to the north, such as 5%,-3%.",
            plane,
        ),
        text_option(
            "--stack",
            "HEIGHTS",
            "Average at several heights, such as 0..20:2.  Needs --out a.tif (one page for each "
            "height) or a.gif (animation).",
            plane,
        ),
        text_option(
            "--up",
            "AXIS",
            "Upward axis of the world: z, -z, y or -y.  [z or -z, opposite to the view]",
            plane,
        ),
        text_option("--gsd", "M", "Size of a pixel on the focal plane.  [as in the photos]", image),
        text_option(
            "--extent",
            "BOX",
            "Part of the focal plane: XMIN,YMIN,XMAX,YMAX; all: the ground of all photos; centre: "
            "the ground of the middle photo.  [centre]",
            image,
        ),
        text_option(
            "--min-views",
            "N",
            "Pixels that fewer than N photos show are transparent: a number, or a share of the "
            "photos.  [10%]",
            image,
        ),
        flag_option("--equalize", "Give all photos the same exposure before averaging.", image),
        flag_option(
            "--feather",
            "Reduce the weight of each photo towards its edges, so that no seams are visible.",
            image,
        ),
        TyperOption(
            param_decls=["--out"],
            type=str,
            multiple=True,
            metavar="PATH",
            help=(
                "Write the integral image: .png (8 bits), .tif (float32, georeferenced) or .npz "
                "(with the number of photos at each pixel).  Repeatable."
            ),
            rich_help_panel="Output",
        ),
        flag_option(
            "--stretch",
            "PNG: make the 1st percentile black and the 99th white, also for 8-bit photos.",
        ),
        text_option(
            "--local", "M", "PNG: increase the contrast relative to surroundings of M.", "Output"
        ),
        flag_option("--scale", "PNG: add a scale bar and a north arrow."),
        text_option(
            "--focus-figure",
            "PATH",
            "Draw how well halves of the photos agree at each height: .png, .svg or .pdf.  Needs "
            "--focus.",
            "Output",
        ),
        text_option(
            "--anomalies",
            "PATH",
            "Write the share of the photos in which each place is anomalous (RX detector): .tif "
            "or .png.",
            "Output",
        ),
        text_option(
            "--hot-spots",
            "PATH",
            "Write the places that differ from their surroundings, with size and contrast: "
            ".geojson.",
            "Output",
        ),
        flag_option("--force", "Overwrite existing files."),
        flag_option("--quiet", "Print no table and no warnings."),
        json_option(),
    ]
