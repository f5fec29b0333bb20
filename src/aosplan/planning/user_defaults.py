"""The user's own defaults, such as their drone, camera and take-off.

The defaults are in a TOML file of options, like a request file. It is ``aosplan/defaults.toml`` in
the settings folder (``$XDG_CONFIG_HOME`` or ``~/.config``; ``%APPDATA%`` on Windows), or the file
that ``AOSPLAN_DEFAULTS`` or ``--defaults`` names. With ``none``, no file is read. A request file,
flags and each scenario of a sweep override the defaults. Defaults are not used with a saved result,
because it contains all options.
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
    *(
        "area",
        "camera",
        "clear",
        "crop",
        "drone",
        "no_fly",
        "poa",
        "scene",
        "terrain",
        "trajectory",
    ),
)
"""Options whose value may be the name of a file."""


def usual_path(environment: Mapping[str, str], platform: str = sys.platform) -> str:
    """Usual path of the user's defaults; empty if the environment does not name a
    settings folder.
    """
    if platform == "win32":
        folder = environment.get("APPDATA", "")
    else:
        # According to the XDG base directory specification, a relative folder is ignored.
        folder = environment.get("XDG_CONFIG_HOME", "")
        if not os.path.isabs(folder):
            home = environment.get("HOME", "")
            folder = os.path.join(home, ".config") if home else ""
    return os.path.join(folder, "aosplan", "defaults.toml") if folder else ""


def find_defaults(chosen: str | None, environment: Mapping[str, str] | None = None) -> str | None:
    """The file of defaults: the file that an option or the environment names, otherwise the usual
    file.

    Raises
    ------
    RequestError
        If the named file does not exist.
    """
    known = os.environ if environment is None else environment
    for name, what in ((chosen, "--defaults"), (known.get("AOSPLAN_DEFAULTS"), "AOSPLAN_DEFAULTS")):
        if name == "none":
            return None
        if name is not None:
            if not name or not os.path.isfile(name):
                raise RequestError(
                    f"{what}: there is no file '{name}'",
                    "give the name of a file, or none for no file",
                )
            return name
    usual = usual_path(known)
    return usual if usual and os.path.isfile(usual) else None


def read_defaults(path: str) -> dict[str, Any]:
    """Read the options in a file of defaults.  Files that the options name are looked for in the
    same folder.
    """
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
    """The request of a command line.

    Flags override a request file, and both override the user's own defaults.

    Parameters
    ----------
    path
        Request file or saved result, or None.
    flags
        Options by name.  None means that an option is not given.
    defaults
        The value of ``--defaults``.
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
