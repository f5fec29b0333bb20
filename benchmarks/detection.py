"""Predicted and simulated detection, and the time of each method for one prediction.

    python benchmarks/detection.py [CLOUD.laz ...]

The forests are slices of independent occluders (presets, with densities from 0.3 to 0.97),
generated stands with crowns, and the western halves of point clouds if given. For each forest, the
contrast is chosen so that the model predicts that about half of the targets are found. At this
contrast, errors of the prediction are largest. The simulated searches are in other forests than the
prediction: other random slices, other stands with the same parameters, or the eastern half of the
cloud. For stands, there is also a prediction by independent slices of the same density, as in a
plan without a point cloud. It takes ten minutes and writes tables and a figure to
benchmarks/results/.
"""

from __future__ import annotations

import csv
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from aosplan.grid.patterns import local_sites, pattern_for
from aosplan.models.clutter import HECTARE_M2
from aosplan.models.counted_detection import count_detection, tail_level
from aosplan.models.detection import PERSON, DetectionModel
from aosplan.models.seen_share import SHARES
from aosplan.models.signatures import Signature
from aosplan.scenes.presets import SCENES
from aosplan.scenes.scene import Layer, UniformScene
from aosplan.simulation.forests import clumped_forest, generator
from aosplan.simulation.search import SIZE_M, TargetRadiance, search_layers, search_volume

if TYPE_CHECKING:
    from collections.abc import Callable

    from aosplan.models.detection import Detection
    from aosplan.scenes.voxels import VoxelVolume
    from aosplan.simulation.search import Searched

RESULTS = Path(__file__).parent / "results"
ALTITUDE_M = 50.0
FORESTS = 8
SEED = 11
STAND = (0.4, 2.5, 15.5, (SIZE_M, SIZE_M))
"""Voxel, base, thickness and size of the stands [m]."""


class Case(NamedTuple):
    """One comparison: its name and group, the photos, and the functions that predict and simulate
    it.
    """

    group: str
    name: str
    samples: int
    baseline_m: float
    crown_share: float
    predict: Callable[[Signature], Detection]
    search: Callable[[TargetRadiance, int], Searched]


def main() -> None:
    rows = []
    for case in cases(sys.argv[1:]):
        rows.append(compared(case))
        print(
            {k: round(v, 3) if isinstance(v, float) else v for k, v in rows[-1].items()}, flush=True
        )
    write("detection.csv", rows)
    figure(rows)
    write("detection_ways.csv", list(ways()))


def cases(clouds: list[str]):
    """All comparisons."""
    for name in ("paper-forest", "savanna", "conifer-forest", "broadleaf-forest", "dense-forest"):
        scene = SCENES[name]
        layers = UniformScene(
            name,
            None,
            scene.occluder_size_m,
            scene.volume_base_m,
            scene.volume_height_m,
            scene.integrated_density,
        ).slices()
        yield of_layers("independent", f"{name}, p {scene.integrated_density:.2f}", layers, 25, 1.5)
    for density in (0.3, 0.6, 0.9, 0.97):
        layers = UniformScene("u", None, 0.3, 2.0, 15.0, density).slices()
        for samples, baseline in ((1, 1.0), (9, 2.0), (36, 2.0)):
            yield of_layers("independent", f"p {density:g}", layers, samples, baseline)
    layers = UniformScene("u", None, 0.3, 2.0, 15.0, 0.9).slices()
    yield of_layers("crown clutter", "p 0.9, 40 % of crowns", layers, 25, 2.0, 0.4)
    yield of_layers("single slice", "p 0.9", (Layer(11.9, 12.1, 0.9, 0.5),), 9, 2.0)
    for density in (0.6, 0.8, 0.9, 0.97):
        for samples, baseline in ((9, 2.0), (25, 2.0)):
            yield of_stand("measured stand", density, samples, baseline)
    for density in (0.6, 0.9):
        yield of_stand("stand as slices", density, 25, 2.0)
    for path in clouds:
        yield from of_cloud(path)


def sites_of(samples: int, baseline_m: float):
    return np.column_stack(local_sites(pattern_for("trimmed", samples), baseline_m, 0.0))


def of_layers(group, name, layers, samples, baseline_m, crown_share=0.0) -> Case:
    sites = sites_of(samples, baseline_m)

    def predict(signature: Signature) -> Detection:
        return DetectionModel(layers, ALTITUDE_M, PERSON, signature).predict_positions(sites)

    def search(look: TargetRadiance, index: int) -> Searched:
        return search_layers(layers, sites, ALTITUDE_M, look, seed=SEED, index=index)

    return Case(group, name, samples, baseline_m, crown_share, predict, search)


def of_stand(group, density, samples, baseline_m) -> Case:
    sites = sites_of(samples, baseline_m)

    def predict(signature: Signature) -> Detection:
        if group == "measured stand":
            volume = clumped_forest(generator(SEED, 1000), density, *STAND)
            return counted(volume, sites, signature)
        layers = UniformScene("u", None, *(STAND[0], STAND[1], STAND[2]), density).slices()
        return DetectionModel(layers, ALTITUDE_M, PERSON, signature).predict_positions(sites)

    def search(look: TargetRadiance, index: int) -> Searched:
        volume = clumped_forest(generator(SEED, index), density, *STAND)
        return search_volume(volume, sites, ALTITUDE_M, look, seed=SEED + 1, index=index)

    return Case(group, f"p {density:g}", samples, baseline_m, 0.0, predict, search)


def of_cloud(path: str):
    from aosplan.scenes.files.point_cloud import read_voxels

    volume = read_voxels((path,), voxel_m=0.25, ground="auto", min_height_m=2.0)
    half = volume.occupied.shape[2] // 2
    west = replace(volume, occupied=volume.occupied[:, :, :half].copy())
    east = replace(volume, occupied=volume.occupied[:, :, half : 2 * half].copy())
    for samples, baseline in ((9, 2.0), (25, 2.0)):
        sites = sites_of(samples, baseline)
        for group, model, truth in (
            ("half of a cloud", west, east),
            ("same cloud", volume, volume),
        ):

            def search(look: TargetRadiance, index: int, truth=truth, sites=sites) -> Searched:
                return search_volume(truth, sites, ALTITUDE_M, look, seed=SEED + 1, index=index)

            def predict(signature: Signature, model=model, sites=sites) -> Detection:
                return counted(model, sites, signature)

            yield Case(group, Path(path).stem, samples, baseline, 0.0, predict, search)


def counted(volume: VoxelVolume, sites, signature: Signature) -> Detection:
    return count_detection(volume, sites, ALTITUDE_M, PERSON, signature, false_alarms=1.0)


def compared(case: Case) -> dict[str, object]:
    """A prediction and its simulated search, at the same threshold and false-alarm rate."""
    curve = case.predict(Signature(1.0, -0.5, case.crown_share)).curve
    contrast = min((abs(share - 0.5), at) for at, share in curve if 0.0 < share < 1.0)[1]
    start = time.perf_counter()
    found = case.predict(Signature(contrast, -0.5, case.crown_share))
    predicting = time.perf_counter() - start
    look = TargetRadiance(*PERSON, contrast, -0.5, case.crown_share)
    start = time.perf_counter()
    searched = [case.search(look, index) for index in range(FORESTS)]
    searching = time.perf_counter() - start
    hits = [float((each.outputs > found.threshold).mean()) for each in searched]
    area = sum(each.area_m2 for each in searched) / HECTARE_M2
    peaks = np.sort(np.concatenate([each.peaks for each in searched]))[::-1]
    at_rate = tail_level(peaks, area)
    row: dict[str, object] = {
        "group": case.group,
        "name": case.name,
        "photos": case.samples,
        "baseline_m": case.baseline_m,
        "contrast": contrast,
        "predicted": found.probability,
        "simulated": float(np.mean(hits)),
        "standard_error": float(np.std(hits, ddof=1) / FORESTS**0.5),
        "stated_error": found.standard_error,
        "simulated_at_rate": float(np.mean([(each.outputs > at_rate).mean() for each in searched])),
        "false_alarms_per_hectare": float((peaks > found.threshold).sum() / area),
        "threshold": found.threshold,
        "threshold_at_rate": at_rate,
        "hectares": area,
        "predicting_s": predicting,
        "searching_s": searching,
    }
    for share in SHARES:
        row[f"seen_{share:g}_predicted"] = found.seen.at_least(share)
        row[f"seen_{share:g}_simulated"] = float(
            np.mean([(e.seen >= share).mean() for e in searched])
        )
    return row


def ways():
    """Time and error of each method for one case: a person in the default scene, 49 photos, C =
    1.
    """
    layers = UniformScene("u", 0.0095, 0.2, 2.506, 17.54).slices()
    pattern, signature = pattern_for("trimmed", 49), Signature(0.75, 0.0, 0.0)
    start = time.perf_counter()
    model = DetectionModel(layers, ALTITUDE_M, PERSON, signature)
    exact = model.predict(pattern, 2.0)
    yield {"way": "integrals", "seconds": time.perf_counter() - start, "error": 0.0, "of": "itself"}
    start = time.perf_counter()
    model.for_search()
    yield {"way": "table, once", "seconds": time.perf_counter() - start, "error": None, "of": ""}
    start = time.perf_counter()
    for _ in range(10):
        table = model.predict(pattern, 2.0)
    yield {
        "way": "table, each plan",
        "seconds": (time.perf_counter() - start) / 10,
        "error": abs(table.probability - exact.probability),
        "of": "integrals",
    }
    look = TargetRadiance(*PERSON, *signature)
    for forests in (2, 4, 8):
        start = time.perf_counter()
        sites = sites_of(49, 2.0)
        hits = [
            float(
                (
                    search_layers(layers, sites, ALTITUDE_M, look, seed=SEED, index=i).outputs
                    > exact.threshold
                ).mean()
            )
            for i in range(forests)
        ]
        yield {
            "way": f"search of {forests} forests",
            "seconds": time.perf_counter() - start,
            "error": float(np.std(hits, ddof=1) / forests**0.5),
            "of": "its standard error",
        }


def write(name: str, rows: list[dict[str, object]]) -> None:
    RESULTS.mkdir(exist_ok=True)
    with open(RESULTS / name, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.4g}" if isinstance(v, float) else v for k, v in row.items()})


MARKS = {
    "independent": "o",
    "single slice": "s",
    "crown clutter": "D",
    "measured stand": "^",
    "stand as slices": "x",
    "half of a cloud": "v",
    "same cloud": "P",
}


def figure(rows: list[dict[str, object]]) -> None:
    """Draw simulated detection against predicted detection, with the standard error of the
    simulation.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    drawn, axes = plt.subplots(1, 2, figsize=(9.5, 4.6), sharey=True, layout="constrained")
    for axis, name, title in zip(
        axes,
        ("simulated", "simulated_at_rate"),
        ("at the predicted threshold", "at one false alarm a hectare"),
        strict=True,
    ):
        axis.fill_between([0, 1], [-0.05, 0.95], [0.05, 1.05], color="0.92", label="± 0.05")
        for group, mark in MARKS.items():
            part = [row for row in rows if row["group"] == group]
            if part:
                axis.errorbar(
                    [row["predicted"] for row in part],
                    [row[name] for row in part],
                    [row["standard_error"] for row in part],
                    fmt=mark,
                    markersize=5,
                    label=group,
                )
        axis.set(xlim=(0, 1), ylim=(0, 1), xlabel="predicted probability of detection", title=title)
        axis.set_aspect("equal")
    axes[0].set_ylabel("found in simulated searches")
    axes[1].legend(loc="upper left", fontsize=8)
    drawn.savefig(RESULTS / "detection.png", dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    main()
