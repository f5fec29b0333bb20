"""Recordings with a known result: images of a textured plane, rendered by tracing the ray of each
pixel.

This module shares no code with `aosplan.postflight.integral`.  The ray of a pixel is rotated from
the camera to the world, and distortion is removed by iteration.  The texture is a formula, so that
the true image is known without interpolation.
"""

import json

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

WIDTH, HEIGHT, FOCAL = 160, 120, 150.0
FOV_DEG = np.degrees(2 * np.arctan(0.5 * WIDTH / FOCAL))


def texture(x, y):
    """Grey values of the plane at positions in metres.  They are between 40 and 216, and their
    periods are 3 m or more.
    """
    waves = np.sin(2.1 * x + 0.3) * np.cos(1.3 * y) + np.sin(0.7 * x - 1.1 * y + 1.0)
    return 128.0 + 44.0 * waves


def nadir_to(yaw_deg, pitch_deg=0.0, roll_deg=0.0, *, z_up=True):
    """World-to-camera rotation of a camera that looks down and is then rotated by three angles."""
    down = Rotation.from_matrix([[1, 0, 0], [0, -1, 0], [0, 0, -1]] if z_up else np.eye(3))
    turn = Rotation.from_euler("zxy", [yaw_deg, pitch_deg, roll_deg], degrees=True)
    return (turn * down).as_matrix()


def undistorted(x, y, k1, k2, p1, p2):
    """Directions without distortion from directions with distortion, by fixed-point iteration."""
    ux, uy = x.copy(), y.copy()
    for _ in range(200):
        r2 = ux**2 + uy**2
        radial = 1 + k1 * r2 + k2 * r2**2
        ux, uy = (
            (x - 2 * p1 * ux * uy - p2 * (r2 + 2 * ux**2)) / radial,
            (y - 2 * p2 * ux * uy - p1 * (r2 + 2 * uy**2)) / radial,
        )
    return ux, uy


def on_plane(rotation, position, height=0.0, *, up=1.0, distortion=None, middle=None):
    """Points at which the rays of all pixels meet the plane: x, y, and whether the plane is in
    front of the camera.
    """
    cx, cy = middle or (WIDTH / 2, HEIGHT / 2)
    column, row = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    x, y = (column - cx) / FOCAL, (row - cy) / FOCAL
    if distortion is not None:
        x, y = undistorted(x, y, *distortion)
    ray = np.stack([x, y, np.ones_like(x)], axis=-1) @ rotation  # This applies Rᵀ to each ray.
    with np.errstate(divide="ignore"):
        along = (up * height - position[2]) / ray[..., 2]
    meet = position + along[..., None] * ray
    return meet[..., 0], meet[..., 1], along > 0


def photo(rotation, position, *, height=0.0, up=1.0, shade=texture, **lens):
    """The image of the plane at a given height, as float32.  A pixel is 0 if its ray does not meet
    the plane.
    """
    x, y, ahead = on_plane(rotation, position, height, up=up, **lens)
    return np.where(ahead, shade(x, up * y), 0.0).astype(np.float32)


def sites(count=9, pitch=2.0, altitude=30.0, seed=1):
    """Positions and slightly tilted rotations of a square grid of cameras."""
    rng = np.random.default_rng(seed)
    side = int(np.sqrt(count))
    for index in range(count):
        x, y = (np.array(divmod(index, side)) - 0.5 * (side - 1)) * pitch
        angles = rng.normal(0.0, [20.0, 3.0, 3.0])
        yield nadir_to(*angles), np.array([x, y, altitude + rng.normal(0, 0.5)])


def write_recording(folder, views, images, *, camera=True, text=False, **saved):
    """Write an AOS JSON and a folder of images, and return both paths."""
    (folder / "images").mkdir(exist_ok=True)
    entries = []
    for index, ((rotation, position), image) in enumerate(zip(views, images, strict=True)):
        name = f"{index:03d}.tif"
        save(image, folder / "images" / name, **saved)
        matrix = np.column_stack([rotation, -rotation @ position])
        rows = [[repr(v) if text else v for v in row] for row in matrix.tolist()]
        entries.append({"imagefile": name, "M3x4": rows})
    document = {"images": entries}
    if camera:
        document["camera"] = {
            "width": WIDTH, "height": HEIGHT, "fx": FOCAL, "fy": FOCAL,
            "cx": WIDTH / 2, "cy": HEIGHT / 2,
        }  # fmt: skip
    (folder / "poses.json").write_text(json.dumps(document))
    return str(folder / "poses.json"), str(folder / "images")


def save(image, path, **saved):
    picture = image if isinstance(image, Image.Image) else Image.fromarray(image)
    picture.save(path, **saved)


def write_colmap(folder, views, images, cameras, *, model_of=lambda _: 1):
    """Write COLMAP's text files and a folder of images, and return both paths."""
    (folder / "images").mkdir(exist_ok=True)
    (folder / "cameras.txt").write_text("# Camera list\n\n" + "\n".join(cameras) + "\n")
    lines = ["# Image list with two lines of data per image:", ""]
    for index, ((rotation, position), image) in enumerate(zip(views, images, strict=True)):
        name = f"shot {index:03d}.tif"
        save(image, folder / "images" / name)
        x, y, z, w = Rotation.from_matrix(rotation).as_quat()
        t = -rotation @ position
        numbers = " ".join(repr(float(v)) for v in (w, x, y, z, *t))
        points = "" if index % 2 else "10.5 20.5 -1 3.25 4.5 7"
        lines += [f"{index + 1} {numbers} {model_of(index)} {name}", points]
    (folder / "images.txt").write_text("\n".join(lines) + "\n")
    return str(folder), str(folder / "images")


def truth(raster, *, shade=texture):
    """The texture of the plane at the centres of a raster's pixels."""
    x = raster.left_m + raster.gsd_m * (np.arange(raster.columns) + 0.5)
    y = raster.top_m - raster.gsd_m * (np.arange(raster.rows) + 0.5)
    return shade(x[None, :], y[:, None])


def shift_px(image, reference, mask):
    """Shift of an image relative to a reference in pixels, from a least-squares fit with the
    gradients.
    """
    down, right = np.gradient(reference)
    inside = mask.copy()
    inside[[0, -1]] = inside[:, [0, -1]] = False
    slopes = np.stack([right[inside], down[inside], np.ones(inside.sum())], axis=1)
    found, *_ = np.linalg.lstsq(slopes, (reference - image)[inside], rcond=None)
    return found[:2]
