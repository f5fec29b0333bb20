"""Writes photos of a simulated flight, with the metadata that a DJI drone writes.

    python examples/tutorial/fly.py plan.json photos --miss 4
    python examples/tutorial/fly.py plan.json photos --stand stand.laz --yaw-bias 3 --height-error 2

The script writes one JPEG for each waypoint of the plan.  The recorded positions have errors with a
standard deviation of half a metre along each axis.  The last sites can be left out, as if the
battery had been empty.  The photos are uniformly grey.  With a stand, they show a chart below the
stand, and the compass and the barometer may have errors.  The script needs the extra pictures, and
the extra lidar if a stand is given.
"""

import argparse
import json
import math
import random
import sys
from fractions import Fraction
from pathlib import Path

from PIL import Image
from PIL.TiffImagePlugin import IFDRational

sys.path.insert(0, str(Path(__file__).parent))

METRES_A_DEGREE = 111_320.0

XMP = """<x:xmpmeta xmlns:x="adobe:ns:meta/">
 <rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
  <rdf:Description rdf:about="DJI Meta Data" xmlns:drone-dji="http://www.dji.com/drone-dji/1.0/"
   drone-dji:GpsLatitude="{latitude:+.9f}" drone-dji:GpsLongitude="{longitude:+.9f}"
   drone-dji:AbsoluteAltitude="{absolute:+.3f}" drone-dji:RelativeAltitude="{relative:+.3f}"
   drone-dji:GimbalRollDegree="+0.00" drone-dji:GimbalYawDegree="{yaw:+.2f}"
   drone-dji:GimbalPitchDegree="-90.00" drone-dji:FlightYawDegree="{yaw:+.2f}"
   {camera}drone-dji:RtkFlag="16"/>
 </rdf:RDF>
</x:xmpmeta>"""


def sexagesimal(degrees):
    """Degrees, minutes and seconds, as in EXIF."""
    minutes, seconds = divmod(Fraction(abs(degrees)).limit_denominator(10**9) * 3600, 60)
    parts = (minutes // 60, minutes % 60, seconds.limit_denominator(10**6))
    return tuple(IFDRational(part.numerator, part.denominator) for part in map(Fraction, parts))


def save(image, path, exif, xmp):
    """Write a JPEG with EXIF and XMP.  XMP is a separate segment after the EXIF segment."""
    image.save(path, exif=exif, quality=95)
    segment = b"http://ns.adobe.com/xap/1.0/\0" + xmp.encode()
    content = path.read_bytes()
    # This is the end of the first segment, which contains EXIF.
    end = 4 + int.from_bytes(content[4:6], "big")
    marker = b"\xff\xe1" + (len(segment) + 2).to_bytes(2, "big")
    path.write_bytes(content[:end] + marker + segment + content[end:])


def waypoints_of(plan):
    """Waypoints of a plan's document, or of a mission as GeoJSON."""
    if "waypoints" in plan:
        return plan["waypoints"]
    points = (each for each in plan["features"] if each["geometry"]["type"] == "Point")
    return [each["properties"] for each in points]


def fly(plan, folder, *, miss=0, off_m=0.5, seed=1, stand=None, yaw_bias=0.0, height_error=0.0,
        first=0):  # fmt: skip
    """Write the photos for a plan's document and return their number."""
    noise = random.Random(seed)
    folder.mkdir(exist_ok=True)
    waypoints = [place for place in waypoints_of(plan) if place.get("photo", True)]
    waypoints = waypoints[: len(waypoints) - miss]
    altitude = plan["altitude_m"] if "altitude_m" in plan else plan["aosplan"]["altitude_m"]
    camera, pictures = "", (Image.new("L", (64, 51), 128) for _ in waypoints)
    if stand is not None:
        from record import PIXEL_M, photos_of

        camera = f'drone-dji:CalibratedFocalLength="{altitude / PIXEL_M:.3f}" '
        pictures = (Image.fromarray(pixels) for _, pixels in photos_of(plan, stand))
    for number, (place, picture) in enumerate(zip(waypoints, pictures, strict=False), first):
        latitude = place["latitude"] + noise.gauss(0.0, off_m) / METRES_A_DEGREE
        east = noise.gauss(0.0, off_m) / METRES_A_DEGREE
        longitude = place["longitude"] + east / math.cos(math.radians(latitude))
        exif = Image.Exif()
        exif[0x010F], exif[0x0110] = "DJI", "M3T"
        exif[0x8825] = {
            1: "N" if latitude >= 0 else "S",
            2: sexagesimal(latitude),
            3: "E" if longitude >= 0 else "W",
            4: sexagesimal(longitude),
        }
        relative = altitude + height_error
        xmp = XMP.format(latitude=latitude, longitude=longitude, absolute=relative + 470.0,
                         relative=relative, yaw=yaw_bias, camera=camera)  # fmt: skip
        save(picture, folder / f"DJI_{number:04d}.jpg", exif, xmp)
    return len(waypoints)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("plan", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--miss", type=int, default=0, help="sites at the end without a photo")
    parser.add_argument("--stand", type=Path, help="point cloud that the photos look through")
    parser.add_argument("--off", type=float, default=0.5, help="error of a position [m]")
    parser.add_argument("--yaw-bias", type=float, default=0.0, help="error of the compass [deg]")
    parser.add_argument("--height-error", type=float, default=0.0, help="error of heights [m]")
    parser.add_argument("--first", type=int, default=0, help="number of the first photo")
    given = parser.parse_args()
    count = fly(json.loads(given.plan.read_text("utf-8")), given.folder, miss=given.miss,
                off_m=given.off, stand=given.stand, yaw_bias=given.yaw_bias,
                height_error=given.height_error, first=given.first)  # fmt: skip
    print(f"Wrote {given.folder}: {count} photos")
