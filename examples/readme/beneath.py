"""Picture of one photo, of the integral of many photos, and of the ground beneath a simulated
forest.

The rays of each photo are traced to the first leaf.  A leaf is lit by the sun unless crowns above
it are in the way.  The integral is the mean of the photos, registered on the ground, without
further processing.
"""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from PIL import Image, ImageDraw, ImageFont
from scipy.ndimage import uniform_filter

from aosplan import PlanRequest, plan
from aosplan.grid.patterns import local_sites
from aosplan.scenes.occlusion import PlotWindow
from aosplan.simulation.forests import clumped_forest, generator
from aosplan.simulation.moments import estimate
from aosplan.simulation.voxel_views import VoxelViews

HERE = Path(__file__).parent

ALTITUDE_M = 40.0
DENSITY, SEED = 0.58, 63
LEAF_M = 0.1
PLOT_M = (34.0, 34.0)
BASE_M, HEIGHT_M = 2.5, 17.5
GROUND_M = (12.0, 9.0)
PIXEL_M = 0.029
SUN = (0.45, 0.3)
"""Horizontal distance along x and y that sunlight travels per metre of descent."""


def main():
    result = plan(PlanRequest(altitude=ALTITUDE_M, vhat="98%"))
    samples, baseline = result.solution.pattern.samples, result.solution.baseline_m
    sites = np.column_stack(local_sites(result.solution.pattern, baseline, 0.0))
    forest = clumped_forest(generator(SEED), DENSITY, LEAF_M, BASE_M, HEIGHT_M, PLOT_M)
    ground = floor()
    camera = Camera(forest, ground.shape[:2])
    middle = int(np.hypot(*sites.T).argmin())
    total, one = np.zeros_like(ground), None
    for index, site in enumerate(sites):
        photo = camera.photo(site, ground)
        total += photo
        one = photo if index == middle else one
    found = counted(forest, sites)
    print(
        f"  {samples} photos {baseline:.2f} m apart: V̂ = {found.normalized:.3f}; p = "
        f"{found.density:.3f} counted by rays, {np.mean(camera.hidden):.3f} drawn"
    )
    words = (
        "one photo",
        f"integral of {samples} photos, V̂ = {found.normalized:.2f}",
        "what lies beneath",
    )
    panels = [one, total / samples, camera.sunlit(ground)]
    save(side_by_side(panels, words), ground.shape[1])


def counted(forest, sites):
    """Visibility of the ground in the pictures, found by counting rays."""
    rows, columns = (round(side / forest.voxel_m) for side in GROUND_M[::-1])
    _, depth, width = forest.occupied.shape
    window = PlotWindow((depth - rows) // 2, (width - columns) // 2, rows, columns)
    views = VoxelViews(forest, ALTITUDE_M, targets_per_voxel=1, window=window)
    return estimate([views.counts(sites)], one_plot=True)


class Camera:
    """Photos of the centre of a plot.  Each pixel is a place on the ground."""

    def __init__(self, forest, shape):
        self.occupied, self.voxel_m = forest.occupied, forest.voxel_m
        slices, rows, columns = self.occupied.shape
        rng = np.random.default_rng(5)
        self.tone = rng.random((slices, rows, columns), dtype=np.float32)
        # The colours of crowns vary slightly, over distances of some metres.
        self.hue = smooth(rng.random((rows, columns)), round(2.0 / self.voxel_m))
        self.light = np.empty((slices, rows, columns), dtype=np.float16)
        light = np.ones((rows, columns), dtype=np.float32)
        for level in range(slices - 1, -1, -1):
            self.light[level] = light
            light = np.where(self.occupied[level], 0.3 * light, light)
            step = [round(s * (level + 1)) - round(s * level) for s in SUN]
            # Scattered light makes shadows soft and never completely dark.
            light = 0.997 * np.roll(light, step, axis=(1, 0)) + 0.003
        self.floor_light = smooth(light, 3)
        y, x = ((np.arange(n) + 0.5 - 0.5 * n) * PIXEL_M for n in shape)
        self.y, self.x = y, x
        self.hidden = []

    def cells(self, height_m, site):
        """Rows and columns of voxels that the rays meet at a height."""
        share = height_m / ALTITUDE_M
        _, rows, columns = self.occupied.shape
        along = (self.y * (1.0 - share) + site[1] * share) / self.voxel_m + 0.5 * rows
        across = (self.x * (1.0 - share) + site[0] * share) / self.voxel_m + 0.5 * columns
        return (np.floor(v).astype(np.intp) % n for v, n in ((along, rows), (across, columns)))

    def sunlit(self, ground):
        """The ground with shadows of the leaves above it."""
        rows, columns = self.cells(0.0, (0.0, 0.0))
        return ground * (0.62 + 0.38 * self.floor_light[np.ix_(rows, columns)])[..., np.newaxis]

    def photo(self, site, ground):
        """The image of a camera at a site: the first leaf on each ray, or the ground."""
        image = self.sunlit(ground)
        open_ = np.ones(image.shape[:2], dtype=bool)
        for half in range(2 * len(self.occupied) - 1, -1, -1):
            # In each slice, a ray meets two voxels: the one at its entry and the one at its exit.
            level, height = half // 2, (half // 2 + (0.001, 0.999)[half % 2]) * self.voxel_m
            rows, columns = self.cells(height, site)
            hit = open_ & self.occupied[level][np.ix_(rows, columns)]
            if hit.any():
                r, c = np.nonzero(hit)
                image[hit] = self.leaves((level, rows[r], columns[c]))
                open_ &= ~hit
        self.hidden.append(1.0 - open_.mean())
        return image

    def leaves(self, at):
        """Colours of leaves.  They are green with variations by crown and leaf, and brighter in the
        sun.
        """
        level, rows, columns = at
        light, tone = self.light[at].astype(float), self.tone[at].astype(float)
        hue = self.hue[rows, columns]
        high = level / len(self.occupied)
        bright = (0.25 + 0.75 * light) * (0.72 + 0.56 * tone) * (0.7 + 0.45 * high)
        colour = np.stack([0.26 + 0.22 * hue, 0.40 + 0.06 * hue, 0.13 + 0.05 * (1 - hue)], axis=-1)
        return colour * bright[:, np.newaxis]


def smooth(field, width):
    """A field of random numbers, smoothed over a width and scaled to 0 … 1."""
    field = uniform_filter(uniform_filter(field, width, mode="wrap"), width, mode="wrap")
    low, high = np.quantile(field, (0.01, 0.99))
    return np.clip((field - low) / max(high - low, 1e-9), 0.0, 1.0)


# The ground beneath the forest


def floor():
    """The forest floor with the remains of a house, a tent, and a person lying on the ground."""
    shape = tuple(round(side / PIXEL_M) for side in GROUND_M[::-1])
    rng = np.random.default_rng(3)
    y, x = np.meshgrid(*((np.arange(n) + 0.5 - 0.5 * n) * PIXEL_M for n in shape), indexing="ij")
    y = -y  # The far end of the ground is at the top of the picture.
    litter = (
        0.5 * smooth(rng.random(shape), 40)
        + 0.3 * smooth(rng.random(shape), 8)
        + 0.2 * rng.random(shape)
    )
    image = np.array([0.47, 0.38, 0.26]) * (0.7 + 0.5 * litter[..., np.newaxis])
    walls(image, x + 2.6, y - 0.4, rng)
    tent(image, x - 2.9, y - 2.0)
    somebody(image, x - 2.5, y + 2.1)
    return np.clip(image, 0.0, 1.0)


def walls(image, x, y, rng):
    """A rectangle of stones with a doorway and an inner wall."""
    half = (2.4, 3.2)
    inside = (np.abs(x) < half[0]) & (np.abs(y) < half[1])
    core = (np.abs(x) < half[0] - 0.5) & (np.abs(y) < half[1] - 0.5)
    stone = (inside & ~core) | (core & (np.abs(y - 0.6) < 0.22))
    stone &= ~((np.abs(x - 0.9) < 0.5) & (y < -2.0))
    rows = np.floor(y / 0.26).astype(int)
    columns = np.floor((x + 0.19 * (rows % 2)) / 0.38).astype(int)
    seam = ((y / 0.26) % 1.0 < 0.14) | (((x + 0.19 * (rows % 2)) / 0.38) % 1.0 < 0.1)
    grey = 0.68 + 0.2 * rng.random((200, 200))[rows % 200, columns % 200]
    image[stone] = (grey[..., np.newaxis] * np.array([1.0, 0.98, 0.92]))[stone]
    image[stone & seam] *= 0.55


def tent(image, x, y):
    """A ridge tent with one side in the sun."""
    turn = np.radians(25.0)
    along, across = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
    inside = (np.abs(along) < 1.35) & (np.abs(across) < 0.95)
    image[inside & (across >= 0)] = (1.0, 0.62, 0.12)
    image[inside & (across < 0)] = (0.80, 0.40, 0.04)
    image[inside & (np.abs(across) < 0.05)] = (1.0, 0.85, 0.55)
    image[inside & (along > 0.75) & (np.abs(across) < (along - 0.75) * 0.9)] = (0.25, 0.12, 0.05)


def somebody(image, x, y):
    """A person lying on the back with outstretched arms."""
    for start, end, width, colour in (
        ((-0.17, -0.25), (-0.32, -1.15), 0.13, (0.13, 0.2, 0.45)),
        ((0.17, -0.25), (0.34, -1.15), 0.13, (0.13, 0.2, 0.45)),
        ((-0.25, 0.42), (-0.95, 0.72), 0.1, (0.9, 0.12, 0.12)),
        ((0.25, 0.42), (0.95, 0.72), 0.1, (0.9, 0.12, 0.12)),
        ((-0.98, 0.73), (-1.05, 0.76), 0.08, (0.93, 0.76, 0.62)),
        ((0.98, 0.73), (1.05, 0.76), 0.08, (0.93, 0.76, 0.62)),
        ((0.0, -0.15), (0.0, 0.4), 0.27, (0.9, 0.12, 0.12)),
        ((0.0, 0.8), (0.0, 0.86), 0.17, (0.93, 0.76, 0.62)),
        ((0.0, 0.92), (0.0, 0.94), 0.13, (0.25, 0.15, 0.08)),
    ):
        image[from_segment(x, y, start, end) < width * 1.15] = colour


def from_segment(x, y, start, end):
    """Distances of places from a line segment."""
    (ax, ay), (bx, by) = start, end
    dx, dy = bx - ax, by - ay
    share = np.clip(((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy), 0.0, 1.0)
    return np.hypot(x - ax - share * dx, y - ay - share * dy)


# The combined picture

GAP_PX = 8


def side_by_side(images, words):
    """Images in a row with captions, separated by gaps of `GAP_PX` columns."""
    font = ImageFont.truetype(f"{mpl.get_data_path()}/fonts/ttf/DejaVuSans-Bold.ttf", 18)
    rows, columns = images[0].shape[:2]
    row = Image.new("RGB", (len(images) * (columns + GAP_PX) - GAP_PX, rows))
    for place, (image, text) in enumerate(zip(images, words, strict=True)):
        # A gamma curve brightens the images for display.
        panel = Image.fromarray(
            np.clip(np.rint(image ** (1 / 1.35) * 255), 0, 255).astype(np.uint8)
        )
        pen, corner = ImageDraw.Draw(panel), (14, rows - 32)
        left, top, right, bottom = pen.textbbox(corner, text, font=font)
        pen.rectangle((left - 8, top - 7, right + 8, bottom + 7), fill=(16, 20, 24))
        pen.text(corner, text, font=font, fill=(255, 255, 255))
        row.paste(panel, (place * (columns + GAP_PX), 0))
    return row


def save(picture, columns):
    """Write a small image file with 255 colours, and one further colour for the gaps between
    panels.
    """
    reduced = picture.quantize(255, kmeans=2)
    pixels = np.array(reduced)
    for gap in range(columns, pixels.shape[1], columns + GAP_PX):
        pixels[:, gap : gap + GAP_PX] = 255
    reduced.frombytes(pixels.tobytes())
    reduced.putpalette([*reduced.getpalette()[: 3 * 255], 0, 0, 0])
    reduced.save(HERE / "beneath.png", optimize=True, transparency=255)


if __name__ == "__main__":
    main()
