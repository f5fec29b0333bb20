"""The report: a self-contained HTML page about a plan, from which the plan can also be computed
again.

`report_page` fills the template ``page.html``.  The style is in ``page.css``, and the script
consists of `SCRIPTS`.  The page contains the plan's JSON document, in which waypoints are columns
of bytes.

Every number on the page is a rounded number of this document.  The page does not load any other
file.  A content security policy allows only the style and the script in the page, by their hashes.
"""

from __future__ import annotations

from base64 import b64encode
from hashlib import sha256
from importlib.resources import files
from typing import TYPE_CHECKING

from aosplan.errors import MissingExtraError

if TYPE_CHECKING:
    from aosplan.maps.detection_map import DetectionMap, SearchSuccess
    from aosplan.maps.reciprocal_map import ReciprocalMap
    from aosplan.planning.result import Plan

EXTRA = "report"

SUFFIXES = (".html", ".htm")
"""Extensions of report files."""

SCRIPTS = ("waypoints.js", "map.js", "page.js")
"""Parts of the page's script.  Later parts use earlier parts."""

SEED = 1
"""Default seed of the simulated picture."""


def check_extra(*, picture: bool) -> None:
    """Check that a report can be written, before any work is done for it.

    Raises
    ------
    MissingExtraError
        If Jinja2 is not installed, or if Pillow is not installed and a picture is requested.
    """
    from importlib.util import find_spec

    needed = ("jinja2", "PIL") if picture else ("jinja2",)
    if any(find_spec(name) is None for name in needed):
        raise MissingExtraError("a report", EXTRA)


def report_page(
    plan: Plan,
    *,
    seed: int | None = SEED,
    detection_map: DetectionMap | None = None,
    success: SearchSuccess | None = None,
    reciprocal_map: ReciprocalMap | None = None,
) -> bytes:
    """The page of a plan in UTF-8.  The bytes depend only on the plan and the seed.

    Parameters
    ----------
    plan
        The plan to show.
    seed
        Random seed of the simulated picture; None for a page without one.
    detection_map, success
        Probability of detection by place, and probability of success with a prior.
    reciprocal_map
        Map of how much of the target area camera positions see.

    Raises
    ------
    MissingExtraError
        If Jinja2 is not installed, or if Pillow is not installed and a picture is requested.
    """
    check_extra(picture=seed is not None)
    import json

    import jinja2
    import tomli_w

    from aosplan.show.figures.grid import grid_of
    from aosplan.show.page.charts import charts_of
    from aosplan.show.page.detection_curve import detection_curve
    from aosplan.show.page.gain_curve import gain_curve
    from aosplan.show.page.height_profile import profile_of
    from aosplan.show.page.map_data import packed_columns, scenery_of
    from aosplan.show.page.number_text import NumberFormatter, long, short, spacing
    from aosplan.show.page.search_map import position_map, search_map
    from aosplan.show.page.simulated_photos import simulated_photos
    from aosplan.show.page.static_map import MOST_SITES, static_map_of
    from aosplan.show.page.within_curve import within_curve
    from aosplan.show.text.plan_rows import guided_texts

    document = plan.document()
    rows = len(document.pop("waypoints"))
    grid = grid_of(plan, plan.layout.area)
    style, script = _read("page.css"), "\n".join(_read(name) for name in SCRIPTS)
    # The hash of a style or script is computed from the exact text between its tags.
    policy = {"style": _hash(style), "script": _hash(script)}
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(_read),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.policies["json.dumps_kwargs"] = {
        "sort_keys": False,
        "allow_nan": False,
        "separators": (",", ":"),
    }
    environment.filters |= {"short": short, "long": long, "spacing": spacing}
    text = environment.get_template("page.html").render(
        plan=document,
        number=NumberFormatter(document),
        rows=rows,
        policy=policy,
        style=style,
        script=script,
        columns=packed_columns(plan.waypoints),
        scenery=scenery_of(plan, grid),
        still=static_map_of(plan, grid),
        most_sites=MOST_SITES,
        charts=charts_of(plan),
        detection=detection_curve(plan),
        within=within_curve(plan),
        gain=gain_curve(plan),
        search=search_map(detection_map, success),
        guided=[] if plan.guided is None else guided_texts(plan.guided),
        positions=position_map(
            reciprocal_map, [*zip(plan.waypoints.east_m, plan.waypoints.north_m, strict=True)]
        ),
        profile=profile_of(plan),
        views=simulated_photos(plan, seed),
        camera=plan.camera.title or plan.camera.name,
        place=plan.origin and _place(*plan.origin),
        turns=plan.waypoints.photo is not None,
        request_toml=tomli_w.dumps(document["request"]),
        request_json=json.dumps(document["request"], ensure_ascii=False, indent=1),
    )
    # A file name may contain bytes that are not Unicode.
    return text.encode(errors="replace")


def _read(name: str) -> str:
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


def _place(latitude: float, longitude: float) -> str:
    """Latitude and longitude as text, to about a tenth of a metre."""
    south, west = "NS"[latitude < 0.0], "EW"[longitude < 0.0]
    return f"{abs(latitude):.6f}° {south}, {abs(longitude):.6f}° {west}"


def _hash(text: str) -> str:
    return "sha256-" + b64encode(sha256(text.encode()).digest()).decode()
