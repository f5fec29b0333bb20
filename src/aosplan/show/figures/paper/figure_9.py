"""Fig. 9: integral images by aperture and number of samples at b = 2.8 m, from the recording of Fig. 10.

Each picture has its SSIM against the integral of all 504 images, as in the paper.  The paper's recording
is not at hand; `figure_10` renders one.
"""

import tempfile

import numpy as np
from common import plt, save, write_csv
from figure_10 import RULE_M, VIEWS, matched, reference, render

from aosplan.postflight.integral.recording import Recording
from aosplan.postflight.integral.view_subset import ViewSubset
from aosplan.simulation.ssim import similarity

APERTURES_M = (0.0, 4.0, 8.0, 12.0, 16.0, 20.0, 28.0)


def main():
    with tempfile.TemporaryDirectory() as folder:
        recording = Recording(*render(folder))
        raster, everything, covered = reference(recording)
        found = [
            recording.integrate(ViewSubset(pitch_m=RULE_M, aperture_m=a), raster)
            for a in APERTURES_M
        ]
    rows = []
    for aperture_m, image in zip(APERTURES_M, found, strict=True):
        both = covered & image.seen(1)
        alike = matched(image.values, everything.values, both)
        ssim, veiled = (
            similarity(values, everything.values, both, 255.0).ssim
            for values in (image.values, alike)
        )
        rows.append((aperture_m, image.views, ssim, veiled))
    figure, panels = plt.subplots(2, 4, figsize=(9.4, 5.2), layout="constrained")
    titles = [f"a = {a:g} m, N = {n}\nSSIM {ssim:.2f}" for a, n, ssim, _ in rows]
    titles.append(f"all: a = 50 m, N = {VIEWS}\nthe reference")
    for panel, title, image in zip(panels.flat, titles, [*found, everything], strict=True):
        panel.imshow(np.clip(image.values / 255.0, 0, 1), interpolation="nearest")
        panel.set(title=title, xticks=[], yticks=[])
        panel.grid(visible=False)
    save(figure, "figure_9")
    write_csv("figure_9", ("aperture_m", "N", "ssim", "ssim_matched"), rows)
    for aperture_m, count, ssim, veiled in rows:
        print(f"  9  a = {aperture_m:g} m, N = {count}: SSIM {ssim:.3f}, with the brightness and contrast "
              f"of the reference {veiled:.3f}")  # fmt: skip


if __name__ == "__main__":
    main()
