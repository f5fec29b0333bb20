"""A recording: poses and a folder of images, above a focal plane."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING

import numpy as np

from aosplan.errors import RequestError
from aosplan.messages import Message
from aosplan.postflight.integral.focal_plane import UPS, Plane, Raster, footprint_m, pixel_m, upward
from aosplan.postflight.integral.images import ImageFolder, damage_of, image_size
from aosplan.postflight.integral.integral import ViewSource, integrate
from aosplan.postflight.integral.photo_choice import named
from aosplan.postflight.integral.photo_poses import (
    PhotoOptions,
    PosedViews,
    is_photo_folder,
    read_photo_poses,
)
from aosplan.postflight.integral.poses_file import read_poses
from aosplan.postflight.integral.view_subset import chosen

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from aosplan.postflight.integral.camera_pose import Intrinsics, View
    from aosplan.postflight.integral.images import Picture
    from aosplan.postflight.integral.integral import Integral
    from aosplan.postflight.integral.view_subset import ViewSubset

EXTENTS = ("centre", "all")
"""Names of extents: the part of the plane that the central view shows, or the part that any view
shows.
"""


class Recording:
    """Views with their images, above a focal plane.

    Parameters
    ----------
    poses, images
        `poses` is a folder of photos with positions, a file of poses
        (`aosplan.postflight.integral.poses_file.read_poses`), or OpenDroneMap's ``shots.geojson``.
        `images` is the folder of the images; None if the images are the photos in the folder
        `poses`.
    focal_height_m, slope
        Height of the focal plane along the world's upward axis, and its rise along x and y. None if
        the height will be searched for. Until it is found, a provisional height is used: 0 for
        photos, because their heights are above the take-off point, and otherwise a height below the
        cameras.
    up
        Name of the upward axis. If it is None, the axis is z or -z, whichever is opposite to the
        viewing directions.
    camera
        Function that returns the intrinsics for an image size. If it is None, the intrinsics are
        taken from the poses.
    photos
        Values for metadata that the photos do not have.

    Attributes
    ----------
    views
        Views whose images are in the folder.
    missing
        Names of the missing images.
    georeference, origin
        Location of the world, and latitude and longitude of its origin; None if they are not
        known.
    messages
        Warnings about assumptions and about views that were left out.
    sigma_m
        Standard deviation of the positions, if it is known.
    is_height_known
        Whether the heights of the cameras above the plane are about the same as their heights above
        the ground.

    Raises
    ------
    RequestError
        If the poses or the folder are not valid, if all images are missing, if no camera or two
        cameras are given, or if a camera is below the plane.
    """

    def __init__(
        self,
        poses: str,
        images: str | None = None,
        *,
        focal_height_m: float | None = 0.0,
        slope: tuple[float, float] = (0.0, 0.0),
        up: str | None = None,
        camera: Callable[[int, int], Intrinsics] | None = None,
        photos: PhotoOptions | None = None,
    ) -> None:
        found = _posed(poses, images, camera, photos or PhotoOptions())
        if found.georeference is not None:
            up = "z" if up is None else up
        self.georeference, self.origin = found.georeference, found.origin
        self.messages, self.sigma_m = found.messages, found.sigma_m
        images = poses if images is None else images
        posed = found.views
        folder = ImageFolder(images)
        self.views = [view for view in posed if folder.holds(view.name)]
        self.missing = [view.name for view in posed if not folder.holds(view.name)]
        if not self.views:
            folder.file_of(self.missing[0])  # This raises an error about the first missing image.
        paths = [folder.file_of(view.name) for view in self.views]
        damaged = [damage_of(path) for path in paths]
        if any(damaged):
            self.messages = (*self.messages, _left_out(paths, damaged))
            self.views = [v for v, error in zip(self.views, damaged, strict=True) if not error]
            paths = [path for path, error in zip(paths, damaged, strict=True) if not error]
        if up is not None and up not in UPS:
            raise RequestError(f"--up '{up}' is not one of {', '.join(UPS)}")
        self.is_height_known = focal_height_m is not None or is_photo_folder(poses)
        self.plane = Plane(upward(self.views) if up is None else up, focal_height_m or 0.0, slope)
        places = np.array([self.plane.camera_m(view) for view in self.views])
        if not self.is_height_known:
            extent_m = float(np.ptp(places[:, :2], axis=0).max())
            height_m = float(places[:, 2].min()) - max(extent_m, 1.0)
            self.plane = self.plane._replace(height_m=height_m)
            places[:, 2] -= self.plane.height_m
        self.positions_m: NDArray[np.float64] = places[:, :2]
        self.heights_m: NDArray[np.float64] = places[:, 2]
        low = int(np.argmin(self.heights_m))
        if not self.heights_m[low] > 0.0:
            raise RequestError(
                f"image '{self.views[low].name}': its camera is {-self.heights_m[low]:g} m below "
                f"the focal plane at {self.plane.height_m:g} m",
                f"heights are measured along {self.plane.up} of the world; --up is one of "
                f"{', '.join(UPS)}",
            )
        if is_photo_folder(poses):
            lenses = [_fitted(view, path) for view, path in zip(self.views, paths, strict=True)]
        else:
            lenses = _cameras(self.views, paths, camera)
        self.sources = list(map(ViewSource, self.views, lenses, paths))

    def refocus(self, height_m: float, views: Sequence[View], indices: NDArray[np.intp]) -> None:
        """Move the focal plane to a height, and replace the poses of some views."""
        self.plane = self.plane._replace(height_m=height_m)
        for index, view in zip(indices, views, strict=True):
            self.views[index] = view
            self.sources[index] = self.sources[index]._replace(view=view)
        places = np.array([self.plane.camera_m(view) for view in self.views])
        self.positions_m, self.heights_m = places[:, :2], places[:, 2]

    @property
    def central(self) -> ViewSource:
        """The view closest to the centre of the recording."""
        box = self.positions_m.min(axis=0) + self.positions_m.max(axis=0)
        offsets = self.positions_m - 0.5 * box
        return self.sources[int(np.argmin(np.hypot(*offsets.T)))]

    def raster(
        self, extent: str | Sequence[float] = "centre", gsd_m: float | None = None
    ) -> Raster:
        """Pixels of the integral image.  They are the same for any subset of the views.

        Parameters
        ----------
        extent
            ``centre``, ``all``, or (smallest x, smallest y, largest x, largest y) [m] on the plane.
        gsd_m
            Side of a pixel; None for the size of the central view's pixels on the plane.

        Raises
        ------
        RequestError
            If a footprint is infinite because the image contains the horizon, or if there are too
            many pixels.
        """
        middle = self.central
        if gsd_m is None:
            corners = footprint_m(self.plane, middle.view, middle.intrinsics)
            gsd_m = pixel_m(corners, middle.intrinsics)
        if isinstance(extent, str):
            seen = [middle] if extent == "centre" else self.sources
            corners = np.concatenate(
                [footprint_m(self.plane, view, intrinsics) for view, intrinsics, _ in seen]
            )
            extent = [*corners.min(axis=0), *corners.max(axis=0)]
        return Raster.over(extent, gsd_m)

    def choose(self, choice: ViewSubset) -> NDArray[np.intp]:
        """Indices of the views of a subset."""
        return chosen(choice, [view.name for view in self.views], self.positions_m)

    def integrate(
        self,
        choice: ViewSubset,
        raster: Raster,
        *,
        surface: str | None = None,
        adjust: Callable[[ViewSource, Picture], Picture] | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> Integral:
        """The integral image of a subset of views
        (`aosplan.postflight.integral.integral.integrate`).
        """
        sources = (self.sources[index] for index in self.choose(choice))
        relief = None
        if surface is not None:
            from aosplan.postflight.integral.surface import relief_of

            relief = relief_of(surface, self.georeference, self.positions_m[0], raster)
        return integrate(
            sources, self.plane, raster, relief_m=relief, adjust=adjust, progress=progress
        )

    def extent_m(self, indices: NDArray[np.intp]) -> tuple[float, float]:
        """Extent of the positions of some views along x and y of the plane [m]."""
        x, y = np.ptp(self.positions_m[indices], axis=0)
        return float(x), float(y)

    def nearest_m(self, indices: NDArray[np.intp]) -> float | None:
        """Median distance between a view and its nearest neighbour [m]; None for a single view."""
        if len(indices) < 2:
            return None
        from scipy.spatial import cKDTree

        points = self.positions_m[indices]
        distances, _ = cKDTree(points).query(points, k=[2])
        return float(np.median(distances))


def _left_out(paths: Sequence[str], damaged: Sequence[RequestError | None]) -> Message:
    """Warning about damaged images.  If all images are damaged, raises the error about the first."""
    errors = [error for error in damaged if error is not None]
    if len(errors) == len(paths):
        raise errors[0]
    names = [path for path, error in zip(paths, damaged, strict=True) if error is not None]
    are = "are" if len(errors) > 1 else "is"
    return Message(
        "damaged_photos",
        f"{len(errors)} of {len(paths)} photos {are} damaged and left out: "
        f"{named(map(os.path.basename, names))}; copy the files again",
    )


def _cameras(
    views: Sequence[View],
    paths: Sequence[str],
    camera: Callable[[int, int], Intrinsics] | None,
) -> list[Intrinsics]:
    """Intrinsics of each view: the intrinsics in its pose, or the given camera for all views."""
    missing = next((view for view in views if view.intrinsics is None), None)
    if camera is not None:
        known = next((view for view in views if view.intrinsics is not None), None)
        if known is not None:
            raise RequestError(
                f"the poses contain a camera for image '{known.name}', but the command "
                "line gives another one",
                "leave out --camera and --fov",
            )
        # The camera has the same image size for all views. Images of another size are refused when
        # they are read.
        return [camera(*image_size(paths[0]))] * len(views)
    if missing is not None:
        raise RequestError(
            f"the poses contain no camera for image '{missing.name}'",
            "give --fov DEG (the AOS project publishes it with its poses), or --camera NAME",
        )
    return [view.intrinsics for view in views if view.intrinsics is not None]


def _posed(
    poses: str,
    images: str | None,
    camera: Callable[[int, int], Intrinsics] | None,
    photos: PhotoOptions,
) -> PosedViews:
    """Views with their poses, from a source of any kind."""
    if is_photo_folder(poses):
        return read_photo_poses(poses, photos, camera)
    if images is None:
        raise RequestError(
            f"'{poses}' contains poses, but the folder of the images is missing"
            if os.path.exists(poses)
            else f"there is no folder '{poses}'",
            f"aosplan integrate {poses} IMAGES" if os.path.exists(poses) else "",
        )
    if poses.lower().endswith(".geojson"):
        from aosplan.postflight.integral.odm_shots import read_shots

        return read_shots(poses)
    return PosedViews(read_poses(poses))


def _fitted(view: View, path: str) -> Intrinsics:
    """The intrinsics of a photo for the size of its file.  The file may be smaller or larger than
    the original.
    """
    own = view.intrinsics
    assert own is not None  # Views of photos always have intrinsics.
    width, height = image_size(path)
    if abs(width * own.height_px - height * own.width_px) > max(own.width_px, own.height_px):
        raise RequestError(
            f"image '{path}' has {width} x {height} pixels, but its photo has {own.width_px} x "
            f"{own.height_px}",
            "an image may be a scaled photo, but not a part of a photo",
        )
    return own.scaled(width, height)


def least_views(text: str, views: int) -> int:
    """The number of views that have to see a pixel, from a number or a share such as 10%.

    Raises
    ------
    RequestError
        If the text is neither of these, or if the number exceeds the number of views.
    """
    from aosplan.units import share, whole

    if text.strip().endswith("%"):
        return max(math.ceil(share(text, "--min-views") * views - 1e-9), 1)
    least = whole(text, "--min-views")
    if least > views:
        raise RequestError(f"--min-views {least} is more than the {views} photos that are selected")
    return least
