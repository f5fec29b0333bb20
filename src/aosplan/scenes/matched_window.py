"""The matched window of the detector: for each direction, the mean of a window minus the mean of a
box around it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Spectrum = NDArray[np.complex128]

DIRECTIONS = 12
"""Number of directions of the window; they are evenly distributed over half a turn."""

BOX_M = 4.0
"""Side of the box whose mean the detector subtracts [m]."""

PARTS = 4
"""Number of subdivisions of a pixel along x and along y. The share of a pixel that a target covers
is computed from them.
"""


class MatchedWindow:
    """Means over windows around every pixel of a periodic image.  The windows have the size of a
    target.

    Parameters
    ----------
    target_m
        Width and length of the target.
    shape, pitch_m
        Number of rows and of columns of the images, and size of a pixel along x and y.
    """

    def __init__(
        self, target_m: tuple[float, float], shape: tuple[int, int], pitch_m: tuple[float, float]
    ) -> None:
        self.target_m, self.shape, self.pitch_m = target_m, shape, pitch_m
        self.box_m = max(BOX_M, 2.0 * math.hypot(*target_m))
        angles = np.arange(DIRECTIONS) * (math.pi / DIRECTIONS)
        self._windows = [self._spectrum(self.cover(angle)) for angle in angles.tolist()]
        along, across = (_covered(self.box_m / pitch) for pitch in pitch_m)
        self._box = self._spectrum(np.outer(across, along))

    def cover(self, angle: float, x: float = 0.0, y: float = 0.0) -> Floats:
        """Share of each pixel that a target covers.  The centre of the target is (x, y) pixels from
        the middle pixel.
        """
        reach = 0.5 * math.hypot(*self.target_m)
        fine = []
        for pitch, off in zip(self.pitch_m, (x, y), strict=True):
            half = math.ceil(reach / pitch) + 1
            places = (np.arange((2 * half + 1) * PARTS) + 0.5) / PARTS - half - 0.5
            fine.append((places - off) * pitch)
        along = fine[0][None] * math.cos(angle) + fine[1][:, None] * math.sin(angle)
        across = fine[1][:, None] * math.cos(angle) - fine[0][None] * math.sin(angle)
        width, length = self.target_m
        inside = (np.abs(along) <= 0.5 * length) & (np.abs(across) <= 0.5 * width)
        rows, columns = (len(axis) // PARTS for axis in (fine[1], fine[0]))
        share: Floats = inside.reshape(rows, PARTS, columns, PARTS).mean(axis=(1, 3))
        return share

    def means(self, image: Floats) -> list[Floats]:
        """Mean in the window around every pixel, for each direction."""
        spectrum = np.fft.rfft2(image)
        return [np.fft.irfft2(spectrum * window, self.shape) for window in self._windows]

    def box_mean(self, image: Floats) -> Floats:
        """Mean in the box around every pixel."""
        mean: Floats = np.fft.irfft2(np.fft.rfft2(image) * self._box, self.shape)
        return mean

    def output(self, image: Floats) -> Floats:
        """Output of the detector: the largest mean of the windows, minus the mean of the box."""
        highest: Floats = np.maximum.reduce(self.means(image))
        return highest - self.box_mean(image)

    def _spectrum(self, kernel: Floats) -> Spectrum:
        whole = np.zeros(self.shape)
        rows, columns = np.indices(kernel.shape)
        # A kernel that is larger than the image wraps around.
        np.add.at(
            whole,
            (
                (rows - kernel.shape[0] // 2) % self.shape[0],
                (columns - kernel.shape[1] // 2) % self.shape[1],
            ),
            kernel / kernel.sum(),
        )
        spectrum: Spectrum = np.fft.rfft2(whole)
        return spectrum


def _covered(side: float) -> Floats:
    """Share of each pixel that a line covers.  The line is `side` pixels long, and its centre is
    the middle pixel.
    """
    half = math.ceil(0.5 * side)
    share: Floats = np.clip(0.5 * side - np.abs(np.arange(-half, half + 1)) + 0.5, 0.0, 1.0)
    return share


def peaks(output: Floats, pitch_m: tuple[float, float]) -> Floats:
    """Values of the local maxima, in decreasing order. A local maximum is the largest value within
    about one metre.
    """
    from scipy.ndimage import maximum_filter

    size = [round(1.0 / pitch) | 1 for pitch in pitch_m[::-1]]
    found: Floats = np.sort(output[output == maximum_filter(output, size=size, mode="nearest")])
    return found[::-1]
