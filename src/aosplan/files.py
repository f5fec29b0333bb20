"""Files: read with limits, written whole or not at all."""

from __future__ import annotations

import math
import os
import re
import stat
import sys
import tempfile
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NoReturn

from aosplan.errors import AosplanError, RequestError, SurroundingsError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

MOST_BYTES = 64 * 1024 * 1024
"""Larger documents are refused before they are read."""

DEEPEST = 60
"""Levels of nesting that a document may have."""

_WINDOWS_PATH = re.compile(r'"[^"\n]*\\[^"\n]*"')
"""Text of TOML in which a backslash begins an escape."""

MOST_NAMES = 200_000
"""Names that a TOML document may have: its parser takes up to 2 kB for each."""


def read_bytes(path: str, *, most: int = MOST_BYTES) -> bytes:
    """Content of a file, or of stdin for ``-``.

    Raises
    ------
    RequestError
        If there is no such file, or it is larger than `most`.
    SurroundingsError
        If it cannot be read.
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
        If there is no such file.
    SurroundingsError
        If it cannot be read.
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
        If there is no such file.
    SurroundingsError
        If it cannot be read.
    """
    try:
        yield
    except (FileNotFoundError, NotADirectoryError, ValueError):  # of a zero byte in the name
        raise RequestError(f"no {what} '{path}'") from None
    except IsADirectoryError:
        raise RequestError(f"'{path}' is a folder, not a {what}") from None
    except OSError as error:
        raise SurroundingsError(f"cannot read '{path}': {_reason(error)}") from None


def read_table(path: str, *, most: int = MOST_BYTES, with_nan: bool = False) -> dict[str, Any]:
    """A TOML or JSON document with named values at its top.

    ``.toml`` is TOML and ``.json`` JSON; anything else is taken by its first character.

    Raises
    ------
    RequestError
        If it is neither, nests too deeply, gives a name twice, or holds a number beyond what a
        float can hold or text that is not Unicode; the message says where.
    """
    return parse_table(read_bytes(path, most=most), path, with_nan=with_nan)


def text_of(content: bytes, path: str) -> str:
    """The text of a file: UTF-8, or UTF-16 with a byte order mark, as PowerShell writes it.

    Raises
    ------
    RequestError
        If it is neither.
    """
    wide = content[:2] in (b"\xff\xfe", b"\xfe\xff")
    try:
        return content.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError as error:
        kind = "UTF-16" if wide else "UTF-8"
        raise RequestError(f"'{path}' is not {kind} text (byte {error.start})") from None


def parse_table(content: bytes, path: str, *, with_nan: bool = False) -> dict[str, Any]:
    """The document that `read_table` finds in the content of a file.

    `with_nan` lets JSON hold NaN and Infinity, as other programs write them for unknown values.
    """
    text = text_of(content, path)
    suffix = os.path.splitext(path)[1].lower()
    start = text.lstrip()
    # ``[name]`` begins a table of TOML; a list of JSON holds other things.
    listed = start[:1] == "[" and not start.lstrip("[")[:1].isalpha()
    as_json = suffix == ".json" or (suffix != ".toml" and (listed or start[:1] == "{"))
    try:
        table = _from_json(text, with_nan=with_nan) if as_json else _from_toml(text)
        _check_values(table, text)
    except ValueError as error:
        kind = "JSON" if as_json else "TOML"
        hint = ""
        if not as_json and _WINDOWS_PATH.search(text):
            hint = "write backslashes of paths within single quotes: 'C:\\Users\\stand.laz'"
        raise RequestError(f"'{path}' is not valid {kind}: {error}", hint) from None
    except RecursionError:
        raise RequestError(f"'{path}' is nested too deeply") from None
    if not isinstance(table, dict):
        raise RequestError(f"'{path}' holds no table of named values")
    return table


def _from_json(text: str, *, with_nan: bool) -> Any:
    import json

    missing = object()

    def refuse(constant: str) -> NoReturn:
        raise ValueError(f"{constant} is not a number")

    def table(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        names = dict(pairs)
        if len(names) < len(pairs):
            twice = next(name for name, _ in pairs if names.pop(name, missing) is missing)
            raise ValueError(f"{twice!r} is given twice")
        return names

    constant = float if with_nan else refuse
    return json.loads(text, parse_constant=constant, object_pairs_hook=table)


def _from_toml(text: str) -> Any:
    import re
    import tomllib

    # tomllib makes a table for every part of a dotted key, and goes through all of them again for
    # each part, before we can look.  Possessive repeats keep the search linear.
    part = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+"""
    if re.search(rf"(?<![\w-])(?:{part}\.[ \t]*+){{{DEEPEST}}}", text):
        raise RecursionError
    headers = re.findall(r"(?m)^[ \t]*\[|\.[ \t]*[^\d\s]", text)
    if text.count("=") + text.count("{") + len(headers) > MOST_NAMES:
        raise ValueError(f"it has more than {MOST_NAMES} names")
    return tomllib.loads(text)


def _check_values(document: Any, text: str) -> None:
    """Refuse a document whose values lie too deep in each other, or that the text overstates.

    Its numbers and its text are looked through only if the text holds what could be wrong.
    """
    import re

    escaped = "\\u" in text and re.search(r"\\u[dD][89a-fA-F]", text) is not None
    large = re.search(r"[eE]\+?\d{3}|\d{300}", text) is not None
    depth, level = 0, [document]
    while level:
        depth += 1
        if depth > DEEPEST:
            raise RecursionError
        if (large or escaped) and any(map(_is_wrong, level)):
            place, value = next(_wrong_values(document))
            number = isinstance(value, (int, float))
            raise ValueError(f"{place} is {'too large a number' if number else 'not Unicode text'}")
        level = [
            inner
            for outer in level
            if isinstance(outer, (dict, list))
            for inner in (outer.values() if isinstance(outer, dict) else outer)
        ]


def _is_wrong(value: Any) -> bool:
    """Whether a value is a number beyond every float, or text, or a name in it, is not Unicode."""
    if isinstance(value, dict):
        return not all(map(is_unicode, value))
    if isinstance(value, str):
        return not is_unicode(value)
    if isinstance(value, (int, float)):
        try:
            return not math.isfinite(value)
        except OverflowError:
            return True
    return False


def _wrong_values(value: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    """Wrong values of a document, and where they stand: names and indices with dots between."""
    if _is_wrong(value):
        yield place or "a name", value
    if isinstance(value, (dict, list)):
        inner = value.items() if isinstance(value, dict) else enumerate(value)
        for name, within in inner:
            yield from _wrong_values(within, f"{place}.{name}" if place else str(name))


def is_unicode(text: str) -> bool:
    """Whether a text can be written as UTF-8: without half a pair of surrogates."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


@contextmanager
def decoding(what: str, path: str) -> Iterator[None]:
    """Around a library that decodes a file: whatever it does with a damaged one, one error line.

    Libraries complain about damage in exceptions of every kind, among them some that are no
    `Exception` (a panic in Rust), in warnings, and in words on stderr.

    Parameters
    ----------
    what
        What the file is for the user, such as ``raster``.
    path
        The file.

    Raises
    ------
    RequestError
        If the library raises anything but an error of this project's, an error of the machine, a
        lack of memory or an interruption.
    """
    import warnings

    try:
        with warnings.catch_warnings(), silent(2):
            warnings.simplefilter("ignore")
            yield
    except (AosplanError, MemoryError, KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:  # noqa: BLE001 (a panic is no Exception)
        if isinstance(error, OSError) and error.errno is not None:
            raise SurroundingsError(f"cannot read '{path}': {_reason(error)}") from None
        # What a panic says is about the library's own code.
        lines = str(error).strip().splitlines() if isinstance(error, Exception) else []
        reason = f": {lines[0].strip()}" if lines else ""
        raise RequestError(f"'{path}' is not a {what} that can be read{reason}") from None


@contextmanager
def silent(descriptor: int) -> Iterator[None]:
    """Keep what a library of another language prints away from stdout (1) or stderr (2)."""
    try:
        kept = os.dup(descriptor)
    except OSError:  # it is closed: nothing to keep clean
        yield
        return
    (sys.stdout if descriptor == 1 else sys.stderr).flush()
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, descriptor)
        yield
    finally:
        os.dup2(kept, descriptor)
        os.close(nowhere)
        os.close(kept)


def check_input(path: str) -> None:
    """Refuse a file that is not there, for libraries that open it themselves.

    Raises
    ------
    RequestError
        If there is no such file.
    SurroundingsError
        If it cannot be read.
    """
    with reading(path), open(path, "rb"):
        pass


def check_output(path: str, *, force: bool) -> None:
    """Refuse an output path before any work is done for it.

    Raises
    ------
    RequestError
        If it is a folder, its folder does not exist, or it exists and `force` is false.
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
        raise RequestError(f"output '{path}' is not a regular file", "- writes to stdout")
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
        If a file cannot be written: no permission, disk full.
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
        raise _refused(path, error) from None
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
        raise _refused(path, error) from None
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


def is_locked(error: OSError) -> bool:
    """Whether Windows refused to touch a file because a program, such as a spreadsheet, has it open."""
    return getattr(error, "winerror", None) in (5, 32, 33)


def _refused(path: str, error: OSError) -> SurroundingsError:
    hint = f"close the program that has '{path}' open" if is_locked(error) else ""
    return SurroundingsError(f"cannot write '{path}': {_reason(error)}", hint)


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
