"""Files that the scenarios of a sweep use.  The results depend on their content."""

from __future__ import annotations

import contextlib
import hashlib
import os
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import RequestError
from aosplan.files import located
from aosplan.planning.loaded_scene import cloud_files
from aosplan.planning.options import BY_NAME

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray


class NamedFile(NamedTuple):
    """A value of an option, the path that was found for this value, and the files to which it
    refers.
    """

    option: str
    value: str
    found: str
    files: tuple[str, ...]


def is_file_option(name: str) -> bool:
    """Whether values of an option may be file names."""
    return any(mark in BY_NAME[name].metavar for mark in ("FILE", "."))


def named_files(values: Mapping[str, NDArray[Any]], folder: str) -> Iterator[NamedFile]:
    """The values of a sweep that refer to existing files.

    Parameters
    ----------
    values
        Values by option.
    folder
        Folder in which the files are looked for first.
    """
    for name, column in values.items():
        if not is_file_option(name):
            continue
        for value in sorted({value for value in column.flat if isinstance(value, str)}):
            found = located(value, folder)
            try:
                stood_for = cloud_files(found) or (found,)
            # If a folder or a pattern has no files, the error is reported in the rows with this
            # value.
            except RequestError:
                continue
            there = tuple(file for file in stood_for if os.path.isfile(file))
            if there:
                yield NamedFile(name, value, found, there)


def checksums(values: Mapping[str, NDArray[Any]], folder: str) -> list[tuple[str, str, str]]:
    """Option, value and SHA-256 of every readable file.  The parameters are those of
    `named_files`.
    """
    sums = []
    for named in named_files(values, folder):
        for file in named.files:
            # If a file cannot be read, the error is reported in the rows with this value.
            with contextlib.suppress(OSError):
                known = os.stat(file)
                digest = _checksum(file, known.st_size, known.st_mtime_ns)
                sums.append((named.option, named.value, digest))
    return sums


@lru_cache(maxsize=1000)
def _checksum(path: str, _size: int, _modified_ns: int) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
