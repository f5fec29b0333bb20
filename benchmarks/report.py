"""Reports: the size of a page, and the times to write it and to open it in a browser.

Run: python benchmarks/report.py [--repeats 5]

The plans have 50, 5 000 and 500 000 photos in a rotated grid, with and without a location. Their
pages are opened by the headless Chromium on the PATH. Times are medians. `first_paint_ms` and
`ready_ms` are measured from the start of navigation. At `ready_ms`, the map is complete.
`redraw_ms` is the time of one movement of the map with all photos visible. `hover_us` is the time
of the search for the photo at the pointer. The results are written to
benchmarks/results/report.csv.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import tempfile
import time

from playwright.sync_api import sync_playwright

from aosplan import PlanRequest, plan
from aosplan.show.page.page import report_page

RESULTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "results")
PHOTOS = (50, 5_000, 500_000)
COLUMNS = (
    "photos",
    "place",
    "size_mb",
    "write_ms",
    "first_paint_ms",
    "ready_ms",
    "redraw_ms",
    "hover_us",
)

MEASURE = """() => {
  const clock = (work, times) => {
    const start = performance.now();
    for (let k = 0; k < times; k += 1) work(k);
    return (performance.now() - start) / times;
  };
  const [entry] = performance.getEntriesByType("navigation");
  const paint = performance.getEntriesByName("first-contentful-paint")[0];
  return {
    first: paint ? paint.startTime : NaN,
    ready: entry.domContentLoadedEventEnd,
    redraw: clock(() => window.paint(), 10),
    hover: 1000 * clock((k) => nearest(east[k % count], north[k % count], 16 / view.scale), 1000),
  };
}"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=5)
    repeats = parser.parse_args().repeats
    names = ("chromium", "chromium-browser", "google-chrome", "chrome")
    browser_path = next(filter(None, map(shutil.which, names)), None)
    if browser_path is None:
        print("no Chromium on the path: nothing to measure")
        return
    lines = [",".join(COLUMNS)]
    print("  ".join(f"{name:>14}" for name in COLUMNS))
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=browser_path, args=["--no-sandbox"])
        for photos in PHOTOS:
            for origin in (None, (48.3358, 14.3261)):
                planned = plan(
                    PlanRequest(
                        altitude=40,
                        vhat=0.1,
                        samples=photos,
                        baseline=2.8,
                        heading=20,
                        origin=origin,
                    )
                )
                start = time.perf_counter()
                content = report_page(planned, seed=None)
                write_ms = 1e3 * (time.perf_counter() - start)
                path = os.path.join(folder, "page.html")
                with open(path, "wb") as file:
                    file.write(content)
                found = []
                for _ in range(repeats):
                    page = browser.new_page(viewport={"width": 1200, "height": 900})
                    page.goto(f"file://{path}")
                    page.locator("#map[data-painted]").wait_for()
                    page.wait_for_timeout(100)
                    found.append(page.evaluate(MEASURE))
                    page.close()
                middle = {name: statistics.median(f[name] for f in found) for name in found[0]}
                row = (
                    str(photos),
                    "no" if origin is None else "yes",
                    f"{len(content) / 1e6:.2f}",
                    f"{write_ms:.0f}",
                    f"{middle['first']:.0f}",
                    f"{middle['ready']:.0f}",
                    f"{middle['redraw']:.1f}",
                    f"{middle['hover']:.1f}",
                )
                lines.append(",".join(row))
                print("  ".join(f"{value:>14}" for value in row), flush=True)
        browser.close()
    with open(os.path.join(RESULTS, "report.csv"), "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
