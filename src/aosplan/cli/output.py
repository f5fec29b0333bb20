"""Output that commands share: JSON, warnings, files, and a bar while a cloud is read."""

from __future__ import annotations

import contextlib
import os
import sys
from typing import TYPE_CHECKING, Any

from aosplan.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from rich.progress import Progress

    from aosplan.grid.patterns import Sites
    from aosplan.messages import Message
    from aosplan.mission.format import Format
    from aosplan.mission.mission import Mission
    from aosplan.solver.problem import Problem


def print_json(document: Any) -> None:
    """One JSON document on stdout."""
    import json

    try:
        text = json.dumps(document, ensure_ascii=False, allow_nan=False, indent=1)
    except ValueError:
        raise RequestError(
            "a result is too large for a number", "some input is too large"
        ) from None
    sys.stdout.buffer.write(text.encode() + b"\n")
    sys.stdout.buffer.flush()


def print_warnings(warnings: Iterable[Message], *, quiet: bool = False) -> None:
    """Warnings on stderr, a line each."""
    for warning in () if quiet else warnings:
        from aosplan.show.text.terminal import print_notice

        print_notice("warning", warning.message)


def chosen_outputs(
    outputs: Sequence[str], name: str | None, *, force: bool
) -> list[tuple[Format, str]]:
    """Formats and paths of the outputs, checked before any work is done for them.

    Raises
    ------
    RequestError
        If a format is unknown, a path cannot be written, or two outputs are the same.
    """
    if name is not None and len(outputs) != 1:
        raise RequestError(
            f"--format {name} goes with one --out", "write NAME:PATH if there are several"
        )
    if not outputs:
        return []
    from aosplan.files import check_output
    from aosplan.mission.export import choose

    chosen = [choose(path, name) for path in outputs]
    for _, path in chosen:
        check_output(path, force=force)
    check_apart([path for _, path in chosen])
    return chosen


def check_apart(paths: Sequence[str]) -> None:
    """Refuse a file that is given twice, be it under two names."""
    places = [os.path.realpath(path) for path in paths]
    for path, place in zip(paths, places, strict=True):
        if places.count(place) > 1:
            raise RequestError(f"output '{path}' is given twice")


def writes_stdout(paths: Iterable[str | None], *, as_json: bool) -> bool:
    """Whether one of the outputs goes to stdout, where nothing else may then be printed.

    Raises
    ------
    RequestError
        If ``--json`` would print there as well.
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
        If a mission is beyond the limits of a format, or two outputs share a file.
    """
    if not chosen and not pages:
        return []
    from aosplan.files import write_all
    from aosplan.mission.export import files, notes

    contents = dict(pages or {})
    hints = []
    flown = list(missions()) if chosen else []
    for form, path in chosen:
        needed = files(flown, form, path)
        for name in needed:
            if name in contents:
                raise RequestError(f"output '{name}' would be written twice", "name them apart")
        contents |= needed
        hints += notes(flown, form)
        if len(needed) > 1:
            first, *_, last = needed
            hints.append(f"{form.title} needs {len(needed)} files here: {first} to {last}")
            hints += _leftovers(path, len(needed))
    write_all(contents, force=force)
    for hint in () if quiet else hints:
        from aosplan.show.text.terminal import print_notice

        print_notice("hint", hint)
    return list(contents)


def _leftovers(path: str, count: int) -> list[str]:
    """What an earlier, longer mission of the same name has left beside the numbered files."""
    stem, suffix = os.path.splitext(path)
    after = f"{stem}-{count + 1}{suffix}"
    return [f"{after} is not of this mission" for _ in range(os.path.lexists(after))]


PATIENCE_S = 1.0
"""How long a search may take before a terminal shows what it tries."""


READING, PLACING = "reading points", "placing points"
"""What has an end that is known."""


class Bar:
    """What a plan is at, on a terminal's stderr: points that are read, then what a search tries.

    Where there is no terminal, or nothing takes long, it shows nothing and loads nothing.
    """

    def __init__(self, *, live: bool) -> None:
        self._live = live
        self._begun_s: float | None = None
        self._shown: Any = None
        self._title = ""

    def __call__(self, done: int, total: int) -> None:
        """Show how many points are read, then placed, and what is done between and after that."""
        if 2 * done < total:
            title = READING
        elif 2 * done == total:
            title = "finding the ground"
        elif done < total:
            title = PLACING
        else:
            title = "measuring the slices"
        self.doing(title)
        if self._live and title in (READING, PLACING):
            self._shown.update(self._shown.task_ids[0], completed=done, total=total)

    def doing(self, title: str) -> None:
        """Show what is being done."""
        if self._live:
            self._show(title)

    def on_trial(self, problem: Problem, pattern: Sites, baseline_m: float) -> None:
        """Show what a search tries, once it has lasted a while."""
        if not self._live:
            return
        from time import monotonic

        if self._begun_s is None:
            self._begun_s = monotonic()
        elif monotonic() - self._begun_s > PATIENCE_S:
            from aosplan.show.text.terminal import readable

            self._show("searching")
            tried = f"{problem.name}, N = {pattern.samples}, b = {baseline_m:.2f} m"
            self._shown.update(
                self._shown.task_ids[0], description=readable(f"searching: {tried}", sys.stderr)
            )

    def close(self) -> None:
        """Leave the terminal as it was."""
        self._live = False
        if self._shown is not None:
            _stop(self._shown)

    def _show(self, title: str) -> None:
        """Begin to show something, in place of what was shown before."""
        if title == self._title:
            return
        if self._shown is not None:
            self._shown.stop()
        self._title, self._shown = title, _progress(endless=title not in (READING, PLACING))
        self._shown.add_task(title, total=None)
        self._shown.start()


def _progress(*, endless: bool) -> Any:
    """A bar for what has an end, else a sign of life and the time that it has taken."""
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    from aosplan.show.text.terminal import speaks_unicode

    spinner = SpinnerColumn("dots" if speaks_unicode(sys.stderr) else "line")
    columns = (spinner, TimeElapsedColumn(), TextColumn("{task.description}", markup=False))
    return Progress(*columns * endless, console=Console(stderr=True), transient=True)


@contextlib.contextmanager
def drawn(progress: Progress) -> Iterator[Progress]:
    """A bar on the screen, which is left as it was, whenever Ctrl-C comes."""
    try:
        progress.start()
        yield progress
    finally:
        _stop(progress)


def _stop(progress: Progress) -> None:
    with contextlib.suppress(IndexError):  # interrupted while it began, it cannot stop
        progress.stop()
    progress.console.show_cursor()


@contextlib.contextmanager
def progress_bar(*, quiet: bool) -> Iterator[Bar]:
    """What a plan is at, on a terminal's stderr."""
    bar = Bar(live=not quiet and _is_live())
    try:
        yield bar
    finally:
        bar.close()


def _is_live() -> bool:
    """Whether stderr is a terminal that takes a line back."""
    return sys.stderr.isatty() and os.environ.get("TERM") not in ("dumb", "unknown")


@contextlib.contextmanager
def waiting_bar(title: str, *, quiet: bool) -> Iterator[Callable[[int, int], None] | None]:
    """A bar on a terminal's stderr while something takes long, or None where there is none."""
    if quiet or not _is_live():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with drawn(Progress(console=Console(stderr=True), transient=True)) as progress:
        task = progress.add_task(title, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)
