"""Map of the waypoints of a plan, to scale and in flight order, with area, zones and footprints."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.numerics import heading_axis, turned
from aosplan.show.figures.style import entitle, legend_below
from aosplan.units import length

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import PathPatch

    from aosplan.areas.area import Area
    from aosplan.planning.result import Plan
    from aosplan.show.figures.style import Theme

    Ring = tuple[tuple[float, float], ...]
    Polygon = tuple[Ring, ...]

NUMBERED_MM = 4.6
"""Smallest spacing on paper for which each waypoint is numbered."""

DOTTED_MM = 1.6
"""Smallest spacing on paper for which each waypoint has a dot."""

MOST_NUMBERS = 20
"""Approximate number of waypoints that are numbered, if they are too close together for all to be
numbered.
"""

MOST_NUMBERED = 400
"""Largest number of waypoints that are numbered.  If there are more waypoints, only the ends of
flights are numbered.
"""

NARROWEST = 0.6
"""Smallest ratio of the shorter to the longer side of the map."""

STEPS = (1, 2, 5)


class GridFigure(NamedTuple):
    """Waypoints and shapes, in metres east and north of the origin.

    A polygon is a tuple of rings. Its outer ring is the first. `footprint` is the footprint of a
    photo at the centre of the grid, or of the first photo over an area. `common` is the ground that
    all photos show.
    """

    scene: str
    samples: int
    heading_deg: float
    length_m: float
    east_m: Sequence[float]
    north_m: Sequence[float]
    photo: Sequence[bool] | None
    flights: tuple[tuple[int, int], ...]
    takeoff: tuple[float, float] | None
    footprint_m: tuple[float, float]
    footprint: Ring
    common_m: tuple[float, float] | None
    common: Ring | None
    area: tuple[Polygon, ...] = ()
    clear: tuple[Polygon, ...] = ()
    no_fly: tuple[Polygon, ...] = ()
    area_m2: float | None = None

    @property
    def photos(self) -> int:
        """Number of waypoints at which a photo is taken."""
        return len(self.east_m) if self.photo is None else sum(self.photo)

    @property
    def title(self) -> str:
        """Title of the figure, in one line."""
        over = "" if self.area_m2 is None else f" over {self.area_m2 / 1e4:.3g} ha"
        return f"{self.photos} photo{'s' if self.photos > 1 else ''}{over} for {self.scene}"

    @property
    def extent_m(self) -> tuple[float, float]:
        """Extent of the waypoints east and north."""
        return max(self.east_m) - min(self.east_m), max(self.north_m) - min(self.north_m)

    def description(self) -> str:
        """Description of the path and the shapes as text."""
        first, last = ((self.east_m[k], self.north_m[k]) for k in (0, -1))
        text = (
            f"{self.title}: a path of {self.length_m:.4g} m in {len(self.flights)} "
            f"flight{'s' if len(self.flights) > 1 else ''}, heading {self.heading_deg:g}°, within "
            f"{self.extent_m[0]:.3g} m from west to east and {self.extent_m[1]:.3g} m from south to "
            f"north, from {_place(first)} to {_place(last)} of the origin. A photo shows "
            f"{self.footprint_m[0]:.3g} x {self.footprint_m[1]:.3g} m, along and across the heading"
        )
        if self.common_m is not None:
            text += f"; all photos show {self.common_m[0]:.3g} x {self.common_m[1]:.3g} m"
        elif not self.area:
            text += "; no ground is in all photos"
        if self.takeoff is not None:
            text += f"; the take-off lies {_place(self.takeoff)}"
        for name, parts in (("clear part", self.clear), ("no-fly zone", self.no_fly)):
            if parts:
                text += f"; {len(parts)} {name}{'s' if len(parts) > 1 else ''}"
        return f"{text}."

    def document(self) -> dict[str, Any]:
        """The numbers as plain values.  The waypoints are left out, because they are in the
        document of the plan.
        """
        own = self._asdict()
        for name in ("east_m", "north_m", "photo", "area", "clear", "no_fly"):
            del own[name]
        return own


def _place(point: tuple[float, float]) -> str:
    east, north = point
    return (
        f"{abs(east):.3g} m {'east' if east >= 0.0 else 'west'} and {abs(north):.3g} m "
        f"{'north' if north >= 0.0 else 'south'}"
    )


def grid_of(plan: Plan, area: Area | None = None) -> GridFigure:
    """The waypoints of a plan, and the shapes of its area.

    Parameters
    ----------
    plan
        The plan.
    area
        The area of the plan, if it has one (`aosplan.planning.sites.over_area`).
    """
    ways, route = plan.waypoints, plan.route
    photos = len(ways) if ways.photo is None else sum(ways.photo)
    footprint, common = plan.camera.footprint_m(plan.altitude_m), None
    middle = (0.0, 0.0)
    if area is not None:
        middle = (ways.east_m[0], ways.north_m[0])
    elif min(plan.common_footprint_m) > 0.0 and photos == plan.solution.pattern.samples:
        common = plan.common_footprint_m
    takeoff = None
    if route.takeoff is not None and plan.origin is not None:
        from aosplan.geodesy import to_local

        (east,), (north,) = to_local(plan.origin, [route.takeoff[0]], [route.takeoff[1]])
        takeoff = (float(east), float(north))
    return GridFigure(
        scene=plan.scene.title or plan.scene.name,
        samples=plan.solution.pattern.samples,
        heading_deg=plan.heading_deg % 360.0,
        length_m=route.length_m,
        east_m=ways.east_m,
        north_m=ways.north_m,
        photo=ways.photo,
        flights=tuple((flight.first, flight.last) for flight in route.flights),
        takeoff=takeoff,
        footprint_m=footprint,
        footprint=_rectangle(footprint, plan.heading_deg, middle),
        common_m=common,
        common=None if common is None else _rectangle(common, plan.heading_deg, middle),
        area=() if area is None else _polygons(area.whole),
        clear=() if area is None else _polygons(area.clear),
        no_fly=() if area is None else _polygons(area.keep_out),
        area_m2=None if area is None else float(area.whole.area),
    )


def _rectangle(
    size_m: tuple[float, float], heading_deg: float, middle: tuple[float, float]
) -> Ring:
    """Corners of a rectangle.  The first number of its size is along the heading."""
    axis = heading_axis(heading_deg)
    corners = [turned(0.5 * sx * size_m[0], 0.5 * sy * size_m[1], axis) for sx, sy in CORNERS]
    return tuple((middle[0] + east, middle[1] + north) for east, north in corners)


CORNERS = ((1, 1), (1, -1), (-1, -1), (-1, 1), (1, 1))


def _polygons(shape: Any) -> tuple[Polygon, ...]:
    import shapely

    return tuple(
        tuple(
            tuple(map(tuple, shapely.get_coordinates(ring).tolist()))
            for ring in (part.exterior, *part.interiors)
        )
        for part in shapely.get_parts(shape)
        if part.geom_type == "Polygon" and not part.is_empty
    )


def nice_length_m(span_m: float) -> float:
    """A length that is 1, 2 or 5 times a power of ten and is about a fifth of a span."""
    power = 10.0 ** math.floor(math.log10(0.25 * span_m))
    return max(step * power for step in STEPS if step * power <= 0.25 * span_m)


def numbered(flights: Sequence[tuple[int, int]], spacing_mm: float) -> list[int]:
    """Indices of the waypoints that are numbered, for a given spacing on paper.

    All waypoints are numbered, or every n-th one.  If there are very many, only the first waypoint
    of each flight and the last waypoint are numbered.
    """
    count = flights[-1][1] + 1
    ends = {*(first for first, _ in flights), count - 1}
    if spacing_mm >= NUMBERED_MM:
        return list(range(count))
    if count > MOST_NUMBERED:
        return sorted(ends if len(ends) <= MOST_NUMBERS else {0, count - 1})
    steps = (step * 10**power for power in range(4) for step in STEPS)
    apart = (step for step in steps if step * spacing_mm >= NUMBERED_MM)
    step = next((step for step in apart if count / step <= MOST_NUMBERS), count)
    return sorted({0, *range(0, count - step // 2, step), count - 1})


def draw(figure: Figure, shown: GridFigure, theme: Theme) -> None:
    """Draw the map with north up and metres along both axes."""
    legend_below(figure, draw_panel(figure.subplots(), shown, theme))
    entitle(figure, shown.title)


def draw_panel(panel: Axes, shown: GridFigure, theme: Theme) -> list[Any]:
    """Draw the map on one panel.  Returns the handles of its legend."""
    panel.set_aspect("equal")
    shapes = _shapes(shown, theme)
    for polygons, look in shapes.values():
        for polygon in polygons:
            panel.add_patch(_patch(polygon, **look))
    low, high = window(shown)
    span = max(high[0] - low[0], high[1] - low[1])
    panel.set_xlim(low[0], high[0])
    panel.set_ylim(low[1] - 0.1 * span, high[1])
    # The size of a subfigure can only be read from its bounding box.
    width, height = panel.figure.bbox.width, panel.figure.bbox.height
    shorter_in = float(min(width, height)) / panel.figure.dpi
    # Axes beside other panels are smaller than the figure. Their size is estimated by this factor,
    # because the layout is not final yet.
    share = min(panel.get_position().width, panel.get_position().height) / 0.77
    paper_mm = 25.4 * 0.86 * min(share, 1.0) * shorter_in / span
    _ways(panel, shown, theme, paper_mm * _spacing_m(shown))
    if shown.takeoff is not None:
        panel.plot(*shown.takeoff, **HOME, mfc=theme.data[3], mec=theme.background)
    _scale_bar(panel, nice_length_m(span), (low[0], low[1] - 0.06 * span), theme)
    panel.annotate(
        "N",
        xy=(0.965, 0.105),
        xytext=(0.965, 0.02),
        xycoords="axes fraction",
        ha="center",
        va="center",
        size=10,
        arrowprops={"arrowstyle": "-|>", "color": theme.text, "lw": 1.4},
    )
    panel.set(xlabel="east of the origin [m]", ylabel="north of the origin [m]")
    panel.grid(visible=False)
    return _legend(shown, theme, shapes)


HOME: dict[str, Any] = {"ls": "", "marker": "P", "ms": 9, "zorder": 6}


def _shapes(
    shown: GridFigure, theme: Theme
) -> dict[str, tuple[tuple[Polygon, ...], dict[str, Any]]]:
    """Shapes that are drawn below the waypoints, each with its name and appearance."""
    common = () if shown.common is None else ((shown.common,),)
    shapes: dict[str, tuple[tuple[Polygon, ...], dict[str, Any]]] = {
        "area": (shown.area, {"fc": theme.shade, "ec": theme.text, "lw": 1.2}),
        "clear part": (shown.clear, {"fc": "none", "ec": theme.muted, "hatch": "...", "lw": 0.8}),
        "no-fly zone": (
            shown.no_fly,
            {"fc": "none", "ec": theme.data[1], "hatch": "xxx", "lw": 1.2},
        ),
        "in all photos": (common, {"fc": theme.shade, "ec": theme.data[2], "lw": 1.2}),
        "footprint of a photo": (
            ((shown.footprint,),),
            {"fc": "none", "ec": theme.muted, "ls": "--", "lw": 1.1},
        ),
    }
    return {name: shape for name, shape in shapes.items() if shape[0]}


def _ways(panel: Axes, shown: GridFigure, theme: Theme, spacing_mm: float) -> None:
    """Draw the path of each flight, and its waypoints if there is enough space."""
    from matplotlib.patheffects import withStroke

    halo = [withStroke(linewidth=2.0, foreground=theme.background)]
    each = spacing_mm >= NUMBERED_MM
    for flight, (first, last) in enumerate(shown.flights):
        places, colour = slice(first, last + 1), flight_colour(theme, flight)
        panel.plot(
            shown.east_m[places],
            shown.north_m[places],
            "-",
            color=colour,
            lw=0.9 if spacing_mm > DOTTED_MM else 0.5,
            zorder=2,
        )
        if spacing_mm < DOTTED_MM and len(shown.east_m) > 1:
            continue
        taken = [k for k in range(first, last + 1) if shown.photo is None or shown.photo[k]]
        panel.plot(
            [shown.east_m[k] for k in taken],
            [shown.north_m[k] for k in taken],
            "o",
            ms=10.5 if each else min(max(1.1 * spacing_mm, 1.5), 4.0),
            mfc=theme.background if each else colour,
            mec=colour,
            mew=0.9,
            zorder=3,
        )
    for place, marker in ((0, ">"), (len(shown.east_m) - 1, "s")):
        if not each:
            panel.plot(
                [shown.east_m[place]],
                [shown.north_m[place]],
                marker,
                ms=7,
                mfc=theme.data[1],
                mec=theme.background,
                zorder=5,
            )
    for place in numbered(shown.flights, spacing_mm):
        end = place in (0, len(shown.east_m) - 1)
        panel.annotate(
            str(place),
            (shown.east_m[place], shown.north_m[place]),
            ha="center",
            va="center" if each else "bottom",
            size=6.2,
            zorder=7,
            xytext=(0, 0 if each else 3.5),
            textcoords="offset points",
            color=theme.data[1] if end else theme.text,
            weight="bold" if end else "normal",
            path_effects=[] if each else halo,
        )


def flight_colour(theme: Theme, flight: int) -> str:
    """Colour of a flight.  Consecutive flights alternate between two colours."""
    return theme.data[2 if flight % 2 else 0]


def _spacing_m(shown: GridFigure) -> float:
    """Smallest distance between consecutive waypoints, among the first few thousand."""
    count = min(len(shown.east_m), 2000)
    steps = (
        math.hypot(shown.east_m[k + 1] - shown.east_m[k], shown.north_m[k + 1] - shown.north_m[k])
        for k in range(count - 1)
    )
    return min((step for step in steps if step > 0.0), default=0.0)


def window(shown: GridFigure) -> tuple[tuple[float, float], tuple[float, float]]:
    """Lower and upper corner of a rectangle around all drawn objects, with a margin."""
    rings = [shown.footprint, *(polygon[0] for polygon in (*shown.area, *shown.clear))]
    places = [point for ring in rings for point in ring]
    places += [shown.takeoff] if shown.takeoff is not None else []
    low, high = (
        [
            pick(pick(way), *(place[axis] for place in places))
            for axis, way in enumerate((shown.east_m, shown.north_m))
        ]
        for pick in (min, max)
    )
    sides = [top - bottom for bottom, top in zip(low, high, strict=True)]
    more = [0.04 * max(sides) + 0.5 * max(NARROWEST * max(sides) - side, 0.0) for side in sides]
    return (low[0] - more[0], low[1] - more[1]), (high[0] + more[0], high[1] + more[1])


def _patch(polygon: Polygon, **look: Any) -> PathPatch:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    rings = [Path(list(ring), closed=True) for ring in polygon]
    return PathPatch(Path.make_compound_path(*rings), **look)


def _scale_bar(panel: Axes, length_m: float, start: tuple[float, float], theme: Theme) -> None:
    x, y = start[0] + 0.15 * length_m, start[1]
    panel.plot([x, x + length_m], [y, y], "-", color=theme.text, lw=3.0, solid_capstyle="butt")
    panel.annotate(
        length(length_m),
        (x + length_m, y),
        xytext=(4, 0),
        textcoords="offset points",
        va="center",
        size=8,
    )


def _legend(shown: GridFigure, theme: Theme, shapes: dict[str, Any]) -> list[Any]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    labels = ["path (waypoints are numbered from 0)"]
    if len(shown.flights) > 1:
        names = (
            ("flight 1", "flight 2") if len(shown.flights) == 2 else ("odd flights", "even flights")
        )
        labels = [f"{names[0]} (waypoints are numbered from 0)", names[1]]
    dots: dict[str, Any] = {"marker": "o", "ms": 5, "mfc": theme.background}
    handles: list[Any] = [
        Line2D([], [], label=label, color=flight_colour(theme, flight), **dots)
        for flight, label in enumerate(labels)
    ]
    if shown.takeoff is not None:
        home = HOME | {"mfc": theme.data[3], "mec": theme.background}
        handles.append(Line2D([], [], label="take-off", **home))
    return handles + [Patch(label=name, **look) for name, (_, look) in shapes.items()]
