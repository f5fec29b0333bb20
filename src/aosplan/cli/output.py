"""Output functions that several commands use: JSON, warnings, files, and progress bars."""

from __future__ import annotations

import contextlib
import os
import sys
from typing import TYPE_CHECKING, Any

from aosplan.errors import RequestError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from rich.progress import Progress

    from aosplan.grid.patterns import AnyPattern
    from aosplan.messages import Message
    from aosplan.mission.format import Format
    from aosplan.mission.mission import Mission
    from aosplan.solver.problem import Problem


def print_json(document: Any) -> None:
    """Print one JSON document on stdout."""
    import json

    try:
        text = json.dumps(document, ensure_ascii=False, allow_nan=False, indent=1)
    except ValueError:
        raise RequestError(
            "a result of the plan is too large for a number in JSON", "an input value is too large"
        ) from None
    sys.stdout.buffer.write(text.encode() + b"\n")
    sys.stdout.buffer.flush()


def print_warnings(warnings: Iterable[Message], *, quiet: bool = False) -> None:
    """Print warnings on stderr, one per line."""
    for warning in () if quiet else warnings:
        from aosplan.show.text.terminal import print_notice

        print_notice("warning", warning.message)


def chosen_outputs(
    outputs: Sequence[str], name: str | None, *, force: bool
) -> list[tuple[Format, str]]:
    """Formats and paths of the outputs, which are checked here before any work is done.

    Raises
    ------
    RequestError
        If a format is unknown, if a path cannot be written, or if two outputs are the same file.
    """
    if name is not None and len(outputs) != 1:
        raise RequestError(
            f"--format {name} needs a single --out", "for several outputs, write --out NAME:PATH"
        )
    if not outputs:
        return []
    from aosplan.files import check_output
    from aosplan.mission.export import choose_format

    chosen = [choose_format(path, name) for path in outputs]
    for _, path in chosen:
        check_output(path, force=force)
    check_distinct([path for _, path in chosen])
    return chosen


def check_distinct(paths: Sequence[str]) -> None:
    """Refuse a file that is given twice, even if its two paths differ."""
    places = [os.path.realpath(path) for path in paths]
    for path, place in zip(paths, places, strict=True):
        if places.count(place) > 1:
            raise RequestError(f"output '{path}' is given twice")


def writes_stdout(paths: Iterable[str | None], *, as_json: bool) -> bool:
    """Whether one of the outputs is stdout.  In this case, no other text may be printed on stdout.

    Raises
    ------
    RequestError
        If ``--json`` is also given, because it prints on stdout too.
    """
    found = "-" in paths
    if found and as_json:
        raise RequestError("--json and --out - both write to stdout", "give one of them")
    return found


def write_outputs(
    missions: Callable[[], Iterable[Mission]],
    chosen: list[tuple[Format, str]],
    pages: Mapping[str, bytes] | None = None,
    *,
    force: bool,
    quiet: bool = False,
) -> list[str]:
    """Write missions and pages to all outputs or to none.  Returns the paths of the written files.

    If an output needs several files, the files are numbered, and a hint is printed.

    Raises
    ------
    RequestError
        If a mission exceeds the limits of a format, or if two outputs would be written to the same
        file.
    """
    if not chosen and not pages:
        return []
    from aosplan.files import write_all
    from aosplan.mission.export import mission_files, notes

    contents = dict(pages or {})
    hints = []
    flown = list(missions()) if chosen else []
    for form, path in chosen:
        needed = mission_files(flown, form, path)
        for name in needed:
            if name in contents:
                raise RequestError(
                    f"two outputs have the name '{name}'", "give them different names"
                )
        contents |= needed
        hints += notes(flown, form)
        if len(needed) > 1:
            first, *_, last = needed
            hints.append(f"{form.title} needs {len(needed)} files here: {first} to {last}")
            if len(needed) > len(flown):
                hints.append(
                    "one flight needs several of these files; the drone returns home after "
                    "each file, and the planned time does not include these returns"
                )
            hints += _leftovers(path, len(needed))
    write_all(contents, force=force)
    for hint in () if quiet else hints:
        from aosplan.show.text.terminal import print_notice

        print_notice("hint", hint)
    return list(contents)


def _leftovers(path: str, count: int) -> list[str]:
    """Hint about numbered files that remain from an earlier, longer mission with the same name."""
    stem, suffix = os.path.splitext(path)
    after = f"{stem}-{count + 1}{suffix}"
    return [f"{after} is not part of this mission" for _ in range(os.path.lexists(after))]


PATIENCE_S = 1.0
"""Time from the start of a search after which the terminal shows its candidates."""


READING, PLACING = "reading points", "placing points"
"""Titles of steps whose total amount of work is known."""


class PlanProgress:
    """Progress of a plan on stderr: the number of points read, then the candidates of a search.

    If stderr is not a terminal, or the plan is fast, nothing is shown and rich is not imported.
    """

    def __init__(self, *, live: bool) -> None:
        self._live = live
        self._begun_s: float | None = None
        self._shown: Any = None
        self._title = ""

    def __call__(self, done: int, total: int) -> None:
        """Show the number of points that have been read, then the number that have been sorted into
        voxels, and the names of the other steps.
        """
        if 2 * done < total:
            title = READING
        elif 2 * done == total:
            title = "finding the ground"
        elif done < total:
            title = PLACING
        else:
            title = "measuring the slices"
        self.show_step(title)
        if self._live and title in (READING, PLACING):
            self._shown.update(self._shown.task_ids[0], completed=done, total=total)

    def show_step(self, title: str) -> None:
        """Show the current step."""
        if self._live:
            self._show(title)

    def on_trial(self, problem: Problem, pattern: AnyPattern, baseline_m: float) -> None:
        """Show the candidate of a search, if the search takes longer than `PATIENCE_S`."""
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
        """Remove the progress from the terminal."""
        self._live = False
        if self._shown is not None:
            _stop(self._shown)

    def _show(self, title: str) -> None:
        """Show the current step instead of the previous step."""
        if title == self._title:
            return
        if self._shown is not None:
            self._shown.stop()
        self._title, self._shown = title, _progress(endless=title not in (READING, PLACING))
        self._shown.add_task(title, total=None)
        self._shown.start()


def _progress(*, endless: bool) -> Any:
    """A progress bar if the total amount of work is known, otherwise a spinner with the elapsed
    time.
    """
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    from aosplan.show.text.terminal import speaks_unicode

    spinner = SpinnerColumn("dots" if speaks_unicode(sys.stderr) else "line")
    columns = (spinner, TimeElapsedColumn(), TextColumn("{task.description}", markup=False))
    return Progress(*columns * endless, console=Console(stderr=True), transient=True)


@contextlib.contextmanager
def shown_live(progress: Progress) -> Iterator[Progress]:
    """Context manager that shows a progress bar, and restores the screen even after Ctrl-C."""
    try:
        progress.start()
        yield progress
    finally:
        _stop(progress)


def _stop(progress: Progress) -> None:
    # If a bar was interrupted while it started, stopping it raises IndexError.
    with contextlib.suppress(IndexError):
        progress.stop()
    progress.console.show_cursor()


@contextlib.contextmanager
def progress_bar(*, quiet: bool) -> Iterator[PlanProgress]:
    """Context manager for the progress of a plan on stderr."""
    bar = PlanProgress(live=not quiet and _is_live())
    try:
        yield bar
    finally:
        bar.close()


def _is_live() -> bool:
    """Whether stderr is a terminal on which a line can be erased."""
    return sys.stderr.isatty() and os.environ.get("TERM") not in ("dumb", "unknown")


@contextlib.contextmanager
def waiting_bar(title: str, *, quiet: bool) -> Iterator[Callable[[int, int], None] | None]:
    """A progress bar on stderr for work that takes long; None if stderr is not a terminal."""
    if quiet or not _is_live():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with shown_live(Progress(console=Console(stderr=True), transient=True)) as progress:
        task = progress.add_task(title, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)
