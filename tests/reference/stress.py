"""Extreme arguments of every model with exact values, for `benchmarks/numerical_stress.py`.

The arguments include d̂ at breakpoints and at the neighbouring floats, p within 1e-16 of 0 and of
1, N up to 10^12, b from 1e-9 to 1e9 m, and cameras 1 mm above the canopy.  Exact values are
fractions from `reference.exact`, computed from the floats that the models get.  If a power or a
root is not rational, they are numbers of mpmath with 60 digits.
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from typing import NamedTuple

import mpmath
import numpy as np

import aosplan
from aosplan.camera import disparity as geometry
from aosplan.camera.disparity import Slab
from aosplan.grid.patterns import AnyPattern, Pattern, pattern_for
from aosplan.models import equations
from aosplan.models.correlogram import CorrelogramModel
from aosplan.models.layered import LayeredModel
from aosplan.models.measured import MeasuredModel
from aosplan.models.model import Prediction
from aosplan.models.positions import lattice_shortfall, positions_shortfall
from aosplan.models.uniform import UniformModel
from aosplan.planning.solved_plan import MOST_SLICES
from aosplan.scenes.correlogram import correlogram
from aosplan.scenes.occlusion import Occlusion
from aosplan.scenes.scene import Layer
from aosplan.scenes.voxels import VoxelVolume
from reference import exact

ULP = math.ulp(1.0)
BASELINES_M = (1e-9, 1e-3, 0.7, 2.8, 1e3, 1e9)
SIDES = (1, 2, 3, 7, 50, 1000, 10**6)
TRANSPARENCIES = (0.0, 5e-324, 1e-300, 1e-16, 1e-9)
DENSITIES = (0.0, 5e-324, 1e-300, 1e-16, 1e-9, 0.25, 0.5, 0.567, 0.75, 1 - 1e-9, 1 - ULP / 2, 1.0)


class Check(NamedTuple):
    """One value of a model at one set of arguments, and its exact value."""

    model: str
    quantity: str
    corner: str
    value: float
    exact: Fraction

    @property
    def ulps(self) -> float:
        """Error in units in the last place of the exact value."""
        return exact.ulps(self.value, self.exact)


class Worst(NamedTuple):
    """The largest error of one quantity."""

    cases: int
    ulps: float
    relative: float
    corner: str


def worst(checks: Iterable[Check]) -> dict[tuple[str, str], Worst]:
    """The largest error of every quantity of every model."""
    found: dict[tuple[str, str], Worst] = {}
    for check in checks:
        key = check.model, check.quantity
        before = found.get(key, Worst(0, -1.0, 0.0, ""))
        error = check.ulps
        if error > before.ulps:
            off = abs(Fraction(check.value) - check.exact) if math.isfinite(check.value) else None
            relative = (
                math.inf if off is None else float(off / check.exact) if check.exact else float(off)
            )
            found[key] = Worst(before.cases + 1, error, relative, check.corner)
        else:
            found[key] = before._replace(cases=before.cases + 1)
    return found


def every_check() -> Iterator[Check]:
    """All checks of all models."""
    for part in PARTS:
        yield from part()


def of_digits(value: mpmath.mpf) -> Fraction:
    """A number with 60 digits as a fraction."""
    return Fraction(mpmath.nstr(value, 60, min_fixed=1, max_fixed=0))


# --- Equations -------------------------------------------------------------------------------


def eq1() -> Iterator[Check]:
    """Integrated density and transparency for D within 1e-16 of 0 and 1, and l/o from 1e-9 to 1e9."""
    densities = (5e-324, 1e-300, 1e-16, 0.0095, 0.5, 1 - 1e-9, 1 - ULP / 2)
    with mpmath.workdps(80):
        for d, height, size in itertools.product(densities, (1e-9, 1.0, 17.54, 1e9), (0.2, 1.0)):
            ratio = mpmath.mpf(height) / mpmath.mpf(size)
            log_t = ratio * mpmath.log1p(-mpmath.mpf(d))
            if log_t < -745:  # T is below the smallest float
                continue
            corner = f"D = {d!r}, l = {height:g}, o = {size:g}"
            p, t = of_digits(-mpmath.expm1(log_t)), of_digits(mpmath.exp(log_t))
            yield Check(
                "equations", "p (Eq. 1)", corner, equations.integrated_density(d, height, size), p
            )
            yield Check(
                "equations", "T (Eq. 1)", corner, equations.transparency(d, height, size), t
            )


def breakpoints(side: int) -> Iterator[float]:
    """Values of d̂: the smallest d̂ at which a pair shares no occluder, its neighbouring floats,
    and tiny and huge values.
    """
    for neighbours in sorted({1, 2, 3, 7, 49, side - 1, max(side // 2, 1), 999_983} - {0}):
        middle = 1.0 / neighbours
        yield from (math.nextafter(middle, 0.0), middle, math.nextafter(middle, 2.0))
    yield from (0.0, 5e-324, 1e-300, 1e-16, 1e-9, 0.4, 2.0, 1e9, 1e300)


def eq2() -> Iterator[Check]:
    """V, 1 - V, V̂ and 1 - V̂ at every breakpoint, for N from 1 to 10^12."""
    for side in SIDES:
        for dhat in breakpoints(side):
            for rows in {side, 1, 7}:
                k = exact.grid_shortfall(rows, side, dhat)
                corner = f"{rows} x {side}, d̂ = {dhat!r}"
                yield from _of_grid(corner, rows, side, dhat, k)
                for p in DENSITIES if dhat in (0.0, 0.4, 1.0, 1.0 / max(side - 1, 1)) else (0.567,):
                    yield from _with_density(f"p = {p!r}, {corner}", p, None, rows, side, dhat, k)
                for t in TRANSPARENCIES if dhat in (0.4, 1.0) else ():
                    p = 1.0 - t
                    yield from _with_density(f"T = {t!r}, {corner}", p, t, rows, side, dhat, k)


def _of_grid(corner: str, rows: int, columns: int, dhat: float, k: Fraction) -> Iterator[Check]:
    shortfall = aosplan.visibility_shortfall(rows, columns, dhat)
    normalized = aosplan.normalized_visibility(rows, columns, dhat)
    yield Check("equations", "1 - V̂ (Eq. 2)", corner, shortfall, k)
    yield Check("equations", "V̂ (Eq. 2)", corner, normalized, 1 - k)


def _with_density(
    corner: str, p: float, t: float | None, rows: int, columns: int, dhat: float, k: Fraction
) -> Iterator[Check]:
    true_p = Fraction(p) if t is None else 1 - Fraction(t)
    v = exact.visibility(true_p, k)
    got = aosplan.visibility(p, rows, columns, dhat, transparency=t)
    error = aosplan.mean_squared_error(p, rows, columns, dhat, transparency=t)
    yield Check("equations", "V (Eq. 2)", corner, got, v)
    yield Check("equations", "1 - V (Eq. 2)", corner, error, 1 - v)


def eq4_and_5() -> Iterator[Check]:
    """Numbers of samples for a target, which are exact, and apertures of up to 10^12 samples."""
    for k in (1, 2, 3, 5, 10, 50, 999_983, 10**6, 10**9, 10**12):
        text = f"{k - 1}/{k}"
        got = aosplan.required_samples(Fraction(k - 1, k))
        yield Check("equations", "N (Eq. 4)", f"V̂ = {text}", got, Fraction(k))
        if k <= 10**6:
            got = aosplan.required_samples(1.0 - 1.0 / k)
            yield Check("equations", "N (Eq. 4)", f"V̂ = float of {text}", got, Fraction(k))
    with mpmath.workdps(80):
        for n, b in itertools.product((1, 2, 3, 50, 10**6, 10**12 - 1, 10**12), BASELINES_M):
            a = of_digits((mpmath.sqrt(n) - 1) * mpmath.mpf(b)) if n > 1 else Fraction(0)
            yield Check("equations", "a (Eq. 5)", f"N = {n}, b = {b:g}", aosplan.aperture(n, b), a)


def inverses() -> Iterator[Check]:
    """Eq. 1, 3 and 5 solved for D, N and b."""
    with mpmath.workdps(80):
        for p, height, o in itertools.product(DENSITIES[1:-1], (0.2, 17.54, 1e9), (0.2, 1.0)):
            log_t = mpmath.log1p(-mpmath.mpf(p)) * mpmath.mpf(o) / mpmath.mpf(height)
            d = of_digits(-mpmath.expm1(log_t))
            got = equations.slice_density(p, height, o)
            yield Check("equations", "D (Eq. 1)", f"p = {p!r}, l = {height:g}, o = {o:g}", got, d)
        for n, a in itertools.product((2, 3, 50, 10**6, 10**12), BASELINES_M):
            b = of_digits(mpmath.mpf(a) / (mpmath.sqrt(n) - 1))
            got = equations.baseline_for_aperture(a, n)
            yield Check("equations", "b (Eq. 5)", f"N = {n}, a = {a:g}", got, b)
    for p, n in itertools.product((1e-9, 0.25, 0.567, 1 - 1e-9), (2, 3, 50, 10**6)):
        # For a target just below the visibility of n samples, n samples are sufficient. For a
        # target just above it, more are needed.
        v = float(exact.visibility(p, Fraction(1, n)))
        for target in (math.nextafter(v, 0.0), v, math.nextafter(v, 1.0)):
            room = exact.visibility(p, Fraction(0)) - Fraction(target)
            if Fraction(target) <= 1 - Fraction(p) or room <= 0:
                continue
            need = math.ceil(Fraction(p) * (1 - Fraction(p)) / room)
            got = equations.required_samples_for_visibility(target, p)
            corner = f"p = {p!r}, V = {target!r}"
            yield Check("equations", "N (Eq. 3)", corner, float(got or -1), Fraction(need))


# --- The uniform model -----------------------------------------------------------------------


def _prediction(
    model: str, corner: str, got: Prediction, p: Fraction, k: Fraction
) -> Iterator[Check]:
    """Checks of all values that follow from a prediction."""
    v = exact.visibility(p, k)
    yield Check(model, "p", corner, got.density, p)
    yield Check(model, "1 - p", corner, got.transparency, 1 - p)
    yield Check(model, "1 - V̂", corner, got.shortfall, k)
    yield Check(model, "V", corner, got.expected, v)
    yield Check(model, "1 - V", corner, got.mean_squared_error, 1 - v)
    if 0 < p < 1 and k > 0:
        with mpmath.workdps(80):
            ratio = (1 - p) / (p * k)
            root = mpmath.sqrt(mpmath.mpf(ratio.numerator) / ratio.denominator)
            yield Check(model, "contrast", corner, got.contrast, of_digits(root))


def uniform() -> Iterator[Check]:
    """Grids and trimmed grids for b from 1e-9 to 1e9 m.  The exact d̂ is b divided by the unit
    baseline.
    """
    shares = ((0.567, 0.433), (1e-16, 1.0), (1.0, 1e-16))
    patterns: list[AnyPattern] = [Pattern(side, side) for side in SIDES]
    patterns += [Pattern(1, 10**12), Pattern(7, 8)]
    patterns += [pattern_for("trimmed", n) for n in (3, 5, 47, 50, 65)]
    patterns += [pattern_for("lanes", 30), pattern_for("spiral", 40)]
    for unit, pattern, b in itertools.product(
        (2.8, 0.35), patterns, (*BASELINES_M, 2.8, 1.4, 0.35)
    ):
        k = _pattern_shortfall(pattern, Fraction(b) / Fraction(unit))
        text = f"{type(pattern).__name__.lower()} of {pattern.samples}"
        for p, t in shares if pattern.samples < 100 else shares[:1]:
            true_p = 1 - Fraction(t) if p > 0.5 else Fraction(p)
            got = UniformModel(p, t if p > 0.5 else 1.0 - p, unit).predict(pattern, b)
            corner = f"{text}, b = {b:g}, d̂ = 1 at {unit:g}, T = {t:g}"
            yield from _prediction("uniform", corner, got, true_p, k)


def _pattern_shortfall(pattern: AnyPattern, dhat: Fraction) -> Fraction:
    """K of a pattern.  For a whole rectangle, K is the product over both axes; for other patterns,
    it is a sum over pairs.
    """
    if not isinstance(pattern, Pattern):
        return exact.pair_sum(pattern.offsets(), 1 / dhat)
    down = dhat * Fraction(pattern.row_pitch)
    if pattern.removed:
        return exact.lattice_pair_sum(pattern.sites(), dhat, down)
    return exact.line_shortfall(pattern.rows, down) * exact.line_shortfall(pattern.columns, dhat)


def coverage_rule() -> Iterator[Check]:
    """Baselines and disparities for cameras from far above the canopy down to 1 mm above it."""
    focal = 750.0
    for bottom, top, size in ((2.506, 20.04, 0.2), (19.999, 20.0, 0.05), (1e-6, 20.0, 0.2)):
        for above, share in itertools.product((1e-3, 1e-2, 1.0, 20.0, 1e6), (1e-9, 0.5, 0.98, 1.0)):
            h = top + above
            corner = f"h = {h!r} over {bottom:g} to {top:g} m, o = {size:g}, coverage {share:g}"
            slab = Slab(bottom, top, size, 1.0)
            got = geometry.coverage_baseline([slab], h, focal, share)
            height = Fraction(top) - Fraction(share) * (Fraction(top) - Fraction(bottom))
            gap = Fraction(h) - height
            reach = max(Fraction(size), gap / Fraction(focal))
            yield Check("coverage rule", "b", corner, got.baseline_m, reach * Fraction(h) / height)
            px = max(Fraction(focal) * Fraction(size) / (Fraction(h) - Fraction(top)), Fraction(1))
            yield Check(
                "coverage rule", "occluder [px]", corner,
                geometry.occluder_px(size, top, h, focal), px,
            )  # fmt: skip
            for b in BASELINES_M:
                d = Fraction(b) * Fraction(focal) * Fraction(top)
                d /= (Fraction(h) - Fraction(top)) * Fraction(h)
                shift = geometry.disparity_px(b, top, h, focal)
                yield Check("coverage rule", "disparity [px]", f"{corner}, b = {b:g}", shift, d)


def plans() -> Iterator[Check]:
    """Whole plans of the uniform model from 1 mm above the canopy, and with extreme baselines."""
    preset = aosplan.plan(aosplan.PlanRequest(altitude=50)).scene
    (slab,) = preset.slabs()
    depth = Fraction(slab.top_m) - Fraction(slab.bottom_m)
    # This is the height above which 98 % of the occluders are.
    height = Fraction(slab.bottom_m) + (1 - Fraction(0.98)) * depth
    p = 1 - Fraction(preset.transparency)
    fixed: list[dict[str, float]] = [{}, {"baseline": 1e-9}, {"baseline": 1e9}, {"baseline": 0.7}]
    for above, more in itertools.product((1e-3, 30.0), fixed):
        samples = {"samples": 49} if more else {}
        h = slab.top_m + above
        made = aosplan.plan(aosplan.PlanRequest(altitude=h, clearance=0, **more, **samples))
        b, pattern = made.solution.baseline_m, made.solution.pattern
        gap = (Fraction(h) - height) / Fraction(made.camera.focal_length_px)
        unit = max(Fraction(slab.occluder_size_m), gap) * Fraction(h) / height
        corner = f"h = {h!r} over {slab.top_m:g} m, N = {pattern.samples}, b = {b!r}"
        if not more:
            yield Check("uniform plan", "b", corner, b, unit)
        if b < unit and more:  # Below the baseline of the rule, a plan uses slices.
            focal = made.camera.focal_length_px
            k = _shortfall_of_slices(preset, Fraction(h), Fraction(focal), pattern, b)
        else:  # At the baseline of the rule, d̂ is 1.
            k = exact.lattice_pair_sum(pattern.sites(), Fraction(b) / unit if more else Fraction(1))
        yield from _prediction("uniform plan", corner, made.solution.prediction, p, k)


def _shortfall_of_slices(
    scene: aosplan.UniformScene, altitude: Fraction, focal: Fraction, pattern: Pattern, b: float
) -> Fraction:
    """K of a lattice over a uniform volume that is cut into slices of one occluder's thickness."""
    bottom, depth, size = map(
        Fraction, (scene.volume_base_m, scene.volume_height_m, scene.occluder_size_m)
    )
    count = min(math.ceil(depth / size), MOST_SLICES)
    middles = [bottom + (i + Fraction(1, 2)) * depth / count for i in range(count)]
    reaches = [max(size, (altitude - at) / focal) * altitude / at for at in middles]
    with mpmath.workdps(60):
        clear = mpmath.mpf(scene.transparency)
        q = mpmath.root(clear, count)
        total = mpmath.mpf(0)
        for i, j in itertools.product(range(pattern.rows), range(pattern.columns)):
            y, x = i * Fraction(b), j * Fraction(b)
            overlaps = (exact.triangle(y, r) * exact.triangle(x, r) for r in reaches)
            both = mpmath.fprod(
                q * (q + (1 - q) * mpmath.mpf(tau.numerator) / tau.denominator) for tau in overlaps
            )
            pairs = (pattern.rows - i) * (pattern.columns - j) * (1 + (i > 0)) * (1 + (j > 0))
            total += pairs * (both - clear**2)
        return of_digits(total / (pattern.samples**2 * (1 - clear) * clear))


# --- The layered model -----------------------------------------------------------------------

STANDS: dict[str, list[tuple[float, float, float, float]]] = {
    "one slice": [(9.0, 11.0, 0.4, 0.25)],
    "three": [(2.0, 4.0, 0.05, 0.1), (9.0, 11.0, 0.3, 0.25), (19.999, 20.0, 0.2, 0.5)],
    "many, 86 % hidden": [(float(i), i + 1.0, 0.1, 0.1) for i in range(1, 20)],
    "nearly nothing": [(2.0, 4.0, 1e-17, 0.1), (9.0, 11.0, 5e-17, 0.25), (19.0, 20.0, 4e-17, 0.5)],
    "nearly all": [(2.0, 4.0, 0.999, 0.1), (9.0, 11.0, 0.99999, 0.25), (19.0, 20.0, 1 - 1e-8, 0.5)],
    "a wall": [(9.0, 11.0, 1 - ULP / 2, 0.25), (19.0, 20.0, 0.5, 0.5)],
    "a wall of walls": [(float(i), i + 1.0, 1 - 1e-13, 0.1 * i) for i in range(1, 20)],
}


def layered_lattice(
    layers: Sequence[Sequence[float]], altitude: float, pattern: Pattern, baseline: float
) -> tuple[Fraction, Fraction]:
    """p and K of a lattice over slices, from the covariances at its offsets."""
    slices = [
        (
            Fraction(density),
            Fraction(size) * Fraction(altitude) / ((Fraction(bottom) + Fraction(top)) / 2),
        )
        for bottom, top, density, size in layers
    ]
    clear = math.prod((1 - density for density, _ in slices), start=Fraction(1))
    reach = max(reach for _, reach in slices)
    b = Fraction(baseline)
    total = Fraction(0)
    for i in range(min(pattern.rows, math.ceil(reach / b))):
        for j in range(min(pattern.columns, math.ceil(reach / b))):
            both = math.prod(
                (
                    (1 - density)
                    * (
                        (1 - density)
                        + density * exact.triangle(i * b, r) * exact.triangle(j * b, r)
                    )
                    for density, r in slices
                ),
                start=Fraction(1),
            )
            pairs = (pattern.rows - i) * (pattern.columns - j) * (1 + (i > 0)) * (1 + (j > 0))
            total += pairs * (both - clear**2)
    return 1 - clear, total / (pattern.samples**2 * (1 - clear) * clear)


def layered() -> Iterator[Check]:
    """Slices that hide almost nothing or almost everything, seen from 1 mm above them."""
    cases = [(Pattern(1, 1), 1.0), (Pattern(7, 8), 1e-9), (Pattern(7, 8), 1e-3)]
    cases += [(Pattern(5, 6), 0.35), (Pattern(7, 8), 1e9), (Pattern(1, 50), 0.7)]
    for (name, layers), above in itertools.product(STANDS.items(), (1e-3, 30.0)):
        altitude = max(top for _, top, _, _ in layers) + above
        model = LayeredModel([Layer(*layer) for layer in layers], altitude)
        reach = model.independent_baseline_m
        huge = [(Pattern(10**6, 10**6), s * reach) for s in (0.5, 1.0 - ULP / 2, 1.0, 1.0 + ULP)]
        for pattern, b in (*cases, *huge):
            p, k = layered_lattice(layers, altitude, pattern, b)
            corner = f"{name}, h = {altitude:g}, {pattern.rows} x {pattern.columns}, b = {b!r}"
            yield from _prediction("layered", corner, model.predict(pattern, b), p, k)


# --- Any positions ---------------------------------------------------------------------------


def sites() -> Iterator[Check]:
    """Scattered positions and lattices, with spacings from 1e-9 to 1e9 m, and breakpoints of a
    lattice.
    """
    rng = np.random.default_rng(5)
    for spacing, far in itertools.product(BASELINES_M, (0.0, 1e3)):
        points = spacing * (rng.uniform(0.0, 4.0, (40, 2)) + far)
        corner = f"40 positions, Δ = {spacing:g}, {far:g} Δ off the origin"
        k = exact.pair_sum(points.tolist(), spacing)
        yield Check("sites", "1 - V̂, scattered", corner, positions_shortfall(points, spacing), k)
    mask = rng.random((9, 8)) < 0.7
    chosen = [(int(row), int(column)) for row, column in np.argwhere(mask)]
    for neighbours in (1, 2, 3, 7, 8, 100):
        middle = 1.0 / neighbours
        for dhat in (math.nextafter(middle, 0.0), middle, math.nextafter(middle, 2.0)):
            k = exact.lattice_pair_sum(chosen, dhat)
            yield Check(
                "sites", "1 - V̂, lattice", f"d̂ = {dhat!r}", lattice_shortfall(mask, dhat), k
            )


# --- The measured model and its correlogram --------------------------------------------------


def sparse_volume(*, inverted: bool = False) -> VoxelVolume:
    """A plot of 24 x 24 cells in which one voxel is filled, or all voxels of a slice except one."""
    occupied = np.zeros((8, 24, 24), dtype=bool)
    if inverted:
        occupied[5] = True
    occupied[5, 7, 11] = not inverted
    return VoxelVolume(occupied, 0.25)


def counted(masks: np.ndarray) -> tuple[Fraction, Fraction]:
    """p̄ and K of views, computed exactly from the number of views that hide each target.  `masks`
    has one row for each view.
    """
    views, targets = masks.shape
    p = Fraction(int(masks.sum()), views * targets)
    squares = sum(n**2 * int(count) for n, count in enumerate(np.bincount(masks.sum(axis=0))))
    error = Fraction(squares, views**2 * targets)
    if p in (0, 1):
        return p, Fraction(1, views)
    return p, (error - p**2) / (p * (1 - p))


def measured() -> Iterator[Check]:
    """Plots in which one voxel is filled, or all voxels of a slice except one, from 1 mm to 1 km
    above them.
    """
    volumes = {"one voxel": sparse_volume(), "all but one": sparse_volume(inverted=True)}
    patterns = (Pattern(1, 1), Pattern(5, 5), pattern_for("trimmed", 50))
    for (name, volume), above, view in itertools.product(
        volumes.items(), (1e-3, 30.0, 1e3), ("telecentric", "perspective")
    ):
        altitude = volume.canopy_top_m + above
        model = MeasuredModel(volume, altitude, view=view)
        occlusion = Occlusion(volume, altitude, view=view)
        for pattern, b in itertools.product(patterns, (1e-9, 0.7, 1e3)):
            positions = list(pattern_positions(pattern, b))
            hidden = occlusion.unpack(occlusion.masks(positions)).reshape(len(positions), -1)
            p, k = counted(hidden)
            got = model.predict_positions(positions)
            corner = f"{name}, {view}, h = {altitude:g}, N = {pattern.samples}, b = {b:g}"
            yield from _prediction("measured", corner, got, p, k)


def pattern_positions(pattern: Pattern, baseline: float) -> Iterator[tuple[float, float]]:
    """Sites of a pattern relative to its centre."""
    for row, column in pattern.sites():
        yield (
            (row - 0.5 * (pattern.rows - 1)) * baseline * pattern.row_pitch,
            (column - 0.5 * (pattern.columns - 1)) * baseline,
        )


def correlation() -> Iterator[Check]:
    """A correlogram with known values: one view, views at one position, no canopy, full canopy."""
    volumes = {
        "one voxel": sparse_volume(),
        "bare": VoxelVolume(np.zeros((3, 8, 8), dtype=bool), 1.0),
        "full": VoxelVolume(np.ones((3, 8, 8), dtype=bool), 1.0),
    }
    share = {"one voxel": Fraction(1, 576), "bare": Fraction(0), "full": Fraction(1)}
    for (name, volume), above in itertools.product(volumes.items(), (1e-3, 30.0)):
        altitude = max(volume.canopy_top_m, 1.0) + above
        model = CorrelogramModel(correlogram(volume), altitude)
        for n in (1, 5):
            got = model.predict_positions(np.zeros((n, 2)))
            corner = f"{name}, h = {altitude:g}, {n} views on one spot"
            yield Check("correlogram", "p", corner, got.density, share[name])
            yield Check("correlogram", "1 - p", corner, got.transparency, 1 - share[name])
            yield Check("correlogram", "1 - V̂", corner, got.shortfall, Fraction(1))


PARTS = (
    eq1, eq2, eq4_and_5, inverses, uniform, coverage_rule, plans, layered, sites, measured,
    correlation,
)  # fmt: skip
