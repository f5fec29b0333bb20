"""Relations between ``--grid guided`` and other options.

Guided positions are chosen for one place from a point cloud (`aosplan.planning.guided`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from aosplan.errors import RequestError
from aosplan.planning.options import BY_NAME

if TYPE_CHECKING:
    from collections.abc import Mapping

NOT_GUIDED: tuple[tuple[str, tuple[Any, ...], str], ...] = (
    (
        "find",
        (),
        "guided positions did not always find more targets than plain grids in simulations",
    ),
    ("optimize", ("visibility",), "the positions are chosen for the visibility of the place"),
    ("trigger", ("stop",), "the positions are not on lines that can be flown through"),
    ("model", ("measured",), "the positions are chosen with the voxels of the place"),
    ("view", ("perspective",), "all photos show one place, in perspective"),
    ("edges", ("auto", "interior"), "only positions whose rays stay on the plot are used"),
    ("hold_error", (0.0,), "errors of the position are not part of the choice"),
    ("sensitivity", (), "the sensitivity is that of a grid"),
    ("allow_no_common_ground", (), "every photo shows the whole target area"),
)
"""Options that cannot be combined with guided positions, the values that are allowed nevertheless,
and the reason.
"""


def check_guided(values: Mapping[str, Any]) -> None:
    """Refuse options that cannot be combined with guided positions.

    Raises
    ------
    RequestError
        If there is such an option, or if the request has no location.
    """
    for name, allowed, reason in NOT_GUIDED:
        value = values[name]
        if value not in (None, False, *allowed):
            flag = BY_NAME[name].flag
            shown = flag if value is True else f"{flag} {value}"
            raise RequestError(
                f"{shown} cannot be used with --grid guided, because {reason}",
                f"leave {flag} out, or give another --grid",
            )
    if values["heading"] == "best" or isinstance(values["altitude"], str):
        name = "heading" if values["heading"] == "best" else "altitude"
        raise RequestError(
            f"--{name} {values[name]} cannot be used with --grid guided, because guided positions "
            f"are chosen for a single {name}",
            "give a number",
        )
    if all(values[name] is None for name in ("origin", "area", "around")):
        raise RequestError(
            "--grid guided needs a location, because the positions are chosen for one place",
            "give --origin LAT,LON or --area FILE",
        )
