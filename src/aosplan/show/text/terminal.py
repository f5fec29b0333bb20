"""What the output is written to: its colours, its characters, and text that suits them.

Colours follow https://no-color.org, https://force-color.org and https://bixense.com/clicolors:
``NO_COLOR`` beats ``FORCE_COLOR`` and ``CLICOLOR_FORCE``, which beat what the terminal is.
"""

from __future__ import annotations

import codecs
import os
import sys
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from collections.abc import Sequence

PLAIN = {
    "\u0302": "^",
    "\u0304": "",
    "≥": ">=",
    "≤": "<=",
    "≈": "~",
    "±": "+-",
    "×": "x",
    "·": "*",
    "°": " deg",
    "√": "sqrt",
    "∞": "inf",
    "²": "2",
    "³": "3",
    "µ": "u",
    "μ": "u",
    "Δ": "d",
    "Σ": "sum ",
    "…": "...",
    "–": "-",
    "—": "-",
    "−": "-",
    "‘": "'",
    "’": "'",
    "“": '"',
    "”": '"',
    "→": "->",
    "◀": "<",
    "▶": ">",
    "■": "#",
    "●": "o",
    "█": "#",
    "\xa0": " ",
    "\ufffd": "?",
}
"""What is written for the project's own characters where there is nothing but ASCII."""

HANDLER = "aosplan-plain"
"""Name of the error handler that writes them."""

POOR_TERMINALS = ("dumb", "linux", "unknown")
"""Terminals with few characters, whatever the locale says."""

MOST_PATHS = 6
"""Files that are named of those that were written."""

STYLES = {"error": "1;31", "warning": "1;33", "hint": "36", "note": "36"}
"""ANSI colours of the words that lines on stderr begin with."""


def _plain(error: UnicodeError) -> tuple[str, int]:
    assert isinstance(error, UnicodeEncodeError)
    failed = error.object[error.start : error.end]
    return "".join(PLAIN.get(character, letter_of(character)) for character in failed), error.end


def letter_of(character: str) -> str:
    """A letter without its accents, which names of people have; else a question mark."""
    from unicodedata import normalize

    first = normalize("NFD", character)[0]
    return first if first.isascii() else "?"


codecs.register_error(HANDLER, _plain)


def is_terminal(stream: TextIO) -> bool:
    """Whether a stream is a terminal; a closed one is none."""
    try:
        return stream.isatty()
    except (AttributeError, ValueError):
        return False


def is_forced() -> bool:
    """Whether styles are wanted even where there is no terminal."""
    if os.environ.get("FORCE_COLOR"):
        return True
    return os.environ.get("CLICOLOR_FORCE", "0") not in ("", "0")


def is_styled(stream: TextIO) -> bool:
    """Whether a stream takes escape sequences at all, such as bold type."""
    return is_forced() or (
        is_terminal(stream) and os.environ.get("TERM") not in ("dumb", "unknown")
    )


def is_coloured(stream: TextIO) -> bool:
    """Whether colours are wanted on a stream."""
    if os.environ.get("NO_COLOR") or not is_styled(stream):
        return False
    return is_forced() or os.environ.get("CLICOLOR") != "0"


def speaks_unicode(stream: TextIO | None = None) -> bool:
    """Whether a stream, by default stdout, shows more than ASCII."""
    stream = sys.stdout if stream is None else stream
    if is_terminal(stream) and os.environ.get("TERM") in POOR_TERMINALS:
        return False
    return (getattr(stream, "encoding", "") or "").lower().replace("-", "").startswith("utf")


def readable(text: str, stream: TextIO | None = None) -> str:
    """Text without control characters, which a file may hold, in characters that a stream shows."""
    text = "".join(c if c.isprintable() else "?" for c in text)
    return text if speaks_unicode(stream) else text.encode("ascii", HANDLER).decode("ascii")


def print_notice(word: str, text: str) -> None:
    """One line on stderr: ``error:``, ``warning:``, ``hint:`` or ``note:``, and what it is."""
    begin = f"\x1b[{STYLES[word]}m{word}:\x1b[0m" if is_coloured(sys.stderr) else f"{word}:"
    print(begin, readable(text, sys.stderr), file=sys.stderr)


def wrote(paths: Sequence[str]) -> str:
    """What was written, the first few by name."""
    more = f" and {len(paths) - MOST_PATHS} more" if len(paths) > MOST_PATHS else ""
    return f"Wrote {', '.join(paths[:MOST_PATHS])}{more}"


def flowed(parts: Sequence[str], width: int, gap: str = "   ") -> list[str]:
    """Short texts beside each other, in as many lines as a width takes."""
    lines: list[str] = []
    for part in parts:
        if lines and len(lines[-1]) + len(gap) + len(part) <= width:
            lines[-1] += gap + part
        else:
            lines.append(part)
    return lines
