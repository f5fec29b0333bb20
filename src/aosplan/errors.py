"""What can go wrong, and what to do about it.

    AosplanError
    ├── RequestError        the request is wrong: an option, a value, a file's content
    ├── InfeasibleError     the request is sound but nothing meets it
    ├── MissingExtraError   an optional dependency is not installed
    └── SurroundingsError   the machine failed: no permission, disk full

Every error carries one sentence that names the offending value and where it stands, and
where there is a remedy a hint.  The command line turns them into ``error:`` and ``hint:``
lines and exits with ``exit_status``.
"""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator


class AosplanError(Exception):
    """Base of every error that aosplan raises on purpose.

    Parameters
    ----------
    message
        One sentence: the offending value and where it stands.
    hint
        One sentence with the remedy, or empty.
    """

    exit_status = 2

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint


class RequestError(AosplanError):
    """An option, a value or the content of a file is wrong."""


class InfeasibleError(AosplanError):
    """The request is well formed, but nothing within its bounds meets it."""


class MissingExtraError(AosplanError):
    """The request needs an optional dependency that is not installed."""

    def __init__(self, what: str, extra: str) -> None:
        super().__init__(
            f"{what} needs the optional extra '{extra}'", f'pip install "aosplan[{extra}]"'
        )


@contextmanager
def needs_extra(what: str, extra: str) -> Iterator[None]:
    """Around the imports of an optional dependency: an error where it is not installed.

    Raises
    ------
    MissingExtraError
        That names `what` needs it, and the extra that it comes with.
    """
    try:
        yield
    except ImportError:
        raise MissingExtraError(what, extra) from None


class SurroundingsError(AosplanError):
    """The machine, not the request, failed: no permission, disk full."""

    exit_status = 1
