"""One stand in LAS files with many variants of units, reference systems and records."""

import struct

import numpy as np
import pytest

laspy = pytest.importorskip("laspy")
pyproj = pytest.importorskip("pyproj")

UNITS = {
    # For each unit: its length in metres, its name in WKT, and its EPSG code.
    "m": (1.0, "metre", 9001),
    "ft": (0.3048, "foot", 9002),
    "us-ft": (1200 / 3937, "US survey foot", 9003),
    "clarke": (0.3047972654, "Clarke's foot", 9005),
    "indian": (0.30479951024814694, "Indian foot", 9080),
}

EAST_M, NORTH_M = 500_000.0, 5_200_000.0
"""Position of the stand, on the central meridian of UTM zone 33N, where the scale is 0.9996."""


def wkt(across, up=None):
    """UTM 33N as WKT 1, with another unit of x and y, and with a unit of z if it is given."""
    metres, name, _ = UNITS[across]
    text = (
        'PROJCS["UTM 33N in its own unit",GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",'
        '6378137,298.257223563]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],'
        'PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",0],'
        'PARAMETER["central_meridian",15],PARAMETER["scale_factor",0.9996],'
        f'PARAMETER["false_easting",{500_000 / metres!r}],PARAMETER["false_northing",0],'
        f'UNIT["{name}",{metres!r}]]'
    )
    if up is None:
        return text
    metres, name, _ = UNITS[up]
    return (
        f'COMPD_CS["both",{text},VERT_CS["height",VERT_DATUM["sea level",2005],'
        f'UNIT["{name}",{metres!r}],AXIS["Up",UP]]]'
    )


def geo_keys(keys, doubles=()):
    """Records of GeoTIFF keys.  A value is a number, or ``(34736, index)`` for a double."""
    rows = [
        (key, *(value if isinstance(value, tuple) else (0, value))) for key, value in keys.items()
    ]
    data = struct.pack("<4H", 1, 1, 0, len(rows))
    data += b"".join(struct.pack("<4H", key, place, 1, value) for key, place, value in rows)
    records = [(34735, data)]
    if doubles:
        records.append((34736, struct.pack(f"<{len(doubles)}d", *doubles)))
    return records


def write_dressed(
    path, xyz, kind, *, before=(), behind=(), bit=None, point_format=6, scale=1e-4, offset_m=None
):
    """Write a file with records of the user id LASF_Projection before and after its points."""
    header = laspy.LasHeader(point_format=point_format)
    header.scales = np.full(3, scale)
    header.offsets = np.floor(xyz.min(axis=1)) if offset_m is None else np.full(3, offset_m)
    if behind:
        header.version = laspy.header.Version(1, 4)
    if bit is not None:
        header.global_encoding.wkt = bit
    for number, data in before:
        header.vlrs.append(laspy.VLR("LASF_Projection", number, record_data=data))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = xyz
    cloud.classification = kind.astype(np.uint8)
    if behind:
        cloud.evlrs = laspy.vlrs.vlrlist.VLRList()
        cloud.evlrs.append(laspy.VLR("Other", 7, record_data=bytes(100)))
        for number, data in behind:
            cloud.evlrs.append(laspy.VLR("LASF_Projection", number, record_data=data))
    cloud.write(str(path))
    return path
