"""The user's own defaults: my drone, my camera, my take-off, so that a plan is one short line.

A TOML file of options as a request file has them.  It is ``aosplan/defaults.toml`` in the folder
for settings (``$XDG_CONFIG_HOME`` or ``~/.config``; ``%APPDATA%`` on Windows), or what
``AOSPLAN_DEFAULTS`` or ``--defaults`` name; ``none`` is no file at all.  A request file and flags
override it, and so does each scenario of a sweep; an earlier result is complete and takes nothing
from it.
"""

from __future__ import annotations

import os
import sys
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from aosplan.errors import RequestError
from aosplan.planning.request import PlanRequest, request_from

if TYPE_CHECKING:
    from collections.abc import Mapping

FILE_OPTIONS = (
    *("area", "camera", "clear", "crop", "drone", "no_fly", "scene", "terrain", "trajectory"),
)
"""Options that may name a file."""


def usual_path(environment: Mapping[str, str], platform: str = sys.platform) -> str:
    """Where a user's defaults lie; empty where the surroundings do not say."""
    if platform == "win32":
        folder = environment.get("APPDATA", "")
    else:
        # A relative folder is to be ignored, says the XDG base directory specification.
        folder = environment.get("XDG_CONFIG_HOME", "")
        if not os.path.isabs(folder):
            home = environment.get("HOME", "")
            folder = os.path.join(home, ".config") if home else ""
    return os.path.join(folder, "aosplan", "defaults.toml") if folder else ""


def find_defaults(chosen: str | None, environment: Mapping[str, str] | None = None) -> str | None:
    """The file of defaults that counts: the chosen one, the environment's, or the usual one.

    Raises
    ------
    RequestError
        Where a file was named that does not exist.
    """
    known = os.environ if environment is None else environment
    for name, what in ((chosen, "--defaults"), (known.get("AOSPLAN_DEFAULTS"), "AOSPLAN_DEFAULTS")):
        if name == "none":
            return None
        if name is not None:
            if not name or not os.path.isfile(name):
                raise RequestError(f"{what}: no file '{name}'", "none means that no file is read")
            return name
    usual = usual_path(known)
    return usual if usual and os.path.isfile(usual) else None


def read_defaults(path: str) -> dict[str, Any]:
    """Options from a file of defaults; the files that they name are looked for beside it."""
    from aosplan.planning.request_file import read_request

    values = read_request(path)
    for name in FILE_OPTIONS:
        beside = os.path.join(os.path.dirname(os.path.abspath(path)), str(values.get(name)))
        if os.path.isfile(beside):
            values[name] = beside
    return values


def request_of(
    path: str | None, flags: Mapping[str, Any], *, defaults: str | None = None
) -> PlanRequest:
    """The request of a command line: flags over a request file over the user's own defaults.

    Parameters
    ----------
    path
        Request file or earlier result, or None.
    flags
        Options by name; None counts as not given.
    defaults
        What ``--defaults`` said.
    """
    values: dict[str, Any] = {}
    complete = False
    if path is not None:
        from aosplan.planning.request_file import read_request

        values = read_request(path)
        complete = values.keys() >= {field.name for field in fields(PlanRequest) if field.default}
    own = None if complete else find_defaults(defaults)
    return request_from(
        values,
        overrides=flags,
        where=path or "",
        defaults=read_defaults(own) if own else None,
        defaults_where=own or "",
    )
