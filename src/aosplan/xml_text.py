"""Text for XML. Special characters are escaped, so a name is never read as markup."""

from __future__ import annotations

import html
import re

LONGEST = 200
"""Greatest number of characters of a name that are shown."""

_FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def xml_text(text: str) -> str:
    """Text for XML 1.0: escaped, shortened, and without the characters that XML forbids."""
    return escaped(text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…")


def escaped(text: str) -> str:
    """Text of any length for XML 1.0: escaped and without the characters that XML forbids."""
    return html.escape(_FORBIDDEN.sub("\ufffd", text))
