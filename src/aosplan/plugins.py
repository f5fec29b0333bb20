"""Formats, cameras and drones that other installed distributions add by entry points.

To keep the start fast, the metadata of distributions is read only if a name is not built in.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from aosplan.errors import RequestError
from aosplan.units import preset_hint

if TYPE_CHECKING:
    from collections.abc import Mapping


class Titled(Protocol):
    """A preset with a title."""

    @property
    def title(self) -> str:
        """Name for output."""


Preset = TypeVar("Preset", bound=Titled)


def added_preset(kind: str, name: str, presets: Mapping[str, Preset]) -> Preset:
    """The camera or drone that another distribution adds under a name that is not built in.

    Parameters
    ----------
    kind
        ``camera`` or ``drone``; the group is ``aosplan.cameras`` or ``aosplan.drones``.
    name
        The name.
    presets
        The built-in presets.

    Raises
    ------
    RequestError
        If no distribution adds a preset with this name. The hint lists built-in presets with
        similar names.
    """
    added = plugin(f"aosplan.{kind}s", name)
    if isinstance(added, type(next(iter(presets.values())))):
        return added
    raise RequestError(
        f"unknown {kind} '{name}'",
        preset_hint(name, {each: preset.title for each, preset in presets.items()})
        or f"aosplan {kind}s lists the presets; the name of a file ends in .toml",
    )


def plugin(group: str, name: str) -> Any:
    """The object that an installed distribution registers in a group under a name; None if there is
    no such object.

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
                "its distribution is broken; reinstall or remove it",
            ) from None
    return values
