"""Integral images: images per second by image size, the time to map single points, and peak memory.

Run: python benchmarks/integrate.py

The recordings are rendered first: a tilted camera above a textured plane.  Times are minima of
whole runs of `integrate`, in seconds on one core, with files read from the disk each time.  "By
points" is the method for distorted images, here used for the same pinhole images.  "Plain loop"
reads the same files with OpenCV, warps each image as a whole and adds it.
"""

from __future__ import annotations

import csv
import os
import subprocess
import sys
import tempfile
import time
from unittest import mock

import cv2
import numpy as np
from PIL import Image

from aosplan.postflight.integral import integral as module
from aosplan.postflight.integral.camera_pose import Intrinsics, View
from aosplan.postflight.integral.focal_plane import Plane, Raster
from aosplan.postflight.integral.integral import ViewSource, integrate

HERE = os.path.dirname(os.path.abspath(__file__))
SIZES = {"thermal 640 x 512": (640, 512, "L"), "thermal 640 x 512, 16 bits": (640, 512, "I;16"),
         "colour 1920 x 1080": (1920, 1080, "RGB"), "colour 5472 x 3648": (5472, 3648, "RGB")}  # fmt: skip
VIEWS = 8
MEMORY = [
    # Number, width and height of the images, and pixel size of the integral divided by the pixel
    # size of an image.
    (3, 1920, 1080, 1.0), (48, 1920, 1080, 1.0), (3, 5472, 3648, 4.5), (24, 5472, 3648, 4.5),
    (3, 5472, 3648, 1.0), (24, 5472, 3648, 1.0),
]  # fmt: skip


def recording(folder, width, height, mode):
    rng = np.random.default_rng(0)
    coarse = Image.fromarray(rng.integers(0, 255, (height // 8, width // 8)).astype(np.uint8))
    grey = np.asarray(coarse.resize((width, height), Image.Resampling.BICUBIC))
    picture = {
        "L": lambda: Image.fromarray(grey),
        "I;16": lambda: Image.fromarray(grey.astype(np.uint16) * 100),
        "RGB": lambda: Image.fromarray(np.stack([grey] * 3, axis=-1)),
    }[mode]()
    path = os.path.join(folder, "image." + ("jpg" if mode == "RGB" else "tif"))
    picture.save(path)
    return [source._replace(path=path) for source in views(width, height)]


def views(width, height):
    """Views without a file."""
    focal = 0.9 * width
    lens = Intrinsics(width, height, focal, focal, width / 2, height / 2)
    for index in range(VIEWS):
        x, y = divmod(index, 4)
        c, s = np.cos(0.05 * index), np.sin(0.05 * index)
        rotation = np.array([[c, s, 0.0], [s, -c, 0.0], [0.0, 0.0, -1.0]])
        position = np.array([2.8 * x, 2.8 * y, 40.0])
        yield ViewSource(View(f"{index}", rotation, -rotation @ position), lens, "")


def seconds(ways, repeats):
    """Shortest processor time of each of several functions, which are called in turn."""
    times = [[] for _ in ways]
    for _ in range(repeats):
        for run, spent in zip(ways, times, strict=True):
            start = time.process_time()
            run()
            spent.append(time.process_time() - start)
    return [min(spent) for spent in times]


def plain_loop(sources, plane, raster):
    """The integral image by a loop of OpenCV over whole images."""
    sums = seen = 0.0
    half = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])
    for view, lens, path in sources:
        image = cv2.imread(path, cv2.IMREAD_UNCHANGED).astype(np.float32)
        camera = np.array([[lens.fx_px, 0, lens.cx_px - 0.5],
                           [0, lens.fy_px, lens.cy_px - 0.5], [0, 0, 1]])  # fmt: skip
        matrix = camera @ plane.to_camera(view) @ raster.to_plane @ half
        warped = cv2.warpPerspective(
            image, matrix, (raster.columns, raster.rows),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, borderValue=(float("nan"),) * 3,
        )  # fmt: skip
        inside = np.isfinite(warped)
        sums = sums + np.where(inside, warped, 0.0)
        seen = seen + inside
    return sums / np.maximum(seen, 1)


def speeds():
    cv2.setNumThreads(1)
    for name, (width, height, mode) in SIZES.items():
        with tempfile.TemporaryDirectory() as folder:
            sources = recording(folder, width, height, mode)
            gsd = 40.0 / sources[0].intrinsics.fx_px
            plane, raster = Plane("z", 0.0), Raster.over((-20, -15, 20, 15), gsd)
            repeats = 9 if width < 1000 else 3
            # Small images are repeated, so that a run takes long enough to be measured.
            several = sources * (12 if width < 1000 else 1)

            def ours(several=several, plane=plane, raster=raster):
                return integrate(several, plane, raster)

            def by_points(ours=ours):
                with mock.patch.object(Intrinsics, "is_pinhole", False):
                    return ours()

            def reading(several=several):
                return [module.read_picture(source.path) for source in several]

            def loop(several=several, plane=plane, raster=raster):
                return plain_loop(several, plane, raster)

            fast, slow, read, plain = seconds((ours, by_points, reading, loop), repeats)
            yield (
                name,
                f"{raster.columns} x {raster.rows}",
                f"{len(several) / fast:.1f}",
                f"{read / fast:.2f}",
                f"{slow / fast:.2f}",
                f"{plain / fast:.2f}",
            )


def memory_mb(count, width, height, ratio):
    """Peak memory of a process that integrates colour images."""
    code = (
        "import sys, tempfile; sys.path.insert(0, sys.argv[1]); import integrate as b\n"
        "from aosplan.postflight.integral.integral import integrate\n"
        "from aosplan.postflight.integral.focal_plane import Plane, Raster\n"
        "count, width, height = map(int, sys.argv[2:5])\n"
        "s = [v._replace(path=sys.argv[6]) for v in b.views(width, height)]\n"
        "gsd = float(sys.argv[5]) * 40.0 / s[0].intrinsics.fx_px\n"
        "many = (s[i % len(s)] for i in range(count))\n"
        "integrate(many, Plane('z', 0.0), Raster.over((-20, -15, 20, 15), gsd))\n"
        "lines = open('/proc/self/status').read().splitlines()\n"
        "print(next(int(x.split()[1]) // 1024 for x in lines if x.startswith('VmHWM')))\n"
    )
    with tempfile.TemporaryDirectory() as folder:
        path = recording(folder, width, height, "RGB")[0].path
        numbers = map(str, (count, width, height, ratio))
        command = [sys.executable, "-c", code, HERE, *numbers, path]
        return int(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def main():
    header = (
        "images",
        "integral",
        "images a second of one core",
        "share of reading",
        "by points, times as long",
        "plain loop, times as long",
    )
    rows = [header, *speeds()]
    for row in rows:
        print("  ".join(f"{cell:<28}" for cell in row))
    peaks = [("images", "size", "integral", "peak memory MB")]
    for count, width, height, ratio in MEMORY:
        gsd = ratio * 40.0 / (0.9 * width)
        peak = memory_mb(count, width, height, ratio)
        size = f"{round(40 / gsd)} x {round(30 / gsd)}"
        peaks.append((count, f"{width} x {height}", size, peak))
        print(*peaks[-1])
    for name, table in (("integrate", rows), ("integrate_memory", peaks)):
        path = os.path.join(HERE, "results", f"{name}.csv")
        with open(path, "w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows(table)


if __name__ == "__main__":
    main()
