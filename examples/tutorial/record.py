"""Writes a simulated recording: the images of a camera above a stand, with a chart below the stand.

    python examples/tutorial/record.py plan.json stand.laz recording

The recording has one vertical photo for each waypoint, with 12.5 cm per pixel.  The plan is centred on the
stand.  Rays are traced through the stand's voxels.  Poses are written in the format of the AOS
project.  The script needs the extras lidar and pictures.
"""

import json
import sys
from pathlib import Path

import numpy as np
from PIL import Image

from aosplan.scenes.files.point_cloud import read_voxels
from aosplan.scenes.occlusion import Occlusion, PlotWindow
from aosplan.simulation.pictures import LEAVES, resolution_chart

GROUND_PX, PHOTO_PX, CHART_PX = 320, 220, 96
PIXELS_A_VOXEL, PIXEL_M = 2, 0.125
NADIR = np.diag([1.0, -1.0, -1.0])


def photos_of(plan, stand):
    """The photos of a plan through a stand: positions [m], and pixels with north at the top."""
    volume = read_voxels(str(stand))
    assert volume.voxel_m == PIXELS_A_VOXEL * PIXEL_M
    first = (volume.occupied.shape[1] * PIXELS_A_VOXEL - GROUND_PX) // 2
    seen = Occlusion(
        volume,
        plan["altitude_m"],
        view="perspective",
        targets_per_voxel=PIXELS_A_VOXEL,
        window=PlotWindow(first, first, GROUND_PX, GROUND_PX),
    )
    ground = np.full((GROUND_PX, GROUND_PX), 0.6)
    margin = (GROUND_PX - CHART_PX) // 2
    chart = resolution_chart(CHART_PX, CHART_PX)
    # Rows are numbered from south to north.
    ground[margin : margin + CHART_PX, margin : margin + CHART_PX] = chart[::-1]
    # Sites are rounded to whole pixels, so that each vertical photo is a part of the ground image.
    sites = np.array([(place["east_m"], place["north_m"]) for place in plan["waypoints"]])
    steps = np.rint(sites / PIXEL_M).astype(int)
    if 2 * abs(steps).max() > GROUND_PX - PHOTO_PX:
        sys.exit(
            "error: the sites are too far from the middle, so photos would reach beyond the stand"
        )
    masks = seen.unpack(seen.masks(steps * PIXEL_M))
    for hidden, step in zip(masks, steps, strict=True):
        shown = np.where(hidden[..., None], LEAVES, ground[..., None])
        column, row = (GROUND_PX - PHOTO_PX) // 2 + step
        photo = shown[row : row + PHOTO_PX, column : column + PHOTO_PX][::-1]
        yield step * PIXEL_M, np.rint(255 * photo).astype(np.uint8)


def record(plan, stand, folder):
    """Write photos and poses and return the number of photos."""
    views = []
    (folder / "images").mkdir(parents=True, exist_ok=True)
    for index, (site, photo) in enumerate(photos_of(plan, stand)):
        name = f"{index:03d}.png"
        Image.fromarray(photo).save(folder / "images" / name)
        position = np.array([*site, plan["altitude_m"]])
        matrix = np.column_stack([NADIR, -NADIR @ position])
        views.append({"imagefile": name, "M3x4": matrix.tolist()})
    focal = plan["altitude_m"] / PIXEL_M
    middle = PHOTO_PX / 2
    camera = {"width": PHOTO_PX, "height": PHOTO_PX, "fx": focal, "fy": focal,
              "cx": middle, "cy": middle}  # fmt: skip
    (folder / "poses.json").write_text(json.dumps({"camera": camera, "images": views}), "utf-8")
    return len(views)


if __name__ == "__main__":
    plan_path, stand_path, folder_path = map(Path, sys.argv[1:])
    count = record(json.loads(plan_path.read_text("utf-8")), stand_path, folder_path)
    print(f"Wrote {folder_path}: {count} photos and their poses")
