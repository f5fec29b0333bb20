"""Text for XML: whatever a name holds, it stays text."""

from __future__ import annotations

import html
import re

LONGEST = 200
"""Letters of a name that are shown."""

_FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def xml_text(text: str) -> str:
    """Text as XML 1.0 takes it: escaped, shortened, without characters that it forbids."""
    return escaped(text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…")


def escaped(text: str) -> str:
    """The whole text as XML 1.0 takes it: escaped, without characters that it forbids."""
    return html.escape(_FORBIDDEN.sub("\ufffd", text))
