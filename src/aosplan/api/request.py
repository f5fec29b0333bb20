"""Conversion of the arguments of a function of `aosplan` to a request."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import RequestError
from aosplan.planning.loaded_scene import LoadedScene
from aosplan.planning.request import PlanRequest, request_from
from aosplan.planning.result import Plan

if TYPE_CHECKING:
    from collections.abc import Mapping

    from aosplan.api.scenes import Stand

    RequestLike = PlanRequest | Plan | str | os.PathLike[str]
    """Types of an argument that describes a request: a `PlanRequest`, an earlier plan, or the path
    of a request file or of a saved plan.
    """


class FoundRequest(NamedTuple):
    """A request, the folder of its file, and its scene if the scene has been read before."""

    request: PlanRequest
    folder: str = ""
    loaded: LoadedScene | None = None


def found_request(
    asked: RequestLike | None, options: Mapping[str, Any], *, folder: str | None = None
) -> FoundRequest:
    """Make a request from the arguments of a function of `aosplan`.

    Options override the values of `asked`.

    Parameters
    ----------
    asked
        A request, an earlier plan, or the path of a request file or saved plan (TOML or JSON).  If
        it is None, only the options are used.
    options
        Keyword arguments with the names of the fields of `PlanRequest`.  `scene` may also be a
        result of `aosplan.read_scene`.

    folder
        Files that the request and the options refer to are looked for in this folder first. The
        default is the folder of the request file or of the earlier plan.

    Raises
    ------
    RequestError
        If a name is unknown, a value is not valid, or options contradict each other.
    """
    given = {name: _plain(value) for name, value in options.items()}
    if folder is not None:
        from aosplan.planning.aircraft import with_drone_file

        given = with_drone_file(given, folder)
    stand = given.get("scene")
    if isinstance(stand, LoadedScene):
        read_by: Stand = stand  # type: ignore[assignment]  # read_scene alone returns one
        given |= {"scene": None, **read_by.options}
    else:
        stand = None
    if isinstance(asked, Plan):
        folder = asked.inputs.folder if folder is None else folder
        asked = asked.request
    if isinstance(asked, PlanRequest):
        if not given:
            return FoundRequest(asked, folder or "")
        return FoundRequest(request_from(asked.document(), overrides=given), folder or "", stand)
    if asked is None:
        return FoundRequest(request_from({}, overrides=given), folder or "", stand)
    path = os.fspath(asked)
    if not isinstance(path, str):
        raise RequestError(f"request {path!r} is not a path", "give a PlanRequest or options")
    from aosplan.planning.request_file import read_request

    request = request_from(read_request(path), overrides=given, where=path)
    return FoundRequest(request, os.path.dirname(path) if folder is None else folder, stand)


def _plain(value: Any) -> Any:
    """A path as text; other values are returned unchanged."""
    return os.fspath(value) if isinstance(value, os.PathLike) else value
