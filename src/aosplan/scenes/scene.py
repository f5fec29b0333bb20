"""Scenes: the occluders between the camera and the ground.

A scene is either one volume with occluders of one kind (`UniformScene`, the model of the paper) or
a stack of slices, each with its own height, density and occluder size (`LayeredScene`, for example
from LiDAR). Heights are above the ground. `above` returns the part of a scene above a raised focal
plane. Both classes give the integrated density, the canopy top, and the slabs of occluders for the
coverage rule (`aosplan.camera.disparity`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

from aosplan.camera.disparity import Slab
from aosplan.errors import RequestError
from aosplan.scenes.density import density_of_part, integrated_density, transparency

SMALLEST_M, LARGEST_M = 1e-9, 1e9
"""Bounds of all lengths of a scene. Within these bounds, products of several lengths neither
overflow nor become 0.
"""

MOST_SLICES = 100_000
"""Largest number of slices into which a uniform volume may be cut."""


class Layer(NamedTuple):
    """One slice of a layered scene.

    `density` is the share of the slice's horizontal area that blocks a vertical ray.
    """

    bottom_m: float
    top_m: float
    density: float
    occluder_size_m: float

    @property
    def height_m(self) -> float:
        """Height of the middle of the slice.  The models place the occluders of the slice there."""
        return 0.5 * (self.bottom_m + self.top_m)


@dataclass(frozen=True)
class UniformScene:
    """One volume of cubic occluders of one size (Kurmi et al. 2019, section II).

    Parameters
    ----------
    name
        Name of the scene in the output.
    density
        D, share of each slice that is filled with occluders, 0 to 1; None if
        `given_integrated_density` is given.
    occluder_size_m
        o, edge length of an occluder.
    volume_base_m, volume_height_m
        Height of the bottom of the volume above the ground, and thickness l of the volume.
    given_integrated_density
        p, share of the ground that one photo does not see; None if `density` is given.

    Raises
    ------
    RequestError
        If a number is outside its domain, or if not exactly one of the two densities is given.
    """

    name: str
    density: float | None
    occluder_size_m: float
    volume_base_m: float
    volume_height_m: float
    given_integrated_density: float | None = None
    title: str = ""
    source: str = ""
    assumed: str = ""

    def __post_init__(self) -> None:
        where = f"scene '{self.name}'"
        if (self.density is None) == (self.given_integrated_density is None):
            raise RequestError(f"{where} needs exactly one of density and integrated_density")
        if self.density is not None:
            _check_share(self.density, "density", where)
        if self.given_integrated_density is not None:
            _check_share(self.given_integrated_density, "integrated_density", where)
        _check_positive(self.occluder_size_m, "occluder_size_m", where)
        _check_positive(self.volume_height_m, "volume_height_m", where)
        _check_at_least_zero(self.volume_base_m, "volume_base_m", where)

    kind = "uniform"

    @property
    def canopy_top_m(self) -> float:
        """Height of the top of the volume above the ground."""
        return self.volume_base_m + self.volume_height_m

    @property
    def integrated_density(self) -> float:
        """Share p of the ground that a single nadir photo does not see (Eq. 1)."""
        if self.given_integrated_density is not None:
            return self.given_integrated_density
        assert self.density is not None
        return float(integrated_density(self.density, self.volume_height_m, self.occluder_size_m))

    @property
    def transparency(self) -> float:
        """Share T = 1 - p of the ground that a photo sees.  It is accurate even if p is close to
        1.
        """
        if self.given_integrated_density is not None:
            return 1.0 - self.given_integrated_density
        assert self.density is not None
        return float(transparency(self.density, self.volume_height_m, self.occluder_size_m))

    def slabs(self) -> tuple[Slab, ...]:
        """The volume as one slab."""
        return (Slab(self.volume_base_m, self.canopy_top_m, self.occluder_size_m, 1.0),)

    def slices(self, most: int | None = None) -> tuple[Layer, ...]:
        """The volume as slices that are one occluder thick (Eq. 1).

        There are l/o slices, rounded up, but at most `most`. All slices have the same density. It
        is chosen so that the transparency of the volume does not change.
        """
        count = max(1, math.ceil(self.volume_height_m / self.occluder_size_m - 1e-9))
        if most is not None:
            count = min(count, most)
        if count > MOST_SLICES:
            raise RequestError(
                f"scene '{self.name}' would be divided into {count} slices as thick as its "
                f"occluders, more than {MOST_SLICES}",
                "give a larger --occluder-size, or --model uniform",
            )
        thickness = self.volume_height_m / count
        density = (
            1.0 if self.transparency == 0.0 else -math.expm1(math.log(self.transparency) / count)
        )
        bounds = [self.volume_base_m + i * thickness for i in range(count + 1)]
        return tuple(
            Layer(low, high, density, self.occluder_size_m) for low, high in pairwise(bounds)
        )

    def above(self, height_m: float) -> UniformScene | None:
        """The part of the scene above a height, with heights relative to this height; None if there
        are no occluders above it.
        """
        if height_m == 0.0:
            return self
        if height_m >= self.canopy_top_m:
            return None
        base = max(self.volume_base_m, height_m)
        thickness = self.canopy_top_m - base
        given = self.given_integrated_density
        if given is not None:
            given = density_of_part(given, thickness, self.volume_height_m)
        return replace(
            self,
            volume_base_m=base - height_m,
            volume_height_m=thickness,
            given_integrated_density=given,
        )


@dataclass(frozen=True)
class LayeredScene:
    """A stack of slices, each with its own density and occluder size.

    Parameters
    ----------
    layers
        The slices, from bottom to top, without overlap.
    measured_density
        Measured p, which is the column occupancy of a point cloud. It is needed because the slices
        of a stand are not independent. If it is None, p is computed from the slices.
    voxel_m
        Voxel size of the point cloud from which the layers were computed.  The coverage rule uses
        it as occluder size.  If it is None, the rule uses the occluder size of each layer.
    """

    name: str
    layers: tuple[Layer, ...]
    measured_density: float | None = None
    voxel_m: float | None = None
    title: str = ""
    source: str = ""
    assumed: str = ""

    def __post_init__(self) -> None:
        where = f"scene '{self.name}'"
        if not self.layers:
            raise RequestError(f"{where} has no layers")
        previous_top = 0.0
        for index, layer in enumerate(self.layers):
            place = f"{where}, layer {index}"
            _check_at_least_zero(layer.bottom_m, "bottom_m", place)
            _check_positive(layer.top_m, "top_m", place)
            _check_share(layer.density, "density", place)
            _check_positive(layer.occluder_size_m, "occluder_size_m", place)
            if layer.top_m <= layer.bottom_m:
                raise RequestError(
                    f"{place}: top_m {layer.top_m:g} is not above bottom_m {layer.bottom_m:g}"
                )
            if layer.bottom_m < previous_top - 1e-9 * previous_top:
                raise RequestError(
                    f"{place}: bottom_m {layer.bottom_m:g} is below the top of the layer before "
                    f"it, {previous_top:g}",
                    "list the layers from the lowest to the highest, without overlap",
                )
            previous_top = layer.top_m
        if self.measured_density is not None:
            _check_share(self.measured_density, "integrated_density", where)
            if self.measured_density > 0.0 and not any(layer.density for layer in self.layers):
                raise RequestError(
                    f"{where}: integrated_density {self.measured_density:g}, but every layer is empty"
                )
        if self.voxel_m is not None:
            _check_positive(self.voxel_m, "voxel_m", where)

    kind = "layered"

    @property
    def canopy_top_m(self) -> float:
        """Height of the top of the highest layer that is not empty, above the ground; 0 for bare
        ground.
        """
        return max((layer.top_m for layer in self.layers if layer.density > 0.0), default=0.0)

    @property
    def log_transparency(self) -> float:
        """Logarithm of the transparency of independent slices; -inf if a slice is solid."""
        if any(layer.density >= 1.0 for layer in self.layers):
            return -math.inf
        return math.fsum(math.log1p(-layer.density) for layer in self.layers)

    @property
    def integrated_density(self) -> float:
        """Share p of the ground that a single nadir photo does not see."""
        if self.measured_density is not None:
            return self.measured_density
        return 0.0 - math.expm1(self.log_transparency)

    @property
    def transparency(self) -> float:
        """Share T = 1 - p of the ground that a single nadir photo sees."""
        if self.measured_density is not None:
            return 1.0 - self.measured_density
        return math.exp(self.log_transparency)

    def slabs(self) -> tuple[Slab, ...]:
        """The layers at their middle heights, weighted by density times thickness."""
        return tuple(
            Slab(
                layer.height_m,
                layer.height_m,
                layer.occluder_size_m if self.voxel_m is None else self.voxel_m,
                layer.density * (layer.top_m - layer.bottom_m),
            )
            for layer in self.layers
            if layer.density > 0.0
        )

    def slices(self) -> tuple[Layer, ...]:
        """The layers that are not empty."""
        return tuple(layer for layer in self.layers if layer.density > 0.0)

    def above(self, height_m: float) -> LayeredScene | None:
        """The part of the scene above a height, with heights relative to this height; None if there
        are no occluders above it.

        If the height is inside a layer, the density of the upper part of the layer is computed by
        the law of Beer and Lambert.
        """
        if height_m == 0.0:
            return self
        kept = tuple(_cut(layer, height_m) for layer in self.layers if layer.top_m > height_m)
        if not kept:
            return None
        return replace(self, layers=kept).with_density_of(self)

    def with_density_of(self, other: LayeredScene) -> LayeredScene:
        """These layers, with a measured density that is taken from other layers of the same stand.

        The optical depth -ln(1 - p) of the measured density of the other layers is multiplied by a
        factor. This factor is the optical depth of these layers divided by the optical depth of the
        other layers, both computed with independent slices.
        """
        measured, whole = other.measured_density, other.log_transparency
        if measured is not None and 0.0 < measured < 1.0 and whole < 0.0 and math.isfinite(whole):
            measured = -math.expm1(math.log1p(-measured) * (self.log_transparency / whole))
        return replace(self, measured_density=measured)


Scene = UniformScene | LayeredScene


def scene_document(scene: Scene) -> dict[str, Any]:
    """Name, kind, source and main numbers of a scene."""
    return {
        "name": scene.name,
        "kind": scene.kind,
        "title": scene.title,
        "source": scene.source,
        "assumed": scene.assumed,
        "integrated_density": scene.integrated_density,
        "canopy_top_m": scene.canopy_top_m,
    }


def _cut(layer: Layer, height_m: float) -> Layer:
    bottom = max(layer.bottom_m, height_m)
    density = layer.density
    if bottom > layer.bottom_m and density < 1.0:
        share = (layer.top_m - bottom) / (layer.top_m - layer.bottom_m)
        density = -math.expm1(math.log1p(-density) * share)
    return Layer(bottom - height_m, layer.top_m - height_m, density, layer.occluder_size_m)


def _check_share(value: float, name: str, where: str) -> None:
    if not 0.0 <= value <= 1.0:
        hint = f"{value:g} % is {value / 100:g}" if 1.0 < value <= 100.0 else ""
        raise RequestError(f"{where}: {name} {value:g} is not between 0 and 1", hint)


def _check_positive(value: float, name: str, where: str) -> None:
    if not SMALLEST_M <= value <= LARGEST_M:
        raise RequestError(
            f"{where}: {name} {value:g} is not a number between {SMALLEST_M:g} and {LARGEST_M:g}"
        )


def _check_at_least_zero(value: float, name: str, where: str) -> None:
    if not 0.0 <= value <= LARGEST_M:
        raise RequestError(f"{where}: {name} {value:g} is not between 0 and {LARGEST_M:g}")
