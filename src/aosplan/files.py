"""Files: read with limits, written whole or not at all."""

from __future__ import annotations

import os
import stat
import sys
import tempfile
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NoReturn

from aosplan.errors import RequestError, SurroundingsError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

MOST_BYTES = 64 * 1024 * 1024
"""Larger documents are refused before they are read."""

DEEPEST = 60
"""Levels of nesting that a document may have."""


def read_bytes(path: str, *, most: int = MOST_BYTES) -> bytes:
    """Content of a file, or of stdin for ``-``.

    Raises
    ------
    RequestError
        Where there is no such file, or it is larger than `most`.
    SurroundingsError
        Where it cannot be read.
    """
    content = read_start(path, most + 1)
    if len(content) > most:
        raise RequestError(f"'{path}' is larger than {most // 2**20} MB")
    return content


def read_start(path: str, most: int) -> bytes:
    """The first bytes of a file, or of stdin for ``-``: at most so many.

    Raises
    ------
    RequestError
        Where there is no such file.
    SurroundingsError
        Where it cannot be read.
    """
    with reading(path):
        if path == "-":
            return sys.stdin.buffer.read(most)
        with open(path, "rb") as file:
            return file.read(most)


@contextmanager
def reading(path: str, what: str = "file") -> Iterator[None]:
    """Around the opening and reading of a file: its faults in the words of every other input.

    Parameters
    ----------
    path
        The file.
    what
        What a user takes it for.

    Raises
    ------
    RequestError
        Where there is no such file.
    SurroundingsError
        Where it cannot be read.
    """
    try:
        yield
    except (FileNotFoundError, NotADirectoryError, ValueError):  # of a zero byte in the name
        raise RequestError(f"no {what} '{path}'") from None
    except IsADirectoryError:
        raise RequestError(f"'{path}' is a folder, not a {what}") from None
    except OSError as error:
        raise SurroundingsError(f"cannot read '{path}': {_reason(error)}") from None


def read_table(path: str) -> dict[str, Any]:
    """A TOML or JSON document with named values at its top.

    ``.toml`` is TOML and ``.json`` JSON; anything else is taken by its first character.

    Raises
    ------
    RequestError
        Where it is neither; the message says at which line.
    """
    return parse_table(read_bytes(path), path)


def parse_table(content: bytes, path: str) -> dict[str, Any]:
    """The document that `read_table` finds in the content of a file."""
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise RequestError(f"'{path}' is not UTF-8 text (byte {error.start})") from None
    suffix = os.path.splitext(path)[1].lower()
    start = text.lstrip()
    # ``[name]`` begins a table of TOML; a list of JSON holds other things.
    listed = start[:1] == "[" and not start.lstrip("[")[:1].isalpha()
    as_json = suffix == ".json" or (suffix != ".toml" and (listed or start[:1] == "{"))
    try:
        table = _from_json(text) if as_json else _from_toml(text)
    except ValueError as error:
        kind = "JSON" if as_json else "TOML"
        raise RequestError(f"'{path}' is not valid {kind}: {error}") from None
    except RecursionError:
        raise RequestError(f"'{path}' is nested too deeply") from None
    if not isinstance(table, dict):
        raise RequestError(f"'{path}' holds no table of named values")
    return table


def _from_json(text: str) -> Any:
    import json

    def refuse(constant: str) -> NoReturn:
        raise ValueError(f"{constant} is not a number")

    def table(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        names = dict(pairs)
        if len(names) < len(pairs):
            twice = next(name for i, (name, _) in enumerate(pairs) if name in dict(pairs[:i]))
            raise ValueError(f"{twice!r} is given twice")
        return names

    return _checked_depth(json.loads(text, parse_constant=refuse, object_pairs_hook=table))


def _from_toml(text: str) -> Any:
    import tomllib

    # A dotted key makes a table for every dot, which tomllib would build before we can look.
    if any(line.partition("=")[0].count(".") > DEEPEST for line in text.splitlines()):
        raise RecursionError
    return _checked_depth(tomllib.loads(text))


def _checked_depth(value: Any) -> Any:
    """A document, unless its lists and tables lie too deep in each other."""
    depth, level = 0, [value]
    while level:
        depth += 1
        if depth > DEEPEST:
            raise RecursionError
        level = [
            inner
            for outer in level
            if isinstance(outer, (dict, list))
            for inner in (outer.values() if isinstance(outer, dict) else outer)
        ]
    return value


def check_input(path: str) -> None:
    """Refuse a file that is not there, for libraries that open it themselves.

    Raises
    ------
    RequestError
        Where there is no such file.
    SurroundingsError
        Where it cannot be read.
    """
    with reading(path), open(path, "rb"):
        pass


def check_output(path: str, *, force: bool) -> None:
    """Refuse an output path before any work is done for it.

    Raises
    ------
    RequestError
        Where it is a folder, its folder does not exist, or it exists and `force` is false.
    """
    if path == "-":
        return
    if "\0" in path:
        raise RequestError(f"output {path!r} has a zero byte in its name")
    folder = os.path.dirname(path) or "."
    if os.path.isdir(path):
        raise RequestError(f"output '{path}' is a folder", "name a file in it")
    if not os.path.isdir(folder):
        raise RequestError(f"output '{path}': there is no folder '{folder}'", "make it first")
    if os.path.exists(path) and not os.path.isfile(path):
        raise RequestError(f"output '{path}' is no regular file", "- writes to stdout")
    if os.path.lexists(path) and not force:
        raise RequestError(f"output '{path}' exists", "give --force to overwrite it")


def write_all(contents: Mapping[str, bytes], *, force: bool = False) -> None:
    """Write several files: all of them whole, or none.

    Each goes to a temporary file beside its target first, and only when all of them are on
    the disk do they take their names.

    Raises
    ------
    RequestError
        As `check_output`.
    SurroundingsError
        Where a file cannot be written: no permission, disk full.
    """
    for path in contents:
        check_output(path, force=force)
    waiting: dict[str, str] = {}
    placed: dict[str, str | None] = {}
    try:
        for path, content in contents.items():
            if path != "-":
                waiting[path] = _write_beside(path, content)
        for path, temporary in waiting.items():
            placed[path] = _place(temporary, path, force=force)
    except BaseException:
        for path, earlier in placed.items():
            _restore(path, earlier)
        for temporary in waiting.values():
            _remove(temporary)
        raise
    for earlier in placed.values():
        _remove(earlier or "")
    if "-" in contents:
        sys.stdout.buffer.write(contents["-"])
        sys.stdout.buffer.flush()


def _write_beside(path: str, content: bytes) -> str:
    folder = os.path.dirname(_target(path))
    temporary = ""
    try:
        handle, temporary = tempfile.mkstemp(prefix=".aosplan-", dir=folder)
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        kept = os.path.isfile(path)
        os.chmod(temporary, stat.S_IMODE(os.stat(path).st_mode) if kept else 0o666 & ~_umask())
    except OSError as error:
        _remove(temporary)
        raise SurroundingsError(f"cannot write '{path}': {_reason(error)}") from None
    except BaseException:
        _remove(temporary)
        raise
    return temporary


def _target(path: str) -> str:
    """What is written: a link stays, and what it points to is replaced."""
    return os.path.realpath(path)


def _place(temporary: str, path: str, *, force: bool) -> str | None:
    """Give a file its name; the name under which an earlier file is kept, None if there was none."""
    if not os.path.lexists(path):
        earlier = None
    elif force:
        earlier = f"{temporary}.earlier"
    else:
        raise RequestError(f"output '{path}' exists", "give --force to overwrite it")
    try:
        if earlier is not None:
            os.replace(_target(path), earlier)
        os.replace(temporary, _target(path))
    except OSError as error:
        _restore(path, earlier)
        raise SurroundingsError(f"cannot write '{path}': {_reason(error)}") from None
    return earlier


def _restore(path: str, earlier: str | None) -> None:
    if earlier is None:
        _remove(_target(path))
    elif os.path.lexists(earlier):
        os.replace(earlier, _target(path))


def _remove(path: str) -> None:
    if path:
        try:
            os.unlink(path)
        except OSError:  # it may never have come into being
            return


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()


def located(name: str, folder: str) -> str:
    """A file name from a request file, looked for beside that file first."""
    beside = os.path.join(folder, name)
    if not folder:
        return name
    if is_pattern(beside):
        import glob

        return beside if glob.glob(beside) else name
    named = is_file_name(name) or os.path.isdir(beside)
    return beside if named and os.path.exists(beside) else name


def is_file_name(name: str) -> bool:
    """Whether a name has an extension or a folder, so that it names a file and not a preset."""
    return os.path.splitext(name)[1] != "" or os.sep in name


def is_pattern(name: str) -> bool:
    """Whether a name is a pattern such as ``tiles/*.laz``, and not the name of an existing file."""
    return any(mark in name for mark in "*?[") and not os.path.lexists(name)
