"""Image files as arrays, and integral images as files.

Pillow reads any of its modes; what comes out is float32 in the file's own units: grey values, or
red, green and blue.
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
"""An image may always have so many pixels,"""

PIXELS_A_BYTE = 100
"""and a larger one so many for each byte of its file: photos have about one."""

BANDS = {
    # Pillow's modes: what they are converted to, and whether values stay within 0 to 255.
    "1": "L", "L": "L", "LA": "LA", "La": "LA",
    "P": "RGBA", "PA": "RGBA", "RGB": "RGB", "RGBX": "RGB", "RGBA": "RGBA", "RGBa": "RGBA",
    "CMYK": "RGB", "YCbCr": "RGB", "LAB": "RGB", "HSV": "RGB",
    "I": "F", "F": "F", "I;16": "F", "I;16L": "F", "I;16B": "F", "I;16N": "F",
}  # fmt: skip
"""The mode that each of Pillow's is read as."""


BITS_PER_SAMPLE, SAMPLE_FORMAT = 258, 339
"""Tags of TIFF; formats of samples are 1 without a sign, 2 with it, 3 floats."""


class Picture(NamedTuple):
    """An image as Pillow's float bands.

    Parameters
    ----------
    bands
        One band of grey values, or three of red, green and blue, mode F.
    weight
        Alpha between 0 and 1, mode F, where the image has it.
    is_byte
        Whether values are between 0 and 255.
    """

    bands: tuple[Image, ...]
    weight: Image | None
    is_byte: bool

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.bands[0].size


class Folder:
    """A folder of images, looked up by the names that poses give.

    Parameters
    ----------
    path
        The folder.

    Raises
    ------
    RequestError
        If there is no such folder.
    """

    def __init__(self, path: str) -> None:
        self.path = path
        try:
            found = sorted(os.listdir(path))
        except (FileNotFoundError, ValueError):
            raise RequestError(f"no folder '{path}'") from None
        except NotADirectoryError:
            raise RequestError(
                f"'{path}' is not a folder", "IMAGES is the folder of them"
            ) from None
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise SurroundingsError(f"cannot read '{path}': {reason}") from None
        self._names = found
        self._by_stem: dict[str, list[str]] = {}
        for name in found:
            self._by_stem.setdefault(os.path.splitext(name)[0].lower(), []).append(name)

    def holds(self, name: str) -> bool:
        """Whether there is a file for a name, or more than one.

        Raises
        ------
        RequestError
            If the name leads out of the folder.
        """
        if os.path.isabs(name) or ".." in name.replace("\\", "/").split("/"):
            raise RequestError(
                f"image {shown(name)} leads out of the folder '{self.path}'",
                "names of images are relative to the folder of images",
            )
        stem = os.path.splitext(os.path.basename(name))[0].lower()
        return os.path.isfile(os.path.join(self.path, name)) or (
            not os.path.dirname(name) and stem in self._by_stem
        )

    def file_of(self, name: str) -> str:
        """Path of an image.

        Poses are often made from other files than are published: the same name with another
        ending, or in capitals, will do where there is only one.

        Raises
        ------
        RequestError
                If there is none, or more than one.
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
                f"image '{name}' is not in '{self.path}', but {' and '.join(alike[:3])} are",
                "leave one of them in the folder",
            )
        raise RequestError(
            f"no image '{name}' in '{self.path}'", nearest_hint(name, self._names[:2000])
        )


def image_size(path: str) -> tuple[int, int]:
    """Width and height of an image file in pixels, from its header.

    Raises
    ------
    RequestError, SurroundingsError
        As `read_picture`.
    """
    with _opened(path) as image:
        return image.size


def read_picture(path: str) -> Picture:
    """An image file.

    Raises
    ------
    RequestError
        If it is no image, damaged, or larger than Pillow takes for safe.
    SurroundingsError
        If it cannot be read.
    MissingExtraError
        If Pillow is not installed.
    """
    with _opened(path) as image:
        mode = BANDS.get(image.mode)
        if mode is None:
            raise RequestError(f"image '{path}' has pixels of the unknown mode {image.mode}")
        try:
            deep = _deep(image, path)
            return _floats(image, mode) if deep is None else _deep_bands(deep)
        except (OSError, SyntaxError, ValueError, IndexError, EOFError) as error:
            raise RequestError(f"image '{path}' is damaged: {error}") from None


def _deep(image: Image, path: str) -> NDArray[np.generic] | None:
    """Pixels of an image that Pillow would cut or wrap; None of any other.

    It keeps 8 of the 16 bits of colours, and takes 32 bits without a sign for ones with it.
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
                pixels = np.moveaxis(pixels, 0, 2)  # band after band
        else:
            import rasterio

            with decoding("image", path), rasterio.open(path, driver="PNG") as raster:
                pixels = np.moveaxis(raster.read(), 0, 2)
    except Exception:  # noqa: BLE001 (not installed, or one of the codecs is not)
        pixels = np.empty(0)
    if pixels.ndim != 3 or pixels.shape[:2] != image.size[::-1] or pixels.dtype != np.uint16:
        raise RequestError(
            f"image '{path}' has {bits} bits a colour in a form that is not read",
            "save it as a TIFF of 16 bits a colour, without compression",
        )
    return pixels


def _first(value: Any, otherwise: int) -> int:
    value = value[0] if isinstance(value, tuple) else value
    return otherwise if value is None else int(value)


def _deep_bands(pixels: NDArray[np.generic]) -> Picture:
    """Bands of an array, shape (rows, columns) or (rows, columns, bands); the second or fourth is alpha."""
    if pixels.ndim == 2:
        return Picture((_float_band(pixels),), None, is_byte=False)
    colours = pixels.shape[2] - (pixels.shape[2] in (2, 4))
    bands = tuple(_float_band(pixels[..., band]) for band in range(colours))
    if colours == pixels.shape[2]:
        return Picture(bands, None, is_byte=False)
    weight = _float_band(np.asarray(pixels[..., -1], dtype=np.float32) / np.float32(65535.0))
    return Picture(bands, weight, is_byte=False)


def _floats(image: Image, mode: str) -> Picture:
    """The bands of an image, as a mode of which Pillow knows the values."""
    if image.mode.startswith("I;16"):  # Pillow's own conversion would clip
        return Picture((_float_band(np.asarray(image)),), None, is_byte=False)
    if image.mode == "P" and "transparency" not in image.info:
        mode = "RGB"
    floats = tuple(band.convert("F") for band in image.convert(mode).split())
    if mode not in ("LA", "RGBA"):
        return Picture(floats, None, is_byte=mode != "F")
    weight = _float_band(np.asarray(floats[-1]) / np.float32(255.0))
    return Picture(floats[:-1], weight, is_byte=True)


def _float_band(values: NDArray[np.generic]) -> Image:
    from PIL import Image

    return Image.fromarray(np.ascontiguousarray(values, dtype=np.float32))


def _opened(path: str) -> Image:
    with needs_extra("reading images", EXTRA):
        from PIL import Image, UnidentifiedImageError
    try:
        with warnings.catch_warnings():
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
    """Refuse an image that declares far more pixels than its file can hold of a real one."""
    width, height = image.size
    stored = os.path.getsize(path)
    if width * height > max(PLAIN_PIXELS, PIXELS_A_BYTE * stored):
        image.close()
        raise RequestError(
            f"image '{path}' declares {width} x {height} pixels, more than its {stored} bytes hold"
        )


def png_bytes(
    values: NDArray[np.float64], seen: NDArray[np.bool_], limits: tuple[float, float]
) -> bytes:
    """A PNG of 8 bits, transparent where nothing is seen.

    Parameters
    ----------
    values
        Shape (rows, columns, bands), one band or three.
    seen
        Shape (rows, columns).
    limits
        The values that become black and white.
    """
    from PIL import Image

    low, high = limits
    span = high - low if high > low else 1.0
    with np.errstate(invalid="ignore"):
        scaled = np.clip(np.rint((values - low) * (255.0 / span)), 0.0, 255.0)
    alpha = np.where(seen, 255, 0).astype(np.uint8)
    bands = np.where(seen[..., None], scaled, 0.0).astype(np.uint8)
    kind = "LA" if bands.shape[2] == 1 else "RGBA"
    layers = [Image.fromarray(bands[..., index]) for index in range(bands.shape[2])]
    return _saved(Image.merge(kind, [*layers, Image.fromarray(alpha)]), "PNG")


def tiff_bytes(values: NDArray[np.float64], seen: NDArray[np.bool_]) -> bytes:
    """A TIFF of one band of float32, nan where nothing is seen."""
    return _saved(_float_band(np.where(seen, values[..., 0], np.nan)), "TIFF")


def _saved(image: Image, kind: str) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, kind)
    return buffer.getvalue()
