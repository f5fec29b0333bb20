"""For every kind of file that aosplan reads: a valid file, and a command that reads it."""

import io
import json
import re
import struct
import subprocess
import sys
import zipfile
from typing import NamedTuple

import numpy as np

OUR_LINES = re.compile(r"(error|hint|warning|note): \S|Wrote \S|[a-z0-9 ]+: \S")
"""Lines on stderr that aosplan itself writes, and no library."""


class Seed(NamedTuple):
    """A valid file: its name, its content, and a command line that reads it."""

    name: str
    content: bytes
    command: str


PLAN = "plan --altitude 40 --samples 9 --baseline 2"
STAND = {
    "name": "stand", "title": "A stand", "occluder_size_m": 0.3, "volume_height_m": 10.0,
    "volume_base_m": 2.0, "density": 0.02,
}  # fmt: skip
LAYERS = {
    "name": "layers",
    "layers": [{"bottom_m": 2.0, "top_m": 2.5, "density": 0.06, "occluder_size_m": 0.3}],
    "correlogram": {"directions_deg": [0.0], "lags": [0.1, 0.2], "rho": [[0.5, 0.1]], "reach": 2.0},
    "density_by_offset": [[0.06, 0.07]],
    "integrated_density": 0.06,
}
CAMERA = {
    "name": "core", "focal_length_mm": 13.0, "sensor_width_mm": 7.68, "sensor_height_mm": 6.144,
    "image_width_px": 640, "image_height_px": 512,
}  # fmt: skip
RING = [[14.0, 48.0], [14.0004, 48.0], [14.0004, 48.0003], [14.0, 48.0003], [14.0, 48.0]]
AREA = {
    "type": "FeatureCollection",
    "features": [
        {
            "type": "Feature",
            "properties": {"name": "field"},
            "geometry": {"type": "Polygon", "coordinates": [RING]},
        }
    ],
}
KML = (
    '<?xml version="1.0" encoding="UTF-8"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document>'
    "<Placemark><Polygon><outerBoundaryIs><LinearRing><coordinates>"
    + " ".join(f"{x},{y},0" for x, y in RING)
    + "</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark></Document></kml>"
).encode()
POSES = {
    "images": [
        {"imagefile": "a.png", "M3x4": [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 30]]},
        {"imagefile": "b.png", "M3x4": [[1, 0, 0, 2], [0, -1, 0, 0], [0, 0, -1, 30]]},
    ]
}
INTEGRATE = "integrate {poses} images --out o.png --force"


def toml(table):
    """A table as TOML."""
    import tomli_w

    return tomli_w.dumps(table).encode()


def table(document):
    """A table as JSON."""
    return json.dumps(document).encode()


def kmz():
    """An archive with a KML document."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("doc.kml", KML)
    return content.getvalue()


def cloud(folder, name):
    """A point cloud of a few trees."""
    import laspy

    rng = np.random.default_rng(0)
    header = laspy.LasHeader(point_format=6)
    header.scales = np.full(3, 0.001)
    data = laspy.LasData(header)
    data.x, data.y = rng.uniform(0.0, 12.0, (2, 2000))
    canopy = rng.random(2000) < 0.3
    data.z = np.where(canopy, rng.uniform(3.0, 9.0, 2000), 0.0)
    data.classification = np.where(canopy, 5, 2).astype(np.uint8)
    data.write(str(folder / name))
    return (folder / name).read_bytes()


def raster(folder, **profile):
    """A GeoTIFF of heights."""
    import rasterio

    heights = np.random.default_rng(1).uniform(0.0, 20.0, (40, 40)).astype(np.float32)
    given = {
        "driver": "GTiff", "height": 40, "width": 40, "count": 1, "dtype": "float32",
        "crs": "EPSG:32633", "transform": rasterio.Affine(5.0, 0.0, 425_500.0, 0.0, -5.0, 5_317_200.0),
    }  # fmt: skip
    with rasterio.open(folder / "seed.tif", "w", **(given | profile)) as file:
        file.write(heights, 1)
    return (folder / "seed.tif").read_bytes()


def image(kind):
    """A small picture."""
    from PIL import Image

    content = io.BytesIO()
    values = np.arange(48 * 64, dtype=np.uint8).reshape(48, 64)
    Image.fromarray(values).save(content, kind)
    return content.getvalue()


def photo():
    """A JPEG with a position in its EXIF."""
    from PIL import Image

    content = io.BytesIO()
    picture = Image.new("L", (16, 16))
    exif = picture.getexif()
    exif[0x8825] = {1: "N", 2: (48.0, 0.0, 0.5), 3: "E", 4: (14.0, 0.0, 0.5)}
    picture.save(content, "JPEG", exif=exif)
    return content.getvalue()


def made(folder, *arguments):
    """Output of a command of aosplan."""
    line = [sys.executable, "-m", "aosplan", *arguments]
    done = subprocess.run(line, cwd=folder, capture_output=True, check=True)
    return done.stdout


def seeds(folder):
    """A valid file of each kind.  Further inputs of the commands are written to `folder`."""
    (folder / "images").mkdir()
    for name in ("a.png", "b.png"):
        (folder / "images" / name).write_bytes(image("PNG"))
    (folder / "poses.json").write_bytes(table(POSES))
    (folder / "photos").mkdir()
    plan = made(folder, *PLAN.split(), "--origin", "48.0,14.0", "--json")
    (folder / "plan.json").write_bytes(plan)
    flown = {}
    for ending in ("waypoints", "plan", "geojson", "csv", "kml"):
        made(folder, "export", "plan.json", "--out", f"flown.{ending}")
        flown[ending] = (folder / f"flown.{ending}").read_bytes()
    las, laz = cloud(folder, "seed.las"), cloud(folder, "seed.laz")
    made(folder, "scene", "seed.las", "--save", "seed.npz")
    integrated = INTEGRATE.format(poses="poses.json") + " --fov 60"
    cameras = b"1 OPENCV 64 48 50.0 50.0 32.0 24.0 0.01 0.001 0.0 0.0\n"
    views = b"1 1 0 0 0 0 0 30 1 a.png\n0 0 -1\n2 1 0 0 0 2 0 30 1 b.png\n0 0 -1\n"
    (folder / "cameras.txt").write_bytes(cameras)
    (folder / "images.txt").write_bytes(views)
    slices = b"bottom_m,top_m,density,occluder_size_m\n2,2.5,0.1,0.3\n4,4.5,0.2,0.3\n"
    place = "--origin 48.003,14.003"
    found = [
        Seed("x.json", table(STAND), "scene x.json --json"),
        Seed("x.toml", toml(STAND), f"{PLAN} --scene x.toml --json"),
        Seed("x.json", table(LAYERS), "scene x.json --json"),
        Seed("x.toml", toml(LAYERS), f"{PLAN} --scene x.toml --model layered --json"),
        Seed("x.csv", slices, "scene x.csv --json"),
        Seed("x.json", table(CAMERA), f"{PLAN} --camera x.json --json"),
        Seed("x.toml", toml({"altitude": 40.0, "vhat": 0.9, "origin": [48.0, 14.0]}), "plan x.toml --json"),
        Seed("x.json", plan, "export x.json --out o.csv --force"),
        Seed("x.json", plan, "review flown.csv x.json --json"),
        Seed("x.geojson", table(AREA), f"{PLAN} --area x.geojson --json"),
        Seed("x.kml", KML, f"{PLAN} --area x.kml --json"),
        Seed("x.kmz", kmz(), f"{PLAN} --area x.kmz --json"),
        Seed("x.las", las, "scene x.las --json"),
        Seed("x.laz", laz, "scene x.laz --json"),
        Seed("x.npz", (folder / "seed.npz").read_bytes(), "scene x.npz --json"),
        Seed("x.tif", raster(folder), "scene x.tif --voxel 2 --json"),
        Seed("x.tif", raster(folder, compress="deflate"), f"{PLAN} --terrain x.tif {place} --json"),
        Seed("x.json", table(POSES), INTEGRATE.format(poses="x.json") + " --fov 60"),
        Seed("cameras.txt", cameras, INTEGRATE.format(poses=".")),
        Seed("images.txt", views, INTEGRATE.format(poses=".")),
        Seed("images/a.png", image("PNG"), integrated),
        Seed("images/a.png", image("TIFF"), integrated),
        Seed("photos/x.jpg", photo(), "review photos plan.json --json"),
        Seed("x.toml", b'[sweep]\nscene = ["paper-forest"]\naltitude = [30, 40]\nvhat = [0.8, "90%"]\n', "sweep x.toml --summary"),
        Seed("x.csv", b"altitude,vhat\n40,0.9\n50,80%\n", "sweep x.csv --summary"),
        Seed("x.parquet", parquet(), "sweep x.parquet --out o.csv --force"),
        Seed("x.csv", b"east_m,north_m\n0,0\n2,0\n0,2\n", "thin x.csv --samples 2 --altitude 40"),
    ]  # fmt: skip
    for ending in ("waypoints", "plan", "geojson", "csv"):
        line = f"visibility --positions x.{ending} --density 0.5 --spacing 2"
        found.append(Seed(f"x.{ending}", flown[ending], line))
    return found


def parquet():
    """A table of scenarios.  The table is written in another process, because the threads of polars
    do not survive a fork.
    """
    code = (
        "import sys, polars\n"
        "table = {'altitude': [40.0, 50.0], 'scene': ['paper-forest', 'open-woodland']}\n"
        "polars.DataFrame(table).write_parquet(sys.stdout.buffer, compression='uncompressed')\n"
    )
    return subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout


NUMBERS = [
    struct.pack(layout, value)
    for layout, value in [
        ("<I", 0), ("<I", 1), ("<I", 2**31), ("<I", 2**32 - 1), (">I", 2**32 - 1), ("<H", 2**16 - 1),
        ("<Q", 2**63), ("<Q", 2**64 - 1), ("<d", 1e308), ("<d", float("nan")), ("<d", float("inf")),
        ("<d", -0.0), ("<f", 3e38), ("B", 0), ("B", 255),
    ]
]  # fmt: skip
"""Values that may cause an overflow if they are written to a field of a binary file."""

WORDS = [
    *b"1e308 -1e308 1e999 NaN Infinity -0 0 1e-320 9007199254740993 99999999999999999999".split(),
    *b'"" null true [] {} [[]] \\ud800 \\u0000 \xff \xed\xa0\x80 \xef\xbb\xbf = , ; : . - + @'.split(),
    *b"' \" < & [ ] { } 0x7f".split(),
    b"\0", b"\n", b"\r", b"\t", b" ", b"9" * 400,
]  # fmt: skip
"""Texts that replace a word of a text file."""
