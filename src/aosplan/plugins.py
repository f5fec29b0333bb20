"""Formats, cameras and drones that other installed distributions add by entry points.

To keep the start fast, the metadata of distributions is read only if a name is not built in.
"""

from __future__ import annotations

from typing import Any

from aosplan.errors import RequestError


def plugin(group: str, name: str) -> Any:
    """The object that an installed distribution registers under a name in a group, or None.

    Raises
    ------
    RequestError
        If the object cannot be loaded.
    """
    return next((value for _, value in _loaded(group, name)), None)


def plugins(group: str) -> dict[str, Any]:
    """All objects that installed distributions register in a group, by name."""
    return dict(_loaded(group))


def _loaded(group: str, *names: str) -> list[tuple[str, Any]]:
    from importlib.metadata import entry_points

    found = entry_points(group=group)
    wanted = [entry for entry in found if not names or entry.name in names]
    values = []
    for entry in sorted(wanted, key=lambda each: each.name):
        try:
            values.append((entry.name, entry.load()))
        except Exception as error:  # noqa: BLE001 (whatever the code of others raises)
            raise RequestError(
                f"'{entry.name}' of {group} ({entry.value}) cannot be loaded: {error}",
                "its distribution is broken: reinstall it, or remove it",
            ) from None
    return values
