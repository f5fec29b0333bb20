"""Integral images: images per second by size, the cost of mapping single points, and peak memory.

Run: python benchmarks/integrate.py

The recordings are rendered first: a tilted camera above a textured plane.  Times are medians of
whole runs of `integrate`, in seconds on one core, with files read from the disk each time.  "By
points" is the method for distorted images, here used for the same pinhole images.
"""

from __future__ import annotations

import csv
import os
import statistics
import subprocess
import sys
import tempfile
import time
from unittest import mock

import numpy as np
from PIL import Image

from aosplan.postflight.integral import integral as module
from aosplan.postflight.integral.camera_pose import Intrinsics, View
from aosplan.postflight.integral.focal_plane import Plane, Raster
from aosplan.postflight.integral.integral import ViewSource, integrate

HERE = os.path.dirname(os.path.abspath(__file__))
SIZES = {"thermal 640 x 512": (640, 512, "L"), "thermal 640 x 512, 16 bits": (640, 512, "I;16"),
         "colour 1920 x 1080": (1920, 1080, "RGB"), "colour 3000 x 2000": (3000, 2000, "RGB")}  # fmt: skip
VIEWS = 8


def recording(folder, width, height, mode):
    rng = np.random.default_rng(0)
    focal = 0.9 * width
    lens = Intrinsics(width, height, focal, focal, width / 2, height / 2)
    coarse = Image.fromarray(rng.integers(0, 255, (height // 8, width // 8)).astype(np.uint8))
    grey = np.asarray(coarse.resize((width, height), Image.Resampling.BICUBIC))
    picture = {
        "L": lambda: Image.fromarray(grey),
        "I;16": lambda: Image.fromarray(grey.astype(np.uint16) * 100),
        "RGB": lambda: Image.fromarray(np.stack([grey] * 3, axis=-1)),
    }[mode]()
    path = os.path.join(folder, "image." + ("jpg" if mode == "RGB" else "tif"))
    picture.save(path)
    for index in range(VIEWS):
        x, y = divmod(index, 4)
        c, s = np.cos(0.05 * index), np.sin(0.05 * index)
        rotation = np.array([[c, s, 0.0], [s, -c, 0.0], [0.0, 0.0, -1.0]])
        position = np.array([2.8 * x, 2.8 * y, 40.0])
        yield ViewSource(View(f"{index}", rotation, -rotation @ position), lens, path)


def seconds(run, repeats):
    times = []
    for _ in range(repeats):
        start = time.process_time()
        run()
        times.append(time.process_time() - start)
    return statistics.median(times)


def speeds():
    for name, (width, height, mode) in SIZES.items():
        with tempfile.TemporaryDirectory() as folder:
            sources = list(recording(folder, width, height, mode))
            gsd = 40.0 / sources[0].intrinsics.fx_px
            raster = Raster.over((-20, -15, 20, 15), gsd)
            repeats = 5 if width < 1000 else 3

            def run(sources=sources, raster=raster):
                return integrate(sources, Plane("z", 0.0), raster)

            fast = seconds(run, repeats)
            reading = seconds(lambda s=sources: [module.read_picture(i.path) for i in s], repeats)
            with mock.patch.object(Intrinsics, "is_pinhole", False):
                slow = seconds(run, repeats)
            yield (
                name,
                f"{raster.columns} x {raster.rows}",
                f"{VIEWS / fast:.1f}",
                f"{reading / fast:.2f}",
                f"{slow / fast:.2f}",
            )


def against_opencv(count=100):
    """Seconds on one core for thermal photos, beside a loop of OpenCV; None without OpenCV."""
    try:
        import cv2
    except ImportError:
        return None
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as folder:
        sources = list(recording(folder, 640, 512, "L"))
        many = [sources[index % len(sources)] for index in range(count)]
        plane = Plane("z", 0.0)
        raster = Raster.over((-20, -15, 20, 15), 40.0 / sources[0].intrinsics.fx_px)

        def loop():
            sums = np.zeros((raster.rows, raster.columns))
            seen = np.zeros_like(sums)
            half = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])
            for view, lens, path in many:
                image = cv2.imread(path, cv2.IMREAD_UNCHANGED).astype(np.float32)
                camera = np.array([[lens.fx_px, 0, lens.cx_px - 0.5],
                                   [0, lens.fy_px, lens.cy_px - 0.5], [0, 0, 1]])  # fmt: skip
                matrix = camera @ plane.to_camera(view) @ raster.to_plane @ half
                warped = cv2.warpPerspective(
                    image, matrix, (raster.columns, raster.rows),
                    flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, borderValue=float("nan"),
                )  # fmt: skip
                inside = np.isfinite(warped)
                sums += np.where(inside, warped, 0.0)
                seen += inside
            return sums / np.maximum(seen, 1)

        ours = seconds(lambda: integrate(many, plane, raster), 3)
        return ours, seconds(loop, 3)


def memory_mb(count):
    """Peak memory of a process that integrates a number of images of 1920 x 1080."""
    code = (
        "import sys, tempfile; sys.path.insert(0, sys.argv[1]); import integrate as b\n"
        "from aosplan.postflight.integral.integral import integrate\n"
        "from aosplan.postflight.integral.focal_plane import Plane, Raster\n"
        "with tempfile.TemporaryDirectory() as f:\n"
        "    s = list(b.recording(f, 1920, 1080, 'RGB'))\n"
        "    many = (s[i % len(s)] for i in range(int(sys.argv[2])))\n"
        "    integrate(many, Plane('z', 0.0), Raster.over((-20, -15, 20, 15), 0.025))\n"
        "lines = open('/proc/self/status').read().splitlines()\n"
        "print(next(int(x.split()[1]) // 1024 for x in lines if x.startswith('VmHWM')))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, HERE, str(count)], capture_output=True, text=True, check=True
    )
    return int(done.stdout)


def main():
    header = (
        "images",
        "integral",
        "images a second of one core",
        "share of reading",
        "by points, times as long",
    )
    rows = [header, *speeds()]
    for row in rows:
        print("  ".join(f"{cell:<28}" for cell in row))
    peaks = [(count, memory_mb(count)) for count in (3, 12, 48)]
    for count, peak in peaks:
        print(f"{count} colour images of 1920 x 1080: {peak} MB at most")
    compared = against_opencv()
    if compared is not None:
        print("100 thermal photos: {:.2f} s, by a loop of OpenCV {:.2f} s".format(*compared))
    path = os.path.join(HERE, "results", "integrate.csv")
    with open(path, "w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows(rows)
        csv.writer(file).writerows([(), ("images", "peak memory MB"), *peaks])
        if compared is not None:
            shown = [f"{value:.2f}" for value in compared]
            head = ("seconds for 100 thermal photos", "by a loop of OpenCV")
            csv.writer(file).writerows([(), head, shown])


if __name__ == "__main__":
    main()
