"""Results in the form of a folder of Parquet files, one file per part.

The folder gets its final name when it is complete. It contains no other files, because other
programs have to be able to read the folder. A journal remains beside the folder.  A later run can
use this journal to find damaged parts.
"""

from __future__ import annotations

import os
import re
import shutil
import uuid
from typing import TYPE_CHECKING

from aosplan.errors import RequestError, SurroundingsError
from aosplan.sweeps.parts import Parts

if TYPE_CHECKING:
    from aosplan.sweeps.sweep import Sweep

OF_A_SWEEP = re.compile(r"part-\d{5,}\.parquet(\.[0-9a-f]{32}\.tmp)?|writing-[0-9a-f]{32}")


def is_folder(out: str) -> bool:
    """Whether a result is a folder: either the folder exists, or the path ends with a separator."""
    # A slash at the end is accepted on every system, even if the usual separator is a backslash.
    return out.endswith(("/", os.sep)) or os.path.isdir(out)


def check_folder(out: str, *, resume: bool, force: bool) -> None:
    """Refuse a folder that cannot be written, or that contains files of other programs.

    Raises
    ------
    RequestError
        If the folder exists and may not be replaced, or if its parent folder does not exist.
    """
    place = os.path.abspath(out)
    above = os.path.dirname(place)
    if os.path.splitext(place)[1].lower() in (".csv", ".jsonl"):
        raise RequestError(
            f"output '{out}' is a folder, which contains Parquet files", "leave out the last /"
        )
    if not os.path.isdir(above):
        raise RequestError(
            f"output '{out}': there is no folder '{above}'", "create this folder first"
        )
    if not os.path.isdir(place):
        if os.path.lexists(place):
            raise RequestError(f"output '{out}' is a file", "leave out the last /")
        return
    unexpected = sorted(name for name in os.listdir(place) if not OF_A_SWEEP.fullmatch(name))
    if unexpected:
        raise RequestError(
            f"output '{out}' contains '{unexpected[0]}', which is not a part of a sweep",
            f"give a folder in it: {os.path.join(out, 'results.parquet', '')}",
        )
    if os.listdir(place) and not (resume or force):
        raise RequestError(
            f"output '{out}' exists",
            "--resume rewrites the damaged parts, and --force rewrites all parts",
        )


class Partitions(Parts):
    """The parts of a sweep that are themselves the result."""

    def __init__(self, out: str, sweep: Sweep) -> None:
        super().__init__(os.path.realpath(out), sweep)
        self.part_suffix = ".parquet"
        self.journal = f"{self.out}.journal.jsonl"
        self.count = sweep.scenarios.blocks
        self.digits = max(5, len(str(self.count - 1)))

    def start(self, *, resume: bool, force: bool) -> None:
        """Create the folder, or continue with the parts in this folder or in the result."""
        if resume and not os.path.isdir(self.folder) and os.path.isdir(self.out):
            self.folder = self.out if os.listdir(self.out) else self.folder
        super().start(resume=resume, force=force)

    def path(self, index: int) -> str:
        """Path of the file of a part."""
        return os.path.join(self.folder, f"part-{index:0{self.digits}d}.parquet")

    def join(self, sweep: Sweep, count: int) -> str:  # noqa: ARG002 (nothing is to be joined)
        """Check that the folder has all parts and no other files, and return the folder.

        Raises
        ------
        SurroundingsError
            If a part was removed after it was written.
        """
        names = {os.path.basename(self.path(index)) for index in range(self.count)}
        found = {entry.name: entry for entry in os.scandir(self.folder)}
        for name in found.keys() - names:
            if found[name].is_dir():
                shutil.rmtree(found[name].path)
            else:
                os.unlink(found[name].path)
        for index, part in sorted(self.done.items()):
            name = os.path.basename(self.path(index))
            if name not in found or found[name].stat().st_size != part.bytes:
                raise SurroundingsError(
                    f"'{self.path(index)}' has changed since it was written", "--resume rewrites it"
                )
        return self.folder

    def put(self, whole: str, *, resume: bool, force: bool) -> None:
        """Rename the folder to its final name. An earlier result is removed after that, because its
        removal takes time.

        Raises
        ------
        RequestError
            In the same cases as `check_folder`.
        """
        if whole == self.out:
            return
        check_folder(self.out, resume=resume, force=force)
        earlier = f"{self.out}.{uuid.uuid4().hex}.earlier" if os.path.isdir(self.out) else None
        if earlier is not None:
            os.replace(self.out, earlier)
        os.replace(whole, self.out)
        if earlier is not None:
            shutil.rmtree(earlier)

    def remove(self) -> None:
        """Sort the journal.  Nothing is removed, because the parts are the result."""
        self.note_all()

    def discard(self) -> None:
        """Remove the folder of a run that has written no part, unless the folder is the result."""
        if self.folder != self.out:
            super().discard()
            os.unlink(self.journal)
