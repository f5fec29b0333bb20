"""Integral images at several heights, as a TIFF with several pages and as an animation."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np

from aosplan.errors import needs_extra

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

FRAME_MS = 250
"""Duration of a frame of the animation."""

FILM_PX = 800
"""Longest side of the animation."""


def stack_bytes(pages: Sequence[NDArray[np.float64]], heights_m: Sequence[float]) -> bytes:
    """A TIFF with one float32 page per height.  Pixels that too few views see are nan.

    Parameters
    ----------
    pages
        Integral images, each of shape (rows, columns, bands).
    heights_m
        Heights, which become the descriptions of the pages.
    """
    with needs_extra("writing a stack", "pictures"):
        import tifffile

    buffer = io.BytesIO()
    with tifffile.TiffWriter(buffer) as file:
        for page, height in zip(pages, heights_m, strict=True):
            grey = page.shape[2] == 1
            file.write(
                np.asarray(page[..., 0] if grey else page, dtype=np.float32),
                photometric="minisblack" if grey else "rgb",
                description=f"height_m={height:.6g}",
                software=False,
                datetime=None,
                metadata=None,
                contiguous=False,
            )
    return buffer.getvalue()


def film_bytes(
    pages: Sequence[NDArray[np.float64]], heights_m: Sequence[float], limits: tuple[float, float]
) -> bytes:
    """An animated GIF that shows the pages with their heights, first upwards and then downwards.

    Parameters
    ----------
    pages, heights_m
        As in `stack_bytes`.
    limits
        The value that becomes black, and the value that becomes white.
    """
    from PIL import Image, ImageDraw

    low, high = limits
    frames = []
    for page, height in zip(pages, heights_m, strict=True):
        scaled = np.nan_to_num((page - low) * (255.0 / max(high - low, 1e-9)))
        pixels = np.clip(np.rint(scaled), 0.0, 255.0).astype(np.uint8)
        image = Image.fromarray(pixels[..., 0] if pixels.shape[2] == 1 else pixels).convert("RGB")
        scale = FILM_PX / max(image.size)
        size = (max(round(image.width * scale), 1), max(round(image.height * scale), 1))
        image = image.resize(
            size, Image.Resampling.BILINEAR if scale < 4 else Image.Resampling.NEAREST
        )
        pen = ImageDraw.Draw(image)
        label(pen, (10, image.height - 40), f"{height:.4g} m")
        frames.append(image.quantize(128))
    order = [*frames, *frames[-2:0:-1]]
    buffer = io.BytesIO()
    order[0].save(buffer, "GIF", save_all=True, append_images=order[1:], duration=FRAME_MS, loop=0)
    return buffer.getvalue()


def label(pen: object, place: tuple[float, float], text: str, size: int = 26) -> None:
    """Draw white text with a black outline, which is legible on any background."""
    from PIL import ImageFont

    font = ImageFont.load_default(size)
    pen.text(  # type: ignore[attr-defined]
        place, text, fill="white", font=font, stroke_width=max(size // 10, 1), stroke_fill="black"
    )
