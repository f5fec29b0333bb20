"""Reading of image files as arrays, and writing of integral images.

Images of any mode that Pillow supports are read.  The result has the units of the file: grey values,
or red, green and blue.
"""

from __future__ import annotations

import io
import os
import warnings
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from aosplan.errors import RequestError, SurroundingsError, needs_extra
from aosplan.files import decoding
from aosplan.units import nearest_hint, shown

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from PIL.Image import Image

EXTRA = "pictures"

PLAIN_PIXELS = 25_000_000
"""An image may have this number of pixels, whatever the size of its file."""

PIXELS_A_BYTE = 100
"""Larger images may have at most this number of pixels per byte of their file. Photos have about
one pixel per byte.
"""

REDUCIBLE = (".jpg", ".jpeg")
"""Extensions of images that can be decoded at a fraction of their size."""

BANDS = {
    # For each of Pillow's modes: the mode to which it is converted.
    "1": "L", "L": "L", "LA": "LA", "La": "LA",
    "P": "RGBA", "PA": "RGBA", "RGB": "RGB", "RGBX": "RGB", "RGBA": "RGBA", "RGBa": "RGBA",
    "CMYK": "RGB", "YCbCr": "RGB", "LAB": "RGB", "HSV": "RGB",
    "I": "F", "F": "F", "I;16": "F", "I;16L": "F", "I;16B": "F", "I;16N": "F",
}  # fmt: skip
"""The mode to which each of Pillow's modes is converted."""


RAW = {("L", 0, 1): "u1", ("I;16", 0, 1): "<u2"}
"""Pixel types of uncompressed TIFFs, by the arguments that Pillow passes to its decoder."""

ROWS_AT_ONCE = 256
"""Number of rows that are converted to 8 bits at once."""

ENDS, TAIL_BYTES = {"JPEG": b"\xff\xd9", "PNG": b"IEND\xaeB`\x82"}, 4096
"""Last bytes of complete images, by format, which may be followed by zeros; and the number of bytes
at the end of a file in which they are searched for.
"""

STRIP_OFFSETS, STRIP_LENGTHS = 273, 279
"""TIFF tags of the positions and the lengths of the strips."""

BITS_PER_SAMPLE, SAMPLE_FORMAT, GDAL_NODATA = 258, 339, 42113
"""TIFF tags.  The sample format is 1 for unsigned integers, 2 for signed integers, and 3 for
floats.
"""


class Picture(NamedTuple):
    """An image as an array.

    Parameters
    ----------
    pixels
        Shape (rows, columns, bands): one band of grey values, or red, green and blue; uint8, uint16
        or float32.
    weight
        Shape (rows, columns): alpha between 0 and 1 as float32, if the image has it.
    is_byte
        Whether values are between 0 and 255.
    block_px
        Each pixel is the mean of a square block of pixels of the file; this is the side of the
        block.
    """

    pixels: NDArray[np.uint8] | NDArray[np.uint16] | NDArray[np.float32]
    weight: NDArray[np.float32] | None
    is_byte: bool
    block_px: int = 1

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.pixels.shape[1], self.pixels.shape[0]


class ImageFolder:
    """A folder in which images are found by the names in the poses.

    Parameters
    ----------
    path
        The folder.

    Raises
    ------
    RequestError
        If the folder does not exist.
    """

    def __init__(self, path: str) -> None:
        self.path = path
        try:
            found = sorted(os.listdir(path))
        except (FileNotFoundError, ValueError):
            raise RequestError(f"there is no folder '{path}'") from None
        except NotADirectoryError:
            raise RequestError(
                f"'{path}' is not a folder", "give the folder of the images as IMAGES"
            ) from None
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise SurroundingsError(f"cannot read '{path}': {reason}") from None
        self._names = found
        self._by_stem: dict[str, list[str]] = {}
        for name in found:
            self._by_stem.setdefault(os.path.splitext(name)[0].lower(), []).append(name)

    def holds(self, name: str) -> bool:
        """Whether the folder has at least one file for a name.

        Raises
        ------
        RequestError
            If the name refers to a place outside the folder.
        """
        if os.path.isabs(name) or ".." in name.replace("\\", "/").split("/"):
            raise RequestError(
                f"image {shown(name)} is outside the folder '{self.path}'",
                "names of images are relative to the folder of images",
            )
        stem = os.path.splitext(os.path.basename(name))[0].lower()
        return os.path.isfile(os.path.join(self.path, name)) or (
            not os.path.dirname(name) and stem in self._by_stem
        )

    def file_of(self, name: str) -> str:
        """Path of an image.

        Poses are often computed from other files than those that are published.  A file whose name
        differs only in its extension or in capital letters is therefore accepted, if there is only
        one such file.

        Raises
        ------
        RequestError
            If there is no such file, or if there are several.
        """
        path = os.path.join(self.path, name)
        if os.path.isfile(path):
            return path
        folder, base = os.path.split(name)
        stem = os.path.splitext(base)[0].lower()
        alike = [] if folder else self._by_stem.get(stem, [])
        if len(alike) == 1:
            return os.path.join(self.path, alike[0])
        if alike:
            raise RequestError(
                f"image '{name}' is not in '{self.path}', but the folder contains "
                f"{' and '.join(alike[:3])}",
                "leave only one of them in the folder",
            )
        raise RequestError(
            f"there is no image '{name}' in '{self.path}'", nearest_hint(name, self._names[:2000])
        )


def image_size(path: str) -> tuple[int, int]:
    """Width and height of an image file in pixels, from its header.

    Raises
    ------
    RequestError, SurroundingsError
        In the same cases as `read_picture`.
    """
    with _opened(path) as image:
        return image.size


def damage_of(path: str) -> RequestError | None:
    """The error with which an incomplete image is refused; None for other images.

    Files without the usual end are decoded, because some programs append data to complete images.
    """
    try:
        with _opened(path) as image:
            ends = ENDS.get(image.format or "")
            tags = getattr(image, "tag_v2", {})
        if ends is not None:
            with open(path, "rb") as file:
                file.seek(-min(TAIL_BYTES, os.path.getsize(path)), os.SEEK_END)
                is_complete = file.read().rstrip(b"\0").endswith(ends)
        else:
            starts, lengths = tags.get(STRIP_OFFSETS, ()), tags.get(STRIP_LENGTHS, ())
            last = max(map(sum, zip(starts, lengths, strict=False)), default=0)
            is_complete = last <= os.path.getsize(path)
        if not is_complete:
            read_picture(path)
    except RequestError as error:
        return error
    return None


def read_picture(path: str, block_px: int = 1) -> Picture:
    """Read an image file.

    Parameters
    ----------
    path
        The file.
    block_px
        Side of the square blocks of pixels, in pixels, of which the caller only needs the means. A
        JPEG is therefore decoded at a half, a quarter or an eighth of its size, if its pixels are
        then not larger than the blocks.

    Raises
    ------
    RequestError
        If the file is not an image or is damaged, or if the image has too many pixels for the size
        of the file.
    SurroundingsError
        If the file cannot be read.
    MissingExtraError
        If Pillow is not installed.
    """
    with _opened(path) as image:
        mode = BANDS.get(image.mode)
        if mode is None:
            raise RequestError(f"image '{path}' has pixels of the unknown mode {image.mode}")
        width, height = image.size
        if block_px > 1:
            image.draft(None, (max(width // block_px, 1), max(height // block_px, 1)))
        block_px = max(round(width / image.width), 1)
        try:
            picture = _decoded(image, mode, path)
            picture = _without(picture, getattr(image, "tag_v2", {}).get(GDAL_NODATA))
        except (OSError, SyntaxError, ValueError, IndexError, EOFError) as error:
            raise RequestError(
                f"image '{path}' is damaged: {error}",
                "copy it again, or move it to another folder",
            ) from None
    if block_px == 1:
        return picture
    whole = picture.pixels[: height // block_px, : width // block_px]
    return picture._replace(pixels=whole, block_px=block_px)


def _decoded(image: Image, mode: str, path: str) -> Picture:
    stored = _stored(image, path)
    if stored is not None:
        return Picture(stored[..., np.newaxis], None, is_byte=stored.dtype == np.uint8)
    deep = _deep(image, path)
    return _picture(image, mode) if deep is None else _deep_picture(deep)


def _without(picture: Picture, nodata: Any) -> Picture:
    """A picture in which the value for missing data is replaced by nan. `nodata` is this value as
    text, from GDAL's tag.
    """
    try:
        missing = float(str(nodata).strip("\0 "))
    except ValueError:
        return picture
    pixels = picture.pixels.astype(np.float32)
    pixels[picture.pixels == missing] = np.nan
    return picture._replace(pixels=pixels, is_byte=False)


def _deep(image: Image, path: str) -> NDArray[np.generic] | None:
    """Pixels of an image whose values Pillow would truncate or misread; None for other images.

    Pillow reads only 8 of the 16 bits of colour images, and reads unsigned 32-bit values as signed
    values.
    """
    tags = getattr(image, "tag_v2", {})
    raw = " ".join(str(tile[3]) for tile in getattr(image, "tile", ()))
    bits = tags.get(BITS_PER_SAMPLE) or (16 if ";16" in raw else 8)
    bits = max(bits) if isinstance(bits, tuple) else bits
    if image.mode == "I" and bits == 32 and tags and _first(tags.get(SAMPLE_FORMAT), 1) == 1:
        return np.asarray(image).view(np.uint32)
    if image.mode not in ("RGB", "RGBA", "LA", "CMYK") or bits <= 8:
        return None
    try:
        if image.format == "TIFF":
            import tifffile

            pixels: NDArray[np.generic] = tifffile.imread(path)
            if pixels.ndim == 3 and pixels.shape[:2] != image.size[::-1]:
                pixels = np.moveaxis(pixels, 0, 2)  # The file stores one band after the other.
        else:
            import rasterio

            with decoding("image", path), rasterio.open(path, driver="PNG") as raster:
                pixels = np.moveaxis(raster.read(), 0, 2)
    except Exception:  # noqa: BLE001 (not installed, or one of the codecs is not)
        pixels = np.empty(0)
    if pixels.ndim != 3 or pixels.shape[:2] != image.size[::-1] or pixels.dtype != np.uint16:
        raise RequestError(
            f"image '{path}' has {bits} bits per colour in a format that is not supported",
            "save it as a TIFF with 16 bits per colour, without compression",
        )
    return pixels


def _stored(image: Image, path: str) -> NDArray[Any] | None:
    """Pixels of a grey TIFF without compression, read from its file at once; None for other images.

    Pillow needs several times as long.
    """
    tiles = list(getattr(image, "tile", ()))
    if image.format != "TIFF" or not tiles or tiles[0][3] not in RAW:
        return None
    kind = np.dtype(RAW[tiles[0][3]])
    width, height = image.size
    row, at = 0, tiles[0][2]
    for codec, (left, top, right, bottom), offset, details in tiles:
        # The strips have whole rows, in their order, one directly after the other.
        if (codec, details, left, top, right) != ("raw", tiles[0][3], 0, row, width):
            return None
        if offset != at:
            return None
        row, at = bottom, offset + kind.itemsize * width * (bottom - top)
    if row != height or at > os.path.getsize(path):
        return None
    with open(path, "rb") as file:
        file.seek(tiles[0][2])
        content = file.read(kind.itemsize * width * height)
    return np.frombuffer(content, dtype=kind).reshape(height, width)


def _first(value: Any, otherwise: int) -> int:
    value = value[0] if isinstance(value, tuple) else value
    return otherwise if value is None else int(value)


def _deep_picture(pixels: NDArray[np.generic]) -> Picture:
    """The picture of an array of shape (rows, columns) or (rows, columns, bands). The second of two
    bands, or the fourth of four bands, is alpha.
    """
    if pixels.dtype != np.uint16:
        pixels = pixels.astype(np.float32)
    bands: NDArray[Any] = np.atleast_3d(pixels)
    if bands.shape[2] not in (2, 4):
        return Picture(bands, None, is_byte=False)
    return Picture(bands[..., :-1], (bands[..., -1] / 65535.0).astype(np.float32), is_byte=False)


def _picture(image: Image, mode: str) -> Picture:
    """The pixels of an image, converted to a mode whose values Pillow reads correctly."""
    if mode == "F":
        return _deep_picture(np.asarray(image))
    if image.mode == "P" and "transparency" not in image.info:
        mode = "RGB"
    bands = np.atleast_3d(np.asarray(image if image.mode == mode else image.convert(mode)))
    if mode not in ("LA", "RGBA"):
        return Picture(bands, None, is_byte=True)
    return Picture(bands[..., :-1], (bands[..., -1] / 255.0).astype(np.float32), is_byte=True)


def _opened(path: str) -> Image:
    with needs_extra("reading images", EXTRA):
        from PIL import Image, UnidentifiedImageError
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            image = Image.open(path)
    except (Image.DecompressionBombWarning, Image.DecompressionBombError):
        raise RequestError(
            f"image '{path}' has more than {Image.MAX_IMAGE_PIXELS} pixels"
        ) from None
    except UnidentifiedImageError:
        raise RequestError(f"'{path}' is not an image that Pillow can read") from None
    except (SyntaxError, ValueError, EOFError) as error:
        raise RequestError(f"image '{path}' is damaged: {error}") from None
    except OSError as error:
        if error.errno is None:
            raise RequestError(f"image '{path}' is damaged: {error}") from None
        raise SurroundingsError(
            f"cannot read '{path}': {(error.strerror or str(error)).lower()}"
        ) from None
    _check_size(image, path)
    return image


def _check_size(image: Image, path: str) -> None:
    """Refuse an image with far more pixels than a real image of this file size has."""
    width, height = image.size
    stored = os.path.getsize(path)
    if width * height > max(PLAIN_PIXELS, PIXELS_A_BYTE * stored):
        image.close()
        raise RequestError(
            f"image '{path}' declares {width} x {height} pixels, more than its {stored} bytes can "
            "hold"
        )


def png_bytes(
    values: NDArray[np.float64], seen: NDArray[np.bool_], limits: tuple[float, float]
) -> bytes:
    """An 8-bit PNG.  Pixels that are not seen are transparent.

    Parameters
    ----------
    values
        Shape (rows, columns, bands), with one band or three.
    seen
        Shape (rows, columns): mask of the pixels that are seen.
    limits
        The value that becomes black, and the value that becomes white.
    """
    from PIL import Image

    low, high = limits
    scale = 255.0 / (high - low) if high > low else 255.0
    rows, columns, count = values.shape
    bands = np.zeros((rows, columns, count + 1), dtype=np.uint8)
    # Rows are converted in parts. The values of a large image are therefore not copied as a whole.
    for top in range(0, rows, ROWS_AT_ONCE):
        part = slice(top, top + ROWS_AT_ONCE)
        with np.errstate(invalid="ignore"):
            scaled = np.clip(np.rint((values[part] - low) * scale), 0.0, 255.0)
        bands[part, :, :-1] = np.where(seen[part, :, np.newaxis], scaled, 0.0)
    bands[..., -1] = np.where(seen, 255, 0)
    return _saved(Image.fromarray(bands), "PNG")


def tiff_bytes(values: NDArray[np.float64], seen: NDArray[np.bool_]) -> bytes:
    """A TIFF with one float32 band, nan where nothing is seen."""
    from PIL import Image

    return _saved(
        Image.fromarray(np.where(seen, values[..., 0], np.nan).astype(np.float32)), "TIFF"
    )


def _saved(image: Image, kind: str) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, kind)
    return buffer.getvalue()
