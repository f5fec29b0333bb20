"""Reading files with size limits; writing files completely or not at all."""

from __future__ import annotations

import math
import os
import re
import stat
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NoReturn

from aosplan.errors import AosplanError, RequestError, SurroundingsError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

MOST_BYTES = 64 * 1024 * 1024
"""Size [bytes] of the largest document that is read."""

DEEPEST = 60
"""Greatest number of nesting levels in a document."""

_WINDOWS_PATH = re.compile(r'"[^"\n]*\\[^"\n]*"')
"""A double-quoted TOML string that contains a backslash. TOML reads the backslash as an escape."""

MOST_NAMES = 200_000
"""Greatest number of names in a TOML document; the parser needs up to 2 kB for each."""


def read_bytes(path: str, *, most: int = MOST_BYTES) -> bytes:
    """Read a file, or stdin for ``-``.

    Raises
    ------
    RequestError
        If the file does not exist or is larger than `most`.
    SurroundingsError
        If the file cannot be read.
    """
    content = read_start(path, most + 1)
    if len(content) > most:
        raise RequestError(f"'{path}' is larger than {most // 2**20} MB")
    return content


def read_start(path: str, most: int) -> bytes:
    """Read at most the first `most` bytes of a file, or of stdin for ``-``.

    Raises
    ------
    RequestError
        If the file does not exist.
    SurroundingsError
        If the file cannot be read.
    """
    with reading(path):
        if path == "-":
            return sys.stdin.buffer.read(most)
        with open(path, "rb") as file:
            return file.read(most)


@contextmanager
def reading(path: str, what: str = "file") -> Iterator[None]:
    """Wrap the opening and reading of a file, so that all input files get the same error messages.

    Parameters
    ----------
    path
        The file.
    what
        What the file is for the user, such as ``camera file``.

    Raises
    ------
    RequestError
        If the file does not exist.
    SurroundingsError
        If the file cannot be read.
    """
    try:
        yield
    # ValueError: the path contains a zero byte
    except (FileNotFoundError, NotADirectoryError, ValueError):
        raise RequestError(f"there is no {what} '{path}'") from None
    except IsADirectoryError:
        raise RequestError(f"'{path}' is a folder, not a {what}") from None
    except OSError as error:
        raise SurroundingsError(f"cannot read '{path}': {_reason(error)}") from None


def read_table(path: str, *, most: int = MOST_BYTES, with_nan: bool = False) -> dict[str, Any]:
    """Read a TOML or JSON document whose top level is a table of named values.

    The extension ``.toml`` or ``.json`` determines the format. If a file has a different extension,
    its first character determines the format.

    Raises
    ------
    RequestError
        If the document is neither TOML nor JSON, is nested too deeply, has the same name twice, or
        contains a number that is too large for a float or text that is not Unicode.  The message
        gives the place.
    """
    return parse_table(read_bytes(path, most=most), path, with_nan=with_nan)


def text_of(content: bytes, path: str) -> str:
    """Decode the text of a file: UTF-8, or UTF-16 with a byte order mark, as PowerShell writes it.

    Raises
    ------
    RequestError
        If the file has neither of these encodings.
    """
    wide = content[:2] in (b"\xff\xfe", b"\xfe\xff")
    try:
        return content.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError as error:
        kind = "UTF-16" if wide else "UTF-8"
        raise RequestError(f"'{path}' is not {kind} text (byte {error.start})") from None


def parse_table(content: bytes, path: str, *, with_nan: bool = False) -> dict[str, Any]:
    """Parse the content of a file as `read_table` does.

    With `with_nan`, JSON may contain NaN and Infinity, which other programs write for unknown
    values.
    """
    text = text_of(content, path)
    suffix = os.path.splitext(path)[1].lower()
    start = text.lstrip()
    # ``[name]`` begins a table in TOML. In a JSON list, ``[`` is not followed by a letter.
    listed = start[:1] == "[" and not start.lstrip("[")[:1].isalpha()
    as_json = suffix == ".json" or (suffix != ".toml" and (listed or start[:1] == "{"))
    try:
        table = _from_json(text, with_nan=with_nan) if as_json else _from_toml(text)
        _check_values(table, text)
    except ValueError as error:
        kind = "JSON" if as_json else "TOML"
        hint = ""
        if not as_json and _WINDOWS_PATH.search(text):
            hint = (
                "if a path contains backslashes, write it in single quotes: 'C:\\Users\\stand.laz'"
            )
        raise RequestError(f"'{path}' is not valid {kind}: {error}", hint) from None
    except RecursionError:
        raise RequestError(f"'{path}' is nested too deeply to be read") from None
    if not isinstance(table, dict):
        raise RequestError(f"'{path}' contains no table of named values")
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


_TOML_TEXT = (
    r'(?s)"""(?:[^"\\]|\\.?|"(?!""))*+(?:""")?'
    r"|'''(?:[^']|'(?!''))*+(?:''')?"
    r'|"(?:[^"\\\n]|\\.?)*+"?'
    r"|'[^'\n]*+'?"
    r"|#[^\n]*+"
)
"""Strings and comments of TOML.  An unclosed string ends with its line or with the text."""


def _from_toml(text: str) -> Any:
    import re
    import tomllib

    # The depth is checked before parsing, because the time of tomllib grows with the square of the
    # depth of a dotted key. With possessive quantifiers, the time of this search is linear.
    names = re.sub(_TOML_TEXT, lambda found: "" if found[0][0] == "#" else "_", text)
    if re.search(rf"(?<![\w-])(?:[\w-]++[ \t]*+\.[ \t]*+){{{DEEPEST}}}", names):
        raise RecursionError
    headers = re.findall(r"(?m)^[ \t]*\[|\.[ \t]*[^\d\s]", names)
    if names.count("=") + names.count("{") + len(headers) > MOST_NAMES:
        raise ValueError(f"it has more than {MOST_NAMES} names")
    return tomllib.loads(text)


def _check_values(document: Any, text: str) -> None:
    """Refuse a document that is nested too deeply, or that contains an invalid number or text.

    Numbers and text are only checked if the text contains a large exponent, a very long number or
    an escaped surrogate.
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
    """Whether a value is a number that is too large for a float, or text that is not Unicode.

    A table is wrong if one of its names is not Unicode.
    """
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
    """Wrong values of a document, with their places: names and indices, joined by dots."""
    if _is_wrong(value):
        yield place or "a name", value
    if isinstance(value, (dict, list)):
        inner = value.items() if isinstance(value, dict) else enumerate(value)
        for name, within in inner:
            yield from _wrong_values(within, f"{place}.{name}" if place else str(name))


def is_unicode(text: str) -> bool:
    """Whether a text can be encoded as UTF-8.  A text with an unpaired surrogate cannot."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


@contextmanager
def decoding(what: str, path: str) -> Iterator[None]:
    """Wrap a library that decodes a file, so that a damaged file gives one error message.

    Libraries report damage with exceptions of every kind (a panic in Rust is not even an
    `Exception`), with warnings, and with text on stderr.

    Parameters
    ----------
    what
        What the file is for the user, such as ``raster``.
    path
        The file.

    Raises
    ------
    RequestError
        If the library raises anything except an `AosplanError`, an error of the operating system,
        `MemoryError` or an interruption.
    """
    import warnings

    try:
        with warnings.catch_warnings(), discarding_output(2):
            warnings.simplefilter("ignore")
            yield
    except (AosplanError, MemoryError, KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:  # noqa: BLE001 (a panic is no Exception)
        if isinstance(error, OSError) and error.errno is not None:
            raise SurroundingsError(f"cannot read '{path}': {_reason(error)}") from None
        # The text of a panic describes the library's code, not the file.
        lines = str(error).strip().splitlines() if isinstance(error, Exception) else []
        reason = f": {lines[0].strip()}" if lines else ""
        raise RequestError(f"'{path}' is not a {what} that can be read{reason}") from None


@contextmanager
def discarding_output(descriptor: int) -> Iterator[None]:
    """Discard the output of a compiled library to stdout (descriptor 1) or stderr (2)."""
    try:
        kept = os.dup(descriptor)
    except OSError:  # The descriptor is closed, so nothing can be printed.
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
    """Refuse a file that cannot be opened, before a library opens it.

    Raises
    ------
    RequestError
        If the file does not exist.
    SurroundingsError
        If the file cannot be read.
    """
    with reading(path), open(path, "rb"):
        pass


def check_output(path: str, *, force: bool) -> None:
    """Refuse an output path that cannot be written, before any work is done.

    Raises
    ------
    RequestError
        If it is a folder, if its folder does not exist, or if it exists and `force` is false.
    """
    if path == "-":
        return
    if "\0" in path:
        raise RequestError(f"output {path!r} has a zero byte in its name")
    folder = os.path.dirname(path) or "."
    if os.path.isdir(path):
        raise RequestError(f"output '{path}' is a folder", "give the name of a file in this folder")
    if not os.path.isdir(folder):
        raise RequestError(
            f"output '{path}': there is no folder '{folder}'", "create this folder first"
        )
    if os.path.exists(path) and not os.path.isfile(path):
        raise RequestError(f"output '{path}' is not a regular file", "to write to stdout, give -")
    if os.path.lexists(path) and not force:
        raise RequestError(f"output '{path}' exists", "give --force to overwrite it")


def write_all(contents: Mapping[str, bytes], *, force: bool = False) -> None:
    """Write several files.  Either all files are written completely, or no file is written.

    Each file is written to a temporary file in the same folder.  The temporary files are renamed
    only when all of them are on the disk.

    Raises
    ------
    RequestError
        If `check_output` refuses one of the paths.
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
        import tempfile

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
    """The file to replace: for a link, the file that the link points to."""
    return os.path.realpath(path)


def _place(temporary: str, path: str, *, force: bool) -> str | None:
    """Rename a temporary file to its final name. If the final name belongs to an earlier file, that
    file is renamed first and its new name is returned; otherwise, None is returned.
    """
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
        except OSError:  # the file may not exist
            return


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()


def is_locked(error: OSError) -> bool:
    """Whether Windows refused access because another program has the file open."""
    return getattr(error, "winerror", None) in (5, 32, 33)


def _refused(path: str, error: OSError) -> SurroundingsError:
    hint = f"close the program that has '{path}' open" if is_locked(error) else ""
    return SurroundingsError(f"cannot write '{path}': {_reason(error)}", hint)


def located(name: str, folder: str) -> str:
    """Resolve a file name from a request file. The file is first looked for in the folder of the
    request file. If it is not there, the name is used as given.
    """
    beside = os.path.join(folder, name)
    if not folder:
        return name
    if is_pattern(beside):
        import glob

        return beside if glob.glob(beside) else name
    named = is_file_name(name) or os.path.isdir(beside)
    return beside if named and os.path.exists(beside) else name


def is_file_name(name: str) -> bool:
    """Whether a name belongs to a file instead of a preset. The name of a file has an extension or
    a folder.
    """
    return os.path.splitext(name)[1] != "" or os.sep in name


def is_pattern(name: str) -> bool:
    """Whether a name is a pattern such as ``tiles/*.laz``, and no file has this name."""
    return any(mark in name for mark in "*?[") and not os.path.lexists(name)
