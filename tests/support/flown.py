"""Folders of photos that show a textured plane from known positions.  The photos have the metadata
of drones.
"""

import math

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

from aosplan.geodesy import to_wgs84
from support.recorded import FOCAL, photo

ORIGIN = (48.3358, 14.3261)

DJI = (
    '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:Description drone-dji:GpsLatitude="{latitude:+.9f}" '
    'drone-dji:GpsLongitude="{longitude:+.9f}" drone-dji:RelativeAltitude="{height:+.3f}" '
    'drone-dji:AbsoluteAltitude="{sea:+.3f}" drone-dji:GimbalYawDegree="{yaw:+.2f}" '
    'drone-dji:GimbalPitchDegree="{pitch:+.2f}" drone-dji:GimbalRollDegree="{roll:+.2f}" '
    'drone-dji:CalibratedFocalLength="{focal:.3f}" {more}/></x:xmpmeta>'
)
AUTEL = DJI.replace("drone-dji:", "drone:").replace("GpsLongitude", "GpsLongtitude")
PARROT = (
    "<x:xmpmeta><rdf:Description><drone-parrot:CameraYawDegree>{yaw:.4f}"
    "</drone-parrot:CameraYawDegree><drone-parrot:CameraPitchDegree>{pitch:.4f}"
    "</drone-parrot:CameraPitchDegree><drone-parrot:CameraRollDegree>{roll:.4f}"
    "</drone-parrot:CameraRollDegree></rdf:Description></x:xmpmeta>"
)
PIX4D = (
    '<x:xmpmeta><rdf:Description Camera:Yaw="{yaw:.4f}" Camera:Pitch="{down:.4f}" '
    'Camera:Roll="{roll:.4f}"/></x:xmpmeta>'
)
SKYDIO = (
    "<x:xmpmeta><rdf:Description><drone-skydio:CameraOrientationNED rdf:parseType='Resource'>"
    "<drone-skydio:Yaw>{yaw:.4f}</drone-skydio:Yaw><drone-skydio:Pitch>{pitch:.4f}"
    "</drone-skydio:Pitch><drone-skydio:Roll>{roll:.4f}</drone-skydio:Roll>"
    "</drone-skydio:CameraOrientationNED></rdf:Description></x:xmpmeta>"
)


def rotation_of(yaw, pitch, roll):
    """World-to-camera rotation (east, north, up) from SciPy's Euler angles."""
    body = Rotation.from_euler("ZYX", [yaw, pitch, roll], degrees=True).as_matrix()
    east_north_up = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]) @ body
    return np.stack([east_north_up[:, 1], east_north_up[:, 2], east_north_up[:, 0]])


def write_photo(path, position, angles, *, xmp=DJI, image=None, gps=True, focal=FOCAL, more="",
                mode="L", **tags):  # fmt: skip
    """Write one JPEG or TIFF file.  The photo is taken at a position in metres east, north and up
    from `ORIGIN`.
    """
    east, north, up = position
    (latitude,), (longitude,) = to_wgs84(ORIGIN, [east], [north])
    yaw, pitch, roll = angles
    if image is None:
        image = photo(rotation_of(*angles), np.array(position))
        image = np.rint(image).astype(np.uint8)
    picture = image if isinstance(image, Image.Image) else Image.fromarray(image)
    exif = Image.Exif()
    exif[0x010F], exif[0x0110] = tags.get("make", "DJI"), tags.get("model", "M3T")
    if gps:
        exif[0x8825] = {
            1: "N", 2: sexagesimal(latitude), 3: "E", 4: sexagesimal(longitude),
            5: b"\0", 6: up + 470.0,
        }  # fmt: skip
    if "orientation" in tags:
        exif[0x0112] = tags["orientation"]
    if "exif" in tags:
        exif[0x8769] = tags["exif"]
    text = xmp.format(
        latitude=latitude, longitude=longitude, height=up, sea=up + 470.0, yaw=yaw, pitch=pitch,
        roll=roll, down=pitch + 90.0, focal=focal, more=more,
    )  # fmt: skip
    kind = "TIFF" if path.suffix == ".tif" else "JPEG"
    saved = {} if kind == "TIFF" else {"quality": 95}
    picture.save(path, kind, exif=exif, **saved)
    if xmp and kind == "JPEG":
        segment = b"http://ns.adobe.com/xap/1.0/\0" + text.encode()
        content = path.read_bytes()
        marker = b"\xff\xe1" + (len(segment) + 2).to_bytes(2, "big") + segment
        path.write_bytes(content[:2] + marker + content[2:])


def sexagesimal(degrees):
    whole = math.floor(degrees)
    minutes = (degrees - whole) * 60
    return float(whole), float(math.floor(minutes)), (minutes - math.floor(minutes)) * 60


def fly(folder, *, count=9, seed=1, name="DJI_{:04d}.jpg", **tags):
    """Write photos of a small grid, which are slightly tilted and have several headings.  Returns
    their poses.
    """
    rng = np.random.default_rng(seed)
    folder.mkdir(exist_ok=True)
    side = round(count**0.5)
    poses = []
    for index in range(count):
        x, y = (np.array(divmod(index, side)) - 0.5 * (side - 1)) * 2.0
        position = np.round([x, y, 30.0 + rng.normal(0, 0.5)], 3)
        angles = np.round(
            [rng.uniform(-180, 180), -90 + abs(rng.normal(0, 3)), rng.normal(0, 2)], 2
        )
        write_photo(folder / name.format(index), position, angles, **tags)
        poses.append((position, angles))
    return poses
