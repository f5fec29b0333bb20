"""Parts of a sweep's result in a folder, and a journal of the complete parts.

A part gets its final name only when it is complete and on the disk.  After that, a line with the
checksum of its file is written to the journal.  After any interruption, a later run can therefore
find out which parts are complete.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import shutil
import sys
import uuid
from typing import TYPE_CHECKING, Any, NamedTuple

from aosplan.errors import RequestError
from aosplan.files import check_output
from aosplan.planning.options import BY_NAME
from aosplan.sweeps.input_files import is_file_option
from aosplan.sweeps.scenarios import polars

if TYPE_CHECKING:
    from collections.abc import Iterator

    import polars as pl

    from aosplan.sweeps.summary import Aggregates
    from aosplan.sweeps.sweep import Sweep

JOURNAL = "journal.jsonl"

BEGUN = ".tmp"
"""Extension of incomplete files."""


class Part(NamedTuple):
    """A complete part: index, number of rows, size and checksum of its file, and its summary."""

    part: int
    rows: int
    bytes: int
    sha256: str
    gathered: Aggregates | None = None

    def note(self) -> dict[str, Any]:
        """The line of the part in the journal."""
        return {name: value for name, value in self._asdict().items() if name != "gathered"}


class Parts:
    """The folder of a sweep's parts, and the journal of the complete parts."""

    def __init__(self, out: str, sweep: Sweep) -> None:
        # If the result is a link, the link is kept and its target is replaced.
        self.out = os.path.realpath(out) if os.path.islink(out) else out
        self.folder = f"{self.out}.parts"
        self.journal = os.path.join(self.folder, JOURNAL)
        self.suffix = os.path.splitext(out)[1].lower()
        # Parts are Parquet files, because Parquet preserves the types of columns. The types are
        # needed when the best rows of the parts are compared.
        self.part_suffix = self.suffix if sweep.best is None else ".parquet"
        self.fingerprint = sweep.fingerprint()
        self.done: dict[int, Part] = {}

    def start(self, *, resume: bool, force: bool) -> None:
        """Create the folder, or continue with the parts in it.

        Raises
        ------
        RequestError
            If the folder has parts and the run is not resumed, or if its parts belong to another
            sweep.
        """
        if os.path.isdir(self.folder):
            if resume:
                self._take_up()
                return
            if not force:
                raise RequestError(
                    f"'{self.folder}' contains parts of an interrupted sweep",
                    "--resume continues it, and --force starts again",
                )
            shutil.rmtree(self.folder)
        os.mkdir(self.folder)
        self.note_all()

    @contextlib.contextmanager
    def alone(self) -> Iterator[None]:
        """Context manager that holds a lock during a run. Another process therefore cannot write
        the same result.

        Raises
        ------
        RequestError
            If another process holds the lock.
        """
        lock = f"{self.out}.lock"
        handle = os.open(lock, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o666)
        try:
            if not _is_first(handle, lock):
                raise RequestError(
                    f"another sweep is writing '{self.out}'",
                    "wait until it ends, or give another --out",
                )
            try:
                yield
            finally:
                # Windows does not remove open files.
                if sys.platform == "win32":
                    os.close(handle)
                    handle = -1
                with contextlib.suppress(OSError):
                    os.unlink(lock)
        finally:
            if handle >= 0:
                os.close(handle)

    def _take_up(self) -> None:
        notes = _notes(self.journal)
        if not notes:
            raise RequestError(
                f"'{self.folder}' has no journal '{self.journal}'", "--force starts again"
            )
        if notes[0] != {"fingerprint": self.fingerprint}:
            raise RequestError(
                f"'{self.folder}' contains parts of another sweep",
                "give the same file, options and version, or --force to start again",
            )
        for note in notes[1:]:
            try:
                part = Part(**note)
                whole = _is_whole(self.path(part.part), part)
            except (TypeError, ValueError):  # This is not a line of a journal.
                continue
            if whole:
                self.done[part.part] = part
        self.note_all()

    def path(self, index: int) -> str:
        """Path of the file of a part."""
        return os.path.join(self.folder, f"{index:08d}{self.part_suffix}")

    def add(self, part: Part) -> None:
        """Add a complete part to the journal."""
        with open(self.journal, "a", encoding="utf-8") as file:
            file.write(json.dumps(part.note()) + "\n")
            file.flush()
            os.fsync(file.fileno())
        self.done[part.part] = part._replace(gathered=None)

    def note_all(self) -> None:
        """Write the journal again, with the complete parts in order."""
        notes = [{"fingerprint": self.fingerprint}]
        notes += [part.note() for _, part in sorted(self.done.items())]
        text = "".join(json.dumps(note) + "\n" for note in notes)
        write_durably(text.encode(), self.journal)

    def join(self, sweep: Sweep, count: int) -> str:
        """Join all parts into one temporary file in the folder of the result.  Returns the path of
        this file.
        """
        whole = os.path.join(self.folder, f"whole{self.suffix}")
        paths = [self.path(index) for index in range(count)]
        if sweep.best is not None:
            pl = polars()
            frames = [pl.read_parquet(path, glob=False) for path in paths]
            write_frame(sweep.best_of(pl.concat(frames)), whole)
        elif self.suffix == ".parquet":
            _join_parquet(paths, whole)
        else:
            _join_text(paths, whole, header=self.suffix == ".csv")
        # The parts are removed after the result is renamed. The result therefore has to be on the
        # disk.
        with open(whole, "r+b") as file:
            os.fsync(file.fileno())
        return whole

    def put(self, whole: str, *, resume: bool, force: bool) -> None:  # noqa: ARG002
        """Rename the result to its final name.

        Raises
        ------
        RequestError
            If a file with this name has been created in the meantime and may not be replaced.
        """
        check_output(self.out, force=force)
        os.replace(whole, self.out)

    def remove(self) -> None:
        """Remove files that only the run needs: the folder of the parts."""
        shutil.rmtree(self.folder)

    def drop_begun(self) -> None:
        """Remove incomplete files of processes that were terminated."""
        for name in os.listdir(self.folder):
            if name.endswith(BEGUN):
                with contextlib.suppress(OSError):
                    os.unlink(os.path.join(self.folder, name))

    def discard(self) -> None:
        """Remove the folder of a run that has written nothing."""
        shutil.rmtree(self.folder)


def solve_part(sweep: Sweep, index: int, path: str | None, folder: str | None = None) -> Part:
    """Solve a block and write its rows to `path` (None: no rows are written).

    The incomplete file is in `folder`.
    """
    frame, gathered = sweep.part(index)
    size, checksum = (0, "") if path is None else write_frame(frame, path, folder)
    return Part(index, frame.height, size, checksum, gathered)


def _is_first(handle: int, lock: str) -> bool:
    """Try to get the lock. Returns true if this was possible, and false if another process holds
    the lock.
    """
    if sys.platform == "win32":
        import msvcrt

        try:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True
    import fcntl

    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # The file system does not support locks.
        return True
    # Another run may have removed the lock file before this process locked it.
    return os.path.exists(lock) and os.path.samestat(os.fstat(handle), os.stat(lock))


def write_frame(frame: pl.DataFrame, path: str, folder: str | None = None) -> tuple[int, str]:
    """Write a frame with `write_durably`, in the format of the path's extension.  Returns size and
    SHA-256.
    """
    content = io.BytesIO()
    if path.endswith(".parquet"):
        frame.write_parquet(content, compression="lz4")
    elif path.endswith(".csv"):
        _guarded(frame).write_csv(content)
    else:
        frame.write_ndjson(content)
    with content.getbuffer() as whole:
        write_durably(whole, path, folder)
        return len(whole), hashlib.sha256(whole).hexdigest()


def _guarded(frame: pl.DataFrame) -> pl.DataFrame:
    """A frame in which no file name starts with a character that begins a formula in
    a spreadsheet.
    """
    pl = polars()
    names = [
        name
        for name, kind in frame.schema.items()
        if kind == pl.String and name in BY_NAME and is_file_option(name)
    ]
    return frame.with_columns(
        pl.when(pl.col(name).str.contains(r"^[=+\-@\t\r]"))
        .then(pl.lit("'") + pl.col(name))
        .otherwise(pl.col(name))
        .alias(name)
        for name in names
    )


def write_durably(content: bytes | memoryview, path: str, folder: str | None = None) -> None:
    """Write a file that gets its final name only when it is complete and on the disk.

    Parameters
    ----------
    content, path
        The content, and the path of the file.
    folder
        Folder of the incomplete file, on the same disk.  By default, it is the folder of `path`.

    Raises
    ------
    OSError
        If the file cannot be written.  No incomplete file remains.
    """
    name = f"{os.path.basename(path)}.{uuid.uuid4().hex}{BEGUN}"
    temporary = os.path.join(os.path.dirname(path) if folder is None else folder, name)
    try:
        with open(temporary, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException as error:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        if isinstance(error, OSError):
            error.filename = path
        raise


def _notes(journal: str) -> list[dict[str, Any]]:
    """The lines of a journal.  An incomplete last line is ignored."""
    notes = []
    try:
        with open(journal, encoding="utf-8", errors="replace") as file:
            for line in file:
                with contextlib.suppress(ValueError):
                    notes.append(json.loads(line))
    except FileNotFoundError:
        return []
    return notes


def _is_whole(path: str, part: Part) -> bool:
    """Whether the file of a part has the size and checksum that the journal gives."""
    if not os.path.isfile(path) or os.path.getsize(path) != part.bytes:
        return False
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest() == part.sha256


def _join_parquet(paths: list[str], whole: str) -> None:
    if len(paths) == 1:
        os.replace(paths[0], whole)
        return
    pl = polars()
    # Each part becomes a row group of the result.
    pl.scan_parquet(paths, glob=False).sink_parquet(whole, compression="lz4", maintain_order=True)


def _join_text(paths: list[str], whole: str, *, header: bool) -> None:
    with open(whole, "wb") as target:
        for place, path in enumerate(paths):
            with open(path, "rb") as part:
                if header and place:
                    part.readline()
                shutil.copyfileobj(part, target, 1 << 20)
