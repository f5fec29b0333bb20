"""Writes photos with positions in their EXIF."""

from fractions import Fraction

import pytest

Image = pytest.importorskip("PIL.Image")


def rational(value):
    from PIL.TiffImagePlugin import IFDRational

    return IFDRational(*Fraction(value).limit_denominator(10**7).as_integer_ratio())


def sexagesimal(value):
    value = abs(value)
    minutes = (value - int(value)) * 60
    return rational(int(value)), rational(int(minutes)), rational((minutes - int(minutes)) * 60)


def photo(path, latitude=None, longitude=None, xmp=b"", mode="L", **tags):
    image = Image.new(mode, (8, 6))
    exif = Image.Exif()
    if latitude is not None:
        exif[0x8825] = {
            1: "S" if latitude < 0 else "N",
            2: sexagesimal(latitude),
            3: "W" if longitude < 0 else "E",
            4: sexagesimal(longitude),
        } | tags.get("gps", {})
    image.save(path, exif=exif)
    if xmp:
        # XMP is the second segment of the JPEG, as in files of cameras.
        segment = b"http://ns.adobe.com/xap/1.0/\0" + xmp
        content = path.read_bytes()
        marker = b"\xff\xe1" + (len(segment) + 2).to_bytes(2, "big") + segment
        path.write_bytes(content[:2] + marker + content[2:])
