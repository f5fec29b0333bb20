"""The request: everything that decides a plan, and nothing about where it is written.

`PlanRequest` has the options of ``aosplan plan`` (`aosplan.options`) as fields, with underscores
for hyphens.  Fields left None take a default, or are not used.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from aosplan import quantities as q
from aosplan.errors import RequestError
from aosplan.options import BY_NAME, OPTIONS

if TYPE_CHECKING:
    from collections.abc import Mapping

ALTERNATIVES = (
    (("altitude",), ("gsd",), ("target_size", "target_pixels")),
    (("vhat",), ("visibility",)),
    (
        ("scene", "voxel", "ground", "min_height"),
        ("density", "volume_height", "volume_base"),
        ("integrated_density", "volume_height", "volume_base"),
    ),
    (
        ("camera",),
        ("focal_length", "sensor_width", "sensor_height", "image_width", "image_height"),
        ("fov", "image_width", "image_height"),
    ),
)
"""Ways to say the same thing: options of different ways contradict each other."""


@dataclass(frozen=True)
class PlanRequest:
    """What ``aosplan plan`` takes, checked; fields are its options with underscores.

    Lengths are metres, angles degrees, times seconds, focal length and sensor millimetres.
    Text is read as on the command line (``vhat="98%"``).

    Raises
    ------
    RequestError
        Where a value is outside its domain, or options contradict each other.

    Examples
    --------
    >>> PlanRequest(altitude=40, vhat="98%").vhat
    0.98
    """

    altitude: float | None = None
    gsd: float | None = None
    target_size: float | None = None
    target_pixels: float | None = None
    focal_height: float = 0.0
    vhat: float | str | None = None
    visibility: float | str | None = None
    scene: str | None = None
    density: float | None = None
    integrated_density: float | None = None
    occluder_size: float | None = None
    volume_height: float | None = None
    volume_base: float | None = None
    voxel: float | None = None
    ground: str | None = None
    min_height: float | None = None
    camera: str | None = None
    focal_length: float | None = None
    sensor_width: float | None = None
    sensor_height: float | None = None
    fov: float | None = None
    image_width: int | None = None
    image_height: int | None = None
    coverage: float = 0.98
    model: str | None = None
    view: str | None = None
    optimize: str = "samples"
    max_aperture: float | None = None
    max_samples: int | None = None
    baseline: float | None = None
    samples: int | None = None
    grid: str = "trimmed"
    lanes: int | None = None
    lane_pitch: float | None = None
    origin: tuple[float, float] | None = None
    heading: float = 0.0
    speed: float = 5.0
    acceleration: float = 2.0
    hold: float = 1.0
    autopilot: str | None = None
    payload: str | None = None

    def __post_init__(self) -> None:
        for option in OPTIONS:
            value = getattr(self, option.name)
            if value is not None:
                object.__setattr__(self, option.name, option.parse(value, option.name))
        for alternatives in ALTERNATIVES:
            self._check_alternatives(alternatives)
        if self.vhat is None and self.visibility is None:
            object.__setattr__(self, "vhat", 0.98)
        self._check_altitude()
        self._check_scene()
        self._check_camera()
        self._check_bounds()

    def document(self) -> dict[str, Any]:
        """The request as plain values, without what is not used: enough to run it again."""
        values = ((field.name, getattr(self, field.name)) for field in fields(self))
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in values
            if value is not None
        }

    def _given(self, names: tuple[str, ...]) -> list[str]:
        return [BY_NAME[name].flag for name in names if getattr(self, name) is not None]

    def _check_alternatives(self, alternatives: tuple[tuple[str, ...], ...]) -> None:
        leading = [names[0] for names in alternatives if getattr(self, names[0]) is not None]
        if len(leading) > 1:
            flags = " and ".join(BY_NAME[name].flag for name in leading)
            raise RequestError(f"{flags} say the same thing twice", "keep one of them")
        for names in alternatives:
            if leading and names[0] == leading[0]:
                foreign = {name for others in alternatives for name in others} - set(names)
                strange = self._given(tuple(sorted(foreign)))
                if strange:
                    raise RequestError(
                        f"{BY_NAME[leading[0]].flag} and {' and '.join(strange)} contradict each other",
                        "keep one of them",
                    )

    def _check_altitude(self) -> None:
        if self.target_pixels is not None and self.target_size is None:
            raise RequestError("--target-pixels needs --target-size")
        if self.target_size is not None and self.target_pixels is None:
            raise RequestError("--target-size needs --target-pixels")
        if self.altitude is None and self.gsd is None and self.target_size is None:
            raise RequestError(
                "no altitude is given",
                "give --altitude M, or --gsd M, or --target-size M with --target-pixels K",
            )

    def _check_scene(self) -> None:
        uniform = self.density is not None or self.integrated_density is not None
        if uniform:
            for name in ("occluder_size", "volume_height"):
                if getattr(self, name) is None:
                    raise RequestError(
                        f"a uniform scene needs {BY_NAME[name].flag}",
                        "give --density D --occluder-size M --volume-height M, or --scene NAME",
                    )
            if self.volume_base is None:
                object.__setattr__(self, "volume_base", 2.0)
        else:
            lonely = self._given(("volume_height", "volume_base"))
            if lonely:
                raise RequestError(
                    f"{' and '.join(lonely)} without a density",
                    "give --density D or --integrated-density P as well, or a --scene alone",
                )
            if self.scene is None:
                object.__setattr__(self, "scene", "paper-forest")

    def _check_camera(self) -> None:
        needed: tuple[str, ...]
        if self.focal_length is not None:
            needed = ("sensor_width", "image_width", "image_height")
        elif self.fov is not None:
            needed = ("image_width", "image_height")
            if self.fov >= 180.0:
                raise RequestError(f"--fov {self.fov:g} is not below 180 degrees")
        else:
            lonely = self._given(("sensor_width", "sensor_height", "image_width", "image_height"))
            if lonely:
                raise RequestError(
                    f"{' and '.join(lonely)} without --focal-length or --fov",
                    "give --focal-length MM or --fov DEG as well, or a --camera",
                )
            if self.camera is None:
                object.__setattr__(self, "camera", "dji-m3t-thermal")
            return
        for name in needed:
            if getattr(self, name) is None:
                raise RequestError(
                    f"a camera on the command line needs {BY_NAME[name].flag}",
                    "--fov or --focal-length, --sensor-width; --image-width and --image-height",
                )

    def _check_bounds(self) -> None:
        if self.samples and self.max_samples and self.samples > self.max_samples:
            raise RequestError(
                f"--samples {self.samples} is more than --max-samples {self.max_samples}"
            )
        if self.grid == "lanes":
            object.__setattr__(self, "lanes", self.lanes or 3)
            object.__setattr__(self, "lane_pitch", self.lane_pitch or 4.0)
            assert self.lane_pitch is not None
            if self.lane_pitch < 1.0:
                raise RequestError(f"--lane-pitch {self.lane_pitch:g} is below 1")
        else:
            strange = self._given(("lanes", "lane_pitch"))
            if strange:
                raise RequestError(
                    f"{' and '.join(strange)} with --grid {self.grid}", "they go with --grid lanes"
                )


def request_from(
    values: Mapping[str, Any], *, overrides: Mapping[str, Any] | None = None, where: str = ""
) -> PlanRequest:
    """A request from a file's values and the flags that override them.

    A flag drops what it contradicts: ``--visibility`` a file's ``vhat``, ``--gsd`` its
    ``altitude``.

    Parameters
    ----------
    values
        Options by name.
    overrides
        Flags by name; None counts as not given.
    where
        The file, for messages.

    Raises
    ------
    RequestError
        Where a name is unknown or a value wrong; the message names the place.
    """
    flags = {name: value for name, value in (overrides or {}).items() if value is not None}
    kept = {name: value for name, value in values.items() if value is not None}
    for alternatives in ALTERNATIVES:
        for names in alternatives:
            if names[0] in flags:
                foreign = {name for others in alternatives for name in others} - set(names)
                if names[0] == "scene" and "scene" not in kept:
                    foreign.add("occluder_size")  # it belonged to the uniform scene of the file
                kept = {name: value for name, value in kept.items() if name not in foreign}
    if flags.get("grid") not in (None, "lanes"):
        kept = {name: value for name, value in kept.items() if not name.startswith("lane")}
    place = f" in {where}" if where else ""
    parsed = {name: _parsed(name, value, f"{name}{place}") for name, value in kept.items()}
    parsed |= {name: _parsed(name, value, BY_NAME[name].flag) for name, value in flags.items()}
    return PlanRequest(**parsed)


def _parsed(name: str, value: Any, label: str) -> Any:
    if name not in BY_NAME:
        raise RequestError(f"unknown option {label}", q.nearest_hint(name, BY_NAME))
    return BY_NAME[name].parse(value, label)
