"""Errors that aosplan raises on purpose.

    AosplanError
    ├── RequestError        the request is wrong: an option, a value, a file's content
    ├── InfeasibleError     the request is valid but has no solution
    ├── MissingExtraError   an optional dependency is not installed
    └── SurroundingsError   the machine failed: no permission, disk full

Every error has a one-sentence message with the offending value and its place.  If there is a
remedy, it also has a hint.  The command line prints them as ``error:`` and ``hint:`` lines and
exits with ``exit_status``.
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
        One sentence that names the offending value and its place.
    hint
        One sentence that names the remedy, or empty.
    """

    exit_status = 2

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint


class RequestError(AosplanError):
    """An option, a value or the content of a file is wrong."""


class InfeasibleError(AosplanError):
    """The request is well formed, but no solution exists within its bounds."""


class MissingExtraError(AosplanError):
    """The request needs an optional dependency that is not installed."""

    def __init__(self, what: str, extra: str) -> None:
        super().__init__(
            f"{what} needs the optional extra '{extra}'", f'pip install "aosplan[{extra}]"'
        )


@contextmanager
def needs_extra(what: str, extra: str) -> Iterator[None]:
    """Wrap the imports of an optional dependency, and report the dependency if it is missing.

    Raises
    ------
    MissingExtraError
        If an import fails. The message says what needs the dependency (`what`), and which extra to
        install.
    """
    try:
        yield
    except ImportError:
        raise MissingExtraError(what, extra) from None


class SurroundingsError(AosplanError):
    """The machine failed, not the request: for example, there is no permission or the disk
    is full.
    """

    exit_status = 1
