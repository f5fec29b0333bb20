"""The classes of Typer from which the commands are built.

``import typer`` also imports 40 modules that make commands from functions.  aosplan makes its
commands from tables and does not use these modules.  Importing them would take a fifth of the time
of a plain plan.  Therefore `typer.core` is imported here without executing the package ``typer``.
The package is executed later if other code uses one of its own names.
"""

from __future__ import annotations

import sys
from importlib.util import find_spec, module_from_spec
from types import ModuleType


class _Unexecuted(ModuleType):
    """A package that is executed at the first use of a name other than those of its modules."""

    def __getattr__(self, name: str) -> object:
        spec = self.__spec__
        assert spec is not None
        assert spec.loader is not None
        if find_spec(f"{spec.name}.{name}") is not None:
            # The import statement imports a module of the package after this error.
            raise AttributeError(name)
        self.__class__ = ModuleType  # type: ignore[assignment]
        spec.loader.exec_module(self)
        return getattr(self, name)


if "typer" not in sys.modules and (_spec := find_spec("typer")) is not None:
    _package = module_from_spec(_spec)
    _package.__class__ = _Unexecuted
    sys.modules["typer"] = _package

from typer.core import TyperArgument, TyperCommand, TyperGroup, TyperOption  # noqa: E402
from typer.exceptions import Exit, TyperException  # noqa: E402

__all__ = ["Exit", "TyperArgument", "TyperCommand", "TyperException", "TyperGroup", "TyperOption"]
