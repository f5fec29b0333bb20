"""The focal plane: its axes in the world, and the part of it that a view sees.

Positions on the plane are (x, y) in metres. If z is up, they are x and y of the world. If z is
down, as in the AOS project, x is the x of the world, and y is minus the y of the world. In both
cases, the image shows the plane from above, with x to the right and y upwards.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from aosplan.postflight.integral.camera_pose import Intrinsics, View

UPS = {"z": (0.0, 0.0, 1.0), "-z": (0.0, 0.0, -1.0), "y": (0.0, 1.0, 0.0), "-y": (0.0, -1.0, 0.0)}
"""Directions of the world that can be the upward direction, by name."""

MOST_PIXELS = 64_000_000
"""Largest number of pixels of an integral image. The sums of a colour image of this size need
2 GB.
"""


class Plane(NamedTuple):
    """A horizontal or tilted plane of the world.

    Parameters
    ----------
    up
        Name of the upward direction, one of `UPS`.
    height_m
        Height of the plane's origin, x = y = 0, along the upward direction.
    slope
        Rise of the plane per metre of its x and of its y.
    """

    up: str
    height_m: float
    slope: tuple[float, float] = (0.0, 0.0)

    @property
    def frame(self) -> NDArray[np.float64]:
        """Directions in the world, as rows: the axes x and y of the plane, and upwards."""
        up = UPS[self.up]
        # Y is the vector product of up and x.
        return np.array([(1.0, 0.0, 0.0), (0.0, up[2], -up[1]), up])

    def camera_m(self, view: View) -> NDArray[np.float64]:
        """x and y of a camera, and its vertical distance above the plane [m]."""
        x, y, up = self.frame @ view.position
        return np.array([x, y, up - self.height_m - self.slope[0] * x - self.slope[1] * y])

    def to_camera(self, view: View) -> NDArray[np.float64]:
        """The 3 x 3 matrix that maps (x, y, 1) on the plane to the camera's frame."""
        frame = self.frame
        origin = frame.T @ (0.0, 0.0, self.height_m)
        along = frame[:2] + np.outer(self.slope, frame[2])
        columns = [*(view.rotation @ along.T).T, view.rotation @ origin + view.translation]
        return np.stack(columns, axis=1)


def heights_above(plane: Plane, view: View) -> NDArray[np.float64]:
    """Vector in the camera's frame that corresponds to one metre above the plane, shape (3,)."""
    lift: NDArray[np.float64] = view.rotation @ plane.frame[2]
    return lift


def upward(views: Sequence[View]) -> str:
    """The upward direction: ``z`` or ``-z``, opposite to the direction in which the cameras look.

    Raises
    ------
    RequestError
        If the mean viewing direction of the cameras is horizontal.
    """
    down = float(np.mean([view.forward[2] for view in views]))
    if abs(down) < 0.1:
        raise RequestError(
            "the cameras do not look along the z axis of the world",
            f"give the upward axis: --up {' or '.join(UPS)}",
        )
    return "z" if down < 0.0 else "-z"


@dataclass(frozen=True)
class Raster:
    """The pixels of an integral image on the plane.

    Parameters
    ----------
    left_m, top_m
        x of the left edge and y of the upper edge.
    gsd_m
        Side of a pixel.
    columns, rows
        Number of columns and of rows.
    """

    left_m: float
    top_m: float
    gsd_m: float
    columns: int
    rows: int

    @classmethod
    def over(cls, extent_m: Sequence[float], gsd_m: float) -> Raster:
        """The raster that covers (smallest x, smallest y, largest x, largest y), beginning at the
        upper left corner.

        Raises
        ------
        RequestError
            If there are too many pixels, or if the extent is empty.
        """
        left, bottom, right, top = extent_m
        if not (right > left and top > bottom):
            raise RequestError(
                f"extent {left:g},{bottom:g},{right:g},{top:g} is empty",
                "write XMIN,YMIN,XMAX,YMAX in metres on the plane",
            )
        # Because of the tolerance, rounding does not add a pixel if a side is a whole number of
        # pixels.
        sides = [
            max(math.ceil(min((b - a) / gsd_m, 1e12) - 1e-6), 1)
            for a, b in ((left, right), (bottom, top))
        ]
        if sides[0] * sides[1] > MOST_PIXELS:
            raise RequestError(
                f"{sides[0]} x {sides[1]} pixels of {gsd_m:g} m are too many",
                f"at most {MOST_PIXELS} are possible; give a larger --gsd or a smaller --extent",
            )
        return cls(left, top, gsd_m, sides[0], sides[1])

    @property
    def extent_m(self) -> tuple[float, float, float, float]:
        """The smallest x, smallest y, largest x and largest y."""
        return (
            self.left_m,
            self.top_m - self.rows * self.gsd_m,
            self.left_m + self.columns * self.gsd_m,
            self.top_m,
        )

    @property
    def to_plane(self) -> NDArray[np.float64]:
        """The 3 x 3 matrix that maps (column, row, 1) to (x, y, 1)."""
        return np.array(
            [[self.gsd_m, 0.0, self.left_m], [0.0, -self.gsd_m, self.top_m], [0.0, 0.0, 1.0]]
        )


def footprint_m(plane: Plane, view: View, intrinsics: Intrinsics) -> NDArray[np.float64]:
    """Corners of the part of the plane that a view shows, shape (4, 2): x and y [m].

    Raises
    ------
    RequestError
        If the camera is not above the plane, or if the image contains the horizon.
    """
    above_m = plane.camera_m(view)[2]
    if not above_m > 0.0:
        raise RequestError(
            f"image '{view.name}': its camera is {-above_m:g} m below the focal plane",
            "--focal-height is measured along the upward axis of the world, which --up sets",
        )
    inverse = np.linalg.inv(plane.to_camera(view))
    corners = []
    for column, row in ((0, 0), (1, 0), (1, 1), (0, 1)):
        x = (column * intrinsics.width_px - intrinsics.cx_px) / intrinsics.fx_px
        y = (row * intrinsics.height_px - intrinsics.cy_px) / intrinsics.fy_px
        if not intrinsics.is_pinhole:
            x, y = intrinsics.undistorted(x, y)
            if math.isnan(x):
                raise RequestError(
                    f"image '{view.name}': its lens distortion maps two points to the same pixel",
                    "calibrate the camera again, or undistort the images first",
                )
        east, north, scale = inverse @ (x, y, 1.0)
        if not scale > 0.0:  # This corner of the image is above the horizon.
            raise RequestError(
                f"image '{view.name}' shows the horizon, so its footprint is infinite",
                "give --extent XMIN,YMIN,XMAX,YMAX and --gsd M",
            )
        corners.append((east / scale, north / scale))
    return np.array(corners)


def pixel_m(corners_m: NDArray[np.float64], intrinsics: Intrinsics) -> float:
    """Mean side of an image's pixels on the plane [m], from its footprint."""
    x, y = corners_m.T
    area = 0.5 * abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))))
    return math.sqrt(area / (intrinsics.width_px * intrinsics.height_px))
