"""Plans for tests of reports in a browser, and functions that read the map of an open report."""

import re

import pytest

from support.paths import AREAS

PLANS = {
    "default": {"altitude": 40},
    "place": {
        "altitude": 40,
        "vhat": 0.9,
        "origin": (48.3358, 14.3261),
        "heading": 30,
        "grid": "lanes",
        "trigger": "distance",
        "drone": "dji-m3t",
        "takeoff": (48.3355, 14.3255),
    },
    "area": {
        "altitude": 40,
        "vhat": 0.8,
        "area": str(AREAS / "field.geojson"),
        "clear": str(AREAS / "meadow.kml"),
        "no_fly": str(AREAS / "mast.geojson"),
        "heading": "auto",
        "flight_time": 30,
    },
    "line": {
        "altitude": 40,
        "vhat": 0.9,
        "grid": "line",
        "line_length": 200.0,
        "sensitivity": True,
    },
    "clear": {"altitude": 40, "integrated_density": 0, "occluder_size": 0.2, "volume_height": 9},
}


def scale(page):
    return float(page.locator("#map").get_attribute("data-scale"))


def pixel(page, index):
    """Position of a waypoint in pixels of the window.  The map is scrolled into view first."""
    return page.evaluate(
        """(i) => { const map = document.getElementById("map");
                    map.scrollIntoView({ block: "center" });
                    const box = map.getBoundingClientRect();
                    return [box.left + pixelX(east[i]), box.top + pixelY(north[i])]; }""",
        index,
    )


def settled(page):
    """Wait until the map is redrawn.  A new size or theme is noticed in one frame, and the map is
    painted in the next.
    """
    page.evaluate(
        """() => new Promise((done) => {
          let frames = 0;
          const next = () => (frames++ < 3 ? requestAnimationFrame(next) : done());
          next();
        })"""
    )


def colour(page, index):
    """Colour of the map at a waypoint: red, green, blue."""
    return page.evaluate(
        """(i) => {
          const map = document.getElementById("map");
          const copy = new OffscreenCanvas(map.width, map.height);
          const pen = copy.getContext("2d");
          pen.drawImage(map, 0, 0);
          const [x, y] = [pixelX(east[i]), pixelY(north[i])].map((at) => Math.round(at * view.ratio));
          return [...pen.getImageData(x, y, 1, 1).data.slice(0, 3)];
        }""",
        index,
    )


def ink(page, name):
    """A colour of the style sheet: red, green, blue, with a tolerance for rounding."""
    text = page.evaluate("(name) => inks()[name]", name)
    return pytest.approx([int(part) for part in re.findall(r"\d+", text)], abs=2)


def overflow(page):
    return page.evaluate("document.documentElement.scrollWidth - window.innerWidth")
