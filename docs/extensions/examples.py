"""Find and run the code blocks of pages, and compare the output with the output on the pages.

The blocks of a page run from top to bottom in a new folder:

- ``sh``: the lines are executed; `aosplan` runs in this process;
- ``text`` directly after ``sh``: the output of these lines.  A line ``...`` matches any number of
  lines;
- a block with a caption: the content of a file with this name.  Later blocks can use the file;
- ``python``: code that is executed.  All blocks of a page use the same namespace.  Comments show
  the output;
- ``drawn``: lines that are executed like those of ``sh``, or like those of ``python`` with
  ``:language: python``.

Blocks in other languages (``console``, ``toml`` without a caption) are not executed.

    python docs/extensions/examples.py [PAGE ...]      # prints the differences
    python docs/extensions/examples.py --write [PAGE]  # writes them, except where a line is ``...``
"""

import contextlib
import io
import os
import re
import runpy
import shlex
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

DOCS = Path(__file__).parents[1]
ROOT = DOCS.parent

FENCE = re.compile(
    r"^(?P<fence>```+)(?P<info>[^\n`]*)\n(?P<body>.*?)^(?P=fence)[ ]*$", re.MULTILINE | re.DOTALL
)
PREPARATION = ("python3 -m venv ", "pip install ", ".venv/bin/")
"""Beginnings of lines that are skipped, because the environment is already prepared."""


class Block(NamedTuple):
    """One code block: its language or directive, its argument, its options, and its lines."""

    kind: str
    argument: str
    options: dict[str, str]
    body: str
    start: int
    """Positions in the page at which the body begins and ends."""
    end: int


def pages():
    """Pages of the documentation, except those that are generated."""
    return sorted(path for path in DOCS.rglob("*.md") if "_build" not in path.parts)


def blocks(text):
    """The code blocks of a page, in order."""
    for match in FENCE.finditer(text):
        kind, _, argument = match["info"].strip().partition(" ")
        directive = kind.startswith("{")
        body, start = match["body"], match.start("body")
        options = {}
        if directive:
            kind = kind.strip("{}")
            lines = body.splitlines(keepends=True)
            while lines and (option := re.match(r":([\w-]+):\s*(.*)", lines[0])):
                options[option[1]] = option[2]
                start += len(lines.pop(0))
            while lines and not lines[0].strip():
                start += len(lines.pop(0))
            body = "".join(lines)
        if kind == "code-block":
            kind, argument = argument.strip(), ""
        yield Block(kind, argument.strip(), options, body, start, start + len(body))


def command_lines(body):
    """Lines of a shell block.  Continued lines are joined; comments and lines of preparation are
    left out.
    """
    for line in body.replace("\\\n", " ").splitlines():
        words = line.strip()
        if words and not words.startswith(("#", *PREPARATION)):
            yield words


class Failed(Exception):  # noqa: N818 (it is told, not raised through)
    """The result of a line differs from the result that the page shows."""


def run_line(line):
    """The output of a line of a shell block, including errors and warnings."""
    words = shlex.split(line, comments=True)
    target = None
    if len(words) > 2 and words[-2] == ">":
        target, words = words[-1], words[:-2]
    printed = _Captured()
    out = printed if target is None else _Captured()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(printed):
        status = _run(words)
        out.flush()
    if target is not None:
        Path(target).write_bytes(out.buffer.getvalue())
    text = printed.text()
    if status and not text.startswith("error:"):
        raise Failed(f"$ {line}\nstatus {status}\n{text}")
    return text


def _run(words):
    from aosplan.cli.app import run

    if words[0] == "aosplan":
        return run(words[1:])
    if words[0] == "python" and words[1].startswith("examples/"):
        before = sys.argv
        sys.argv = words[1:]
        try:
            runpy.run_path(str(ROOT / words[1]), run_name="__main__")
        finally:
            sys.argv = before
        return 0
    raise Failed(f"$ {shlex.join(words)}\nno way to run it: show it as ```console")


class _Captured(io.TextIOWrapper):
    """A text stream in memory.  JSON is written to its buffer."""

    def __init__(self):
        super().__init__(io.BytesIO(), encoding="utf-8", write_through=True)

    def text(self):
        self.flush()
        return self.buffer.getvalue().decode()


def same(shown, printed):
    """Whether the output on a page equals the printed output.  ``...`` matches any lines."""
    lines = _tidy(shown).splitlines()
    pattern = "".join(r"(?:.*\n)*" if line == "..." else re.escape(f"{line}\n") for line in lines)
    return re.fullmatch(pattern, f"{_tidy(printed)}\n") is not None


def _tidy(text):
    return "\n".join(line.rstrip() for line in text.strip("\n").splitlines())


def follow(text, folder):
    """Run the blocks of a page in a folder.  Yields each output block and picture with the printed
    output.

    Raises
    ------
    Failed
        If a line cannot be executed, or if a command fails and the page does not show its error.
    """
    printed, found, names = "", [], {}
    failed = None
    with inside(folder):
        for block in blocks(text):
            if block.kind != "text" and failed:
                raise Failed(failed)
            if block.kind == "drawn" and block.options.get("language") == "python":
                exec(compile(block.body, "page", "exec"), names)
                found.append((block, ""))
            elif block.kind in ("sh", "drawn"):
                outputs = [run_line(line) for line in command_lines(block.body)]
                printed = "".join(outputs)
                failed = next((o for o in outputs if o.startswith("error:")), None)
                if block.kind == "drawn":
                    found.append((block, printed))
            elif block.options.get("caption"):
                Path(block.options["caption"]).write_text(block.body, encoding="utf-8")
            elif block.kind == "text":
                found.append((block, printed))
                failed = None
            elif block.kind == "python":
                says = "".join(f"{line}\n" for line in re.findall(r"# → (.*)", block.body))
                out = io.StringIO()
                with contextlib.redirect_stdout(out):
                    exec(compile(block.body, "page", "exec"), names)
                if says and not same(says, out.getvalue()):
                    raise Failed(f"{block.body}prints\n{out.getvalue()}")
    if failed:
        raise Failed(failed)
    return found


@contextlib.contextmanager
def inside(folder):
    """Context manager that sets up the environment for pages: a folder, a width of the terminal,
    and no user settings.
    """
    before, known = Path.cwd(), dict(os.environ)
    for name in ("FORCE_COLOR", "CLICOLOR", "CLICOLOR_FORCE"):
        os.environ.pop(name, None)
    os.environ |= {"COLUMNS": "80", "TERM": "xterm", "NO_COLOR": "1"}
    os.environ |= {"AOSPLAN_CACHE": "0", "AOSPLAN_DEFAULTS": "none", "MPLBACKEND": "agg"}
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)
        os.environ.clear()
        os.environ |= known


def main(arguments):
    """Print the differences.  With ``--write``, write the printed output to the pages."""
    write = "--write" in arguments
    named = [Path(name) for name in arguments if not name.startswith("--")] or pages()
    different = 0
    for page in named:
        text = page.read_text(encoding="utf-8")
        with tempfile.TemporaryDirectory() as folder:
            found = follow(text, folder)
        for block, printed in reversed(found):
            if block.kind == "text" and not same(block.body, printed):
                different += 1
                print(f"{page}: shows\n{block.body}where this is printed\n{printed}")
                if "...\n" not in block.body:
                    text = f"{text[: block.start]}{_tidy(printed)}\n{text[block.end :]}"
        if write:
            page.write_text(text, encoding="utf-8")
    return 1 if different and not write else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
