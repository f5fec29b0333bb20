"""Properties of the output stream (colours and characters), and text that is adapted to them.

Colours follow https://no-color.org, https://force-color.org and https://bixense.com/clicolors:
``NO_COLOR`` overrides ``FORCE_COLOR`` and ``CLICOLOR_FORCE``. These two override the detection of a
terminal.
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
    "σ": "sigma",
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
"""ASCII text that replaces the project's special characters."""

HANDLER = "aosplan-plain"
"""Name of the error handler that makes these replacements."""

POOR_TERMINALS = ("dumb", "linux", "unknown")
"""Types of terminals that show few characters, even if the locale has more."""

MOST_PATHS = 6
"""Largest number of written files that are named."""

STYLES = {"error": "1;31", "warning": "1;33", "hint": "36", "note": "36"}
"""ANSI colours of the first word of lines on stderr."""


def _plain(error: UnicodeError) -> tuple[str, int]:
    assert isinstance(error, UnicodeEncodeError)
    failed = error.object[error.start : error.end]
    return "".join(PLAIN.get(character, letter_of(character)) for character in failed), error.end


def letter_of(character: str) -> str:
    """A letter without its accents, or a question mark if there is no such letter."""
    from unicodedata import normalize

    first = normalize("NFD", character)[0]
    return first if first.isascii() else "?"


codecs.register_error(HANDLER, _plain)


def is_terminal(stream: TextIO) -> bool:
    """Whether a stream is a terminal.  A closed stream is not a terminal."""
    try:
        return stream.isatty()
    except (AttributeError, ValueError):
        return False


def is_forced() -> bool:
    """Whether the environment requests styles even if the output is not a terminal."""
    if os.environ.get("FORCE_COLOR"):
        return True
    return os.environ.get("CLICOLOR_FORCE", "0") not in ("", "0")


def is_styled(stream: TextIO) -> bool:
    """Whether a stream accepts escape sequences, such as those for bold text."""
    return is_forced() or (
        is_terminal(stream) and os.environ.get("TERM") not in ("dumb", "unknown")
    )


def is_coloured(stream: TextIO) -> bool:
    """Whether output on a stream is coloured."""
    if os.environ.get("NO_COLOR") or not is_styled(stream):
        return False
    return is_forced() or os.environ.get("CLICOLOR") != "0"


def speaks_unicode(stream: TextIO | None = None) -> bool:
    """Whether a stream, by default stdout, shows characters beyond ASCII."""
    stream = sys.stdout if stream is None else stream
    if is_terminal(stream) and os.environ.get("TERM") in POOR_TERMINALS:
        return False
    return (getattr(stream, "encoding", "") or "").lower().replace("-", "").startswith("utf")


def readable(text: str, stream: TextIO | None = None) -> str:
    """Text without control characters, in characters that a stream supports."""
    text = "".join(c if c.isprintable() else "?" for c in text)
    return text if speaks_unicode(stream) else text.encode("ascii", HANDLER).decode("ascii")


def print_notice(word: str, text: str) -> None:
    """Print one line on stderr: ``error:``, ``warning:``, ``hint:`` or ``note:``, and a text."""
    begin = f"\x1b[{STYLES[word]}m{word}:\x1b[0m" if is_coloured(sys.stderr) else f"{word}:"
    print(begin, readable(text, sys.stderr), file=sys.stderr)


def written_text(paths: Sequence[str]) -> str:
    """Text with the names of the files that were written, at most `MOST_PATHS` names."""
    more = f" and {len(paths) - MOST_PATHS} more" if len(paths) > MOST_PATHS else ""
    return f"Wrote {', '.join(paths[:MOST_PATHS])}{more}"


def flowed(parts: Sequence[str], width: int, gap: str = "   ") -> list[str]:
    """Put short texts side by side, in as few lines of a given width as possible."""
    lines: list[str] = []
    for part in parts:
        if lines and len(lines[-1]) + len(gap) + len(part) <= width:
            lines[-1] += gap + part
        else:
            lines.append(part)
    return lines
