"""A recording of 504 images above a stand, for Figs. 9 and 10.

The paper's recording is not public, so a similar recording is rendered. A chart is on the ground
below the stand. 504 cameras are on a 2 m lattice in a quarter of a disc, at an altitude of 40 m,
and face the chart. Images and poses are written in the format of the AOS project, and are
integrated with the functions that `aosplan integrate` calls.
"""

from __future__ import annotations

import json
import os
import tempfile
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from PIL import Image

from aosplan.postflight.integral.recording import Recording
from aosplan.postflight.integral.view_subset import ViewSubset
from aosplan.scenes.occlusion import Occlusion
from aosplan.show.figures.paper.stand import centred_window, stand
from aosplan.simulation.pictures import LEAVES, resolution_chart
from aosplan.simulation.ssim import similarity

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from aosplan.postflight.integral.integral import Integral
    from aosplan.show.figures.paper.paper_figure import Progress

ALTITUDE_M, PITCH_M, VIEWS = 40.0, 2.0, 504
RULE_M = 2.8
"""Baseline of the paper's model at this altitude."""

IMAGE_PX, FOCAL_PX = 128, 340.0
GROUND_M, CHART_M = 28.0, 12.0
PIXEL_M = 0.1
"""Side of a pixel of the integral images."""


class Compared(NamedTuple):
    """The integral of a selection of views: the number of views, the image with values from 0 to 1,
    and the SSIM against the integral of all views.

    `matched` is the SSIM after brightness and contrast of each band are matched to the reference.
    """

    views: int
    image: Any
    ssim: float
    matched: float


class Rendered:
    """The recording, and the integral of all its images, which is the reference for SSIM."""

    def __init__(self, recording: Recording) -> None:
        half = 0.5 * CHART_M
        self.recording = recording
        self.raster = recording.raster((-half, -half, half, half), PIXEL_M)
        self.reference: Integral = recording.integrate(ViewSubset(), self.raster)

    def compared(self, aperture_m: float, pitch_m: float | None) -> Compared:
        """The integral of a selection of views.  The views are within the aperture and at least one
        pitch apart.
        """
        choice = ViewSubset(pitch_m=pitch_m, aperture_m=aperture_m)
        found = self.recording.integrate(choice, self.raster)
        wanted = self.reference.values
        both = self.reference.seen(VIEWS // 10) & found.seen(1)
        ssim, matched = (
            similarity(values, wanted, both, 255.0).ssim
            for values in (found.values, _matched(found.values, wanted, both))
        )
        return Compared(found.views, _shown(found), ssim, matched)

    @property
    def image(self) -> Any:
        """The reference as an image with values from 0 to 1."""
        return _shown(self.reference)


def compared_subsets(
    seed: int, subsets: Sequence[tuple[float, float | None]], progress: Progress | None
) -> tuple[list[Compared], Any]:
    """Render the recording, and compare the integrals of subsets of its views with the reference.

    Parameters
    ----------
    seed
        Seed of the stand.
    subsets
        Aperture and pitch [m] of each subset.
    progress
        Function that is called with the number of finished steps and the total.  The rendering is
        two steps, and each subset is one.

    Returns
    -------
    compared
        The integral of each subset.
    reference
        The reference as an image with values from 0 to 1.
    """

    def done(step: int) -> None:
        if progress is not None:
            progress(step, len(subsets) + 2)

    with tempfile.TemporaryDirectory() as folder:
        poses = _render(folder, seed)
        done(1)
        recording = Rendered(Recording(poses, os.path.join(folder, "images")))
        done(2)
        found = []
        for step, (aperture_m, pitch_m) in enumerate(subsets, 3):
            found.append(recording.compared(aperture_m, pitch_m))
            done(step)
        return found, recording.image


def _sites() -> NDArray[np.float64]:
    """The sites in a quarter of a disc: the points of a lattice that are nearest to one corner of
    the lattice. The positions are relative to the centre of the sites.
    """
    along = PITCH_M * np.arange(40)
    lattice = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
    near = lattice[np.argsort(np.hypot(*lattice.T), kind="stable")[:VIEWS]]
    return near - 0.5 * near.max(axis=0)  # type: ignore[no-any-return]


def _towards_chart(position: NDArray[np.float64]) -> NDArray[np.float64]:
    """World-to-camera rotation of a camera that is at a given position and looks at the origin."""
    forward = -position / np.linalg.norm(position)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(forward, right), forward])


def _render(folder: str, seed: int) -> str:
    """Write the images and the poses of the recording, and return the path of the poses. Each pixel
    is traced to the ground.
    """
    volume, per_voxel = stand(seed), 2
    window = centred_window(volume, per_voxel, GROUND_M)
    occlusion = Occlusion(
        volume, ALTITUDE_M, view="perspective", targets_per_voxel=per_voxel, window=window
    )
    pitch_m, side = volume.voxel_m / per_voxel, window.rows
    ground = _ground(side, round(CHART_M / pitch_m))
    plane = (np.arange(IMAGE_PX) + 0.5 - IMAGE_PX / 2) / FOCAL_PX
    x, y = np.meshgrid(plane, plane)
    rays = np.stack([x, y, np.ones_like(x)], axis=-1)
    entries = []
    os.mkdir(os.path.join(folder, "images"))
    sites = _sites()
    masks = occlusion.masks(sites)
    for index, site in enumerate(sites):
        hidden = occlusion.unpack(masks[index : index + 1])[0]
        position = np.array([*site, ALTITUDE_M])
        rotation = _towards_chart(position)
        ray = rays @ rotation
        meet = position + ray * (-ALTITUDE_M / ray[..., 2:])
        column, row = (
            np.clip((meet[..., axis] / pitch_m + side / 2).astype(int), 0, side - 1)
            for axis in (0, 1)
        )
        image = np.where(hidden[row, column][..., None], LEAVES, ground[row, column][..., None])
        name = f"{index:03d}.png"
        levels = np.rint(255.0 * image).astype(np.uint8)
        Image.fromarray(levels).save(os.path.join(folder, "images", name), compress_level=1)
        matrix = np.column_stack([rotation, -rotation @ position])
        entries.append({"imagefile": name, "M3x4": matrix.tolist()})
    middle = IMAGE_PX / 2
    size = {"width": IMAGE_PX, "height": IMAGE_PX}
    camera = size | {"fx": FOCAL_PX, "fy": FOCAL_PX, "cx": middle, "cy": middle}
    path = os.path.join(folder, "poses.json")
    with open(path, "w", encoding="utf-8") as file:
        json.dump({"camera": camera, "images": entries}, file)
    return path


def _ground(side: int, chart_px: int) -> NDArray[np.float64]:
    """Image of the grey ground with a chart in the middle. The first row is in the south."""
    ground = np.full((side, side), 0.6)
    margin = (side - chart_px) // 2
    inner = slice(margin, margin + chart_px)
    ground[inner, inner] = resolution_chart(chart_px, chart_px)[::-1]
    return ground


def _matched(
    values: NDArray[np.float64], reference: NDArray[np.float64], covered: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """An image with the brightness and contrast of the reference, matched in each band."""
    bands = [
        np.polyval(np.polyfit(values[covered, k], reference[covered, k], 1), values[..., k])
        for k in range(values.shape[2])
    ]
    found: NDArray[np.float64] = np.stack(bands, axis=-1)
    return found


def _shown(found: Integral) -> Any:
    return np.clip(found.values / 255.0, 0.0, 1.0)
