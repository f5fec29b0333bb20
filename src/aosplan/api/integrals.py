"""Integral images of recordings: `integrate`."""

from __future__ import annotations

import os
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from aosplan.api.summarized import Summarized, warnings_text
from aosplan.errors import RequestError
from aosplan.postflight.integral import integral as integrals
from aosplan.units import percent

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from matplotlib.axes import Axes

    from aosplan.messages import Message
    from aosplan.postflight.integral.focus import Focus


@dataclass(frozen=True, repr=False)
class Integral(Summarized, integrals.Integral):
    """An integral image.

    It has the attributes of `aosplan.postflight.integral.integral.Integral`: `values` of shape
    (rows, columns, bands), `coverage` (number of views that see each pixel), `raster` (extent and
    pixel size [m]).
    """

    focus: Focus | None = None
    """Result of the search for the focus: curve, peaks and corrections; None without a search."""
    warnings: tuple[Message, ...] = ()
    """Warnings for the user."""

    def summary(self) -> tuple[str, dict[str, str]]:
        """The result as text: a headline and named values."""
        rows, columns, bands = self.values.shape
        headline = f"Integral of {self.views} views, {columns} x {rows} pixels"
        west, south, east, north = self.raster.extent_m
        facts = {
            "Pixel": f"{100.0 * self.raster.gsd_m:.3g} cm",
            "Extent": f"{east - west:.4g} x {north - south:.4g} m",
            "Bands": str(bands),
            "Seen": f"{percent(float((self.coverage > 0.0).mean()))} of the pixels are in at least "
            "one photo",
        }
        if self.focus is not None:
            facts["Focus"] = f"{self.focus.name} at {self.focus.ground.place:.3g} m"
        return headline, facts | warnings_text(self.warnings)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the image on the focal plane, in metres.

        Parameters
        ----------
        ax
            Axes to draw on; a new figure by default.
        """
        from aosplan.show.figures.axes import axes_or_new

        ax = axes_or_new(ax, (5.5, 5.0))
        west, south, east, north = self.raster.extent_m
        grey = self.values.shape[2] == 1
        shown = self.values[:, :, 0] if grey else self.values / (255.0 if self.is_byte else 1.0)
        look: dict[str, Any] = {"cmap": "gray"} if grey else {}
        ax.imshow(shown, extent=(west, east, south, north), **look)
        ax.set(xlabel="x [m]", ylabel="y [m]")
        return ax


def integrate(
    photos: str | os.PathLike[str],
    images: str | os.PathLike[str] | None = None,
    *,
    focal_height_m: float | None = None,
    focal_surface: str | os.PathLike[str] | None = None,
    slope: tuple[float, float] = (0.0, 0.0),
    focus: str | tuple[float, float] | None = None,
    align: str | None = None,
    up: str | None = None,
    camera: str | os.PathLike[str] | None = None,
    fov_deg: float | None = None,
    band: str | None = None,
    plan: str | os.PathLike[str] | None = None,
    altitude_m: float | None = None,
    heading_deg: float | None = None,
    extent: str | Sequence[float] = "centre",
    gsd_m: float | None = None,
    views: str | None = None,
    aperture_m: float | None = None,
    pitch_m: float | None = None,
    equalize: bool = False,
    feather: bool = False,
    progress: Callable[[int], None] | None = None,
) -> Integral:
    """Average recorded images on a focal plane.

    Parameters
    ----------
    photos
        A folder of photos with EXIF and XMP, a file of poses, or a COLMAP folder.
    images
        The folder of the images, if `photos` is a file of poses or a COLMAP folder.
    focal_height_m
        Height of the focal plane along the world's upward axis; by default 0, or the result of
        `focus`.
    focal_surface
        A GeoTIFF of ground heights. Every pixel of the integral image is then focused on the
        ground.
    slope
        Rise of the plane per metre to the east and to the north.
    focus, align
        `focus` starts a search for the height of the ground.  It is ``auto``, or the height of the
        lowest and of the highest plane [m].  `align` gives the part of the poses that the search
        corrects: ``positions``, ``yaw`` or ``none``; by default ``positions`` for photos.
    up
        Axis of the world that points upwards: ``z``, ``-z``, ``y`` or ``-y``.  By default z or -z,
        whichever is opposite to the viewing directions.
    camera, fov_deg
        The camera, if the poses do not contain one: a preset or file, or a horizontal field of
        view.
    band, plan, altitude_m, heading_deg
        Options for a folder of photos. `band` is the band to use, and `plan` the file of the plan.
        `altitude_m` is the height of the cameras above the take-off point, and `heading_deg` the
        direction of the top edge of the photos. They are needed if the metadata of the photos do
        not contain them.
    extent
        Part of the plane that is drawn: ``centre``, ``all``, or (smallest x, smallest y, largest x,
        largest y) [m].
    gsd_m
        Pixel size of the integral image. The default is the pixel size of the images on the ground.
    views, aperture_m, pitch_m
        The views to use.  `views` gives numbers from 1, ranges and names.  `aperture_m` is the side
        of a square; only views in it are used.  `pitch_m` is the smallest distance between two used
        views.
    equalize, feather
        Whether the exposure of the photos is equalised, and whether their weight decreases towards
        their edges.
    progress
        Function that is called with the number of finished views.

    Raises
    ------
    RequestError
        If the poses or images are not valid, if the camera is not known, or if the search finds no
        plane in focus.
    """
    from aosplan.postflight.integral.camera_pose import named_camera
    from aosplan.postflight.integral.focus import focus_recording, search_of
    from aosplan.postflight.integral.integral_warnings import focus_warnings, integral_warnings
    from aosplan.postflight.integral.photo_poses import PhotoOptions, check_band
    from aosplan.postflight.integral.recording import Recording, least_views
    from aosplan.postflight.integral.seeing import adjustment
    from aosplan.postflight.integral.view_subset import ViewSubset
    from aosplan.units import positive

    surface = None if focal_surface is None else os.fspath(focal_surface)
    heights, height_m = search_of(focus, focal_height_m, surface)
    if focus is None and align is not None:
        raise RequestError("align needs focus", "give focus='auto'")
    recording = Recording(
        os.fspath(photos),
        None if images is None else os.fspath(images),
        focal_height_m=0.0 if height_m is None and heights is None else height_m,
        slope=slope,
        up=up,
        camera=named_camera(None if camera is None else os.fspath(camera), fov_deg),
        photos=PhotoOptions(
            check_band(band), None if plan is None else os.fspath(plan), altitude_m, heading_deg
        ),
    )
    choice = ViewSubset(pitch_m, aperture_m, views)
    indices = recording.choose(choice)
    found_focus = focus_recording(recording, indices, heights, align=align)
    raster = recording.raster(extent, None if gsd_m is None else positive(gsd_m, "gsd_m", "m"))
    adjust = adjustment(recording, indices, raster, equalize=equalize, feather=feather)
    found = recording.integrate(choice, raster, surface=surface, adjust=adjust, progress=progress)
    return Integral(
        **{field.name: getattr(found, field.name) for field in fields(found)},
        focus=found_focus,
        warnings=(
            *integral_warnings(recording, found, least_views("10%", found.views)),
            *focus_warnings(found_focus),
        ),
    )
