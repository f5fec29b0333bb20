"""Photos of a flight that never was, with the positions that a drone's GNSS would write:

    python examples/tutorial/fly.py plan.json photos --miss 4

One small grey JPEG a waypoint of the plan, half a metre off its site (standard deviation along
either axis), the last few sites missing as after an empty battery.  Needs the extra pictures.
"""

import argparse
import json
import math
import random
from fractions import Fraction
from pathlib import Path

from PIL import Image
from PIL.TiffImagePlugin import IFDRational

METRES_A_DEGREE = 111_320.0


def sexagesimal(degrees):
    """Degrees, minutes and seconds as EXIF has them."""
    minutes, seconds = divmod(Fraction(abs(degrees)).limit_denominator(10**9) * 3600, 60)
    parts = (minutes // 60, minutes % 60, seconds.limit_denominator(10**6))
    return tuple(IFDRational(part.numerator, part.denominator) for part in map(Fraction, parts))


def fly(plan, folder, *, miss=0, off_m=0.5, seed=1):
    """Write the photos of a plan's document; how many there are."""
    noise = random.Random(seed)
    folder.mkdir(exist_ok=True)
    waypoints = plan["waypoints"][: len(plan["waypoints"]) - miss]
    for place in waypoints:
        latitude = place["latitude"] + noise.gauss(0.0, off_m) / METRES_A_DEGREE
        east = noise.gauss(0.0, off_m) / METRES_A_DEGREE
        longitude = place["longitude"] + east / math.cos(math.radians(latitude))
        exif = Image.Exif()
        exif[0x8825] = {
            1: "N" if latitude >= 0 else "S",
            2: sexagesimal(latitude),
            3: "E" if longitude >= 0 else "W",
            4: sexagesimal(longitude),
        }
        Image.new("L", (64, 51), 128).save(folder / f"DJI_{place['index']:04d}.jpg", exif=exif)
    return len(waypoints)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("plan", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--miss", type=int, default=0, help="sites at the end without a photo")
    given = parser.parse_args()
    count = fly(json.loads(given.plan.read_text("utf-8")), given.folder, miss=given.miss)
    print(f"Wrote {given.folder}: {count} photos")
