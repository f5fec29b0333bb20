"""Output that commands share: JSON, warnings, files, and a bar while a cloud is read."""

from __future__ import annotations

import contextlib
import os
import sys
from typing import TYPE_CHECKING, Any

from aosplan.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from aosplan.export import Format
    from aosplan.mission import Mission
    from aosplan.resolve import Message


def print_json(document: Any) -> None:
    """One JSON document on stdout."""
    import json

    text = json.dumps(document, ensure_ascii=False, allow_nan=False, indent=1)
    sys.stdout.buffer.write(text.encode() + b"\n")
    sys.stdout.buffer.flush()


def print_warnings(warnings: Iterable[Message], *, quiet: bool = False) -> None:
    """Warnings on stderr, a line each."""
    for warning in () if quiet else warnings:
        from aosplan.cli.screen import say

        say("warning", warning.message)


def chosen_outputs(
    outputs: Sequence[str], name: str | None, *, force: bool
) -> list[tuple[Format, str]]:
    """Formats and paths of the outputs, checked before any work is done for them.

    Raises
    ------
    RequestError
        Where a format is unknown, a path cannot be written, or two outputs are the same.
    """
    if name is not None and len(outputs) != 1:
        raise RequestError(
            f"--format {name} goes with one --out", "write NAME:PATH where there are several"
        )
    if not outputs:
        return []
    from aosplan.export import choose
    from aosplan.files import check_output

    chosen = [choose(path, name) for path in outputs]
    for _, path in chosen:
        check_output(path, force=force)
        if sum(os.path.realpath(other) == os.path.realpath(path) for _, other in chosen) > 1:
            raise RequestError(f"output '{path}' is given twice")
    return chosen


def writes_stdout(paths: Iterable[str | None], *, as_json: bool) -> bool:
    """Whether one of the outputs goes to stdout, where nothing else may then be printed.

    Raises
    ------
    RequestError
        Where ``--json`` would print there as well.
    """
    found = "-" in paths
    if found and as_json:
        raise RequestError("--json and an output - both write to stdout", "give one of them")
    return found


def write_outputs(
    missions: Callable[[], Iterable[Mission]],
    chosen: list[tuple[Format, str]],
    pages: Mapping[str, bytes] | None = None,
    *,
    force: bool,
    quiet: bool = False,
) -> list[str]:
    """Write missions, and pages by their paths, to all outputs or to none; what was written.

    An output that needs several files has them numbered, with a hint that says so.

    Raises
    ------
    RequestError
        Where a mission is beyond the limits of a format, or two outputs share a file.
    """
    if not chosen and not pages:
        return []
    from aosplan.export import files
    from aosplan.files import write_all

    contents = dict(pages or {})
    hints = []
    flown = list(missions()) if chosen else []
    for form, path in chosen:
        needed = files(flown, form, path)
        for name in needed:
            if name in contents:
                raise RequestError(f"output '{name}' would be written twice", "name them apart")
        contents |= needed
        if len(needed) > 1:
            first, *_, last = needed
            hints.append(f"{form.title} needs {len(needed)} files here: {first} to {last}")
            hints += _leftovers(path, len(needed))
    write_all(contents, force=force)
    for hint in () if quiet else hints:
        from aosplan.cli.screen import say

        say("hint", hint)
    return list(contents)


def _leftovers(path: str, count: int) -> list[str]:
    """What an earlier, longer mission of the same name has left beside the numbered files."""
    stem, suffix = os.path.splitext(path)
    after = f"{stem}-{count + 1}{suffix}"
    return [f"{after} is not of this mission" for _ in range(os.path.lexists(after))]


@contextlib.contextmanager
def progress_bar(scene: str, *, quiet: bool) -> Iterator[Callable[[int, int], None] | None]:
    """A bar on a terminal's stderr, or None where there is none, or nothing to wait for."""
    with waiting_bar("reading points", quiet=quiet or not _is_read(scene)) as progress:
        yield progress


@contextlib.contextmanager
def waiting_bar(title: str, *, quiet: bool) -> Iterator[Callable[[int, int], None] | None]:
    """A bar on a terminal's stderr while something takes long, or None where there is none."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task(title, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


def _is_read(scene: str) -> bool:
    """Whether a scene's name may stand for point clouds: files, a folder or a pattern."""
    from aosplan.resolve import CLOUD_SUFFIXES

    return scene.lower().endswith(CLOUD_SUFFIXES) or os.path.isdir(scene)
