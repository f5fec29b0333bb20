"""Display of results as a few lines of text, and as a table in notebooks."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from aosplan.messages import Message


class Summarized:
    """A result that is displayed as a headline and a few named values.

    ``repr`` returns text; notebooks display a table.
    """

    __slots__ = ()

    def summary(self) -> tuple[str, dict[str, str]]:
        """The result as text: a headline and named values."""
        raise NotImplementedError

    def __repr__(self) -> str:
        from unicodedata import combining

        headline, facts = self.summary()
        # A combining hat has no width of its own.
        widths = {name: len(name) - sum(map(bool, map(combining, name))) for name in facts}
        widest = max(widths.values(), default=0)
        return "\n".join(
            [
                headline,
                *(
                    f"  {name}{' ' * (widest + 2 - widths[name])}{text}"
                    for name, text in facts.items()
                ),
            ]
        )

    __str__ = __repr__

    def _repr_html_(self) -> str:
        """A headline and a table, which notebooks display."""
        from html import escape

        headline, facts = self.summary()
        rows = "".join(
            f'<tr><th scope="row" style="text-align:left">{escape(name)}</th>'
            f'<td style="text-align:left">{escape(text)}</td></tr>'
            for name, text in facts.items()
        )
        return f"<table><caption>{escape(headline)}</caption><tbody>{rows}</tbody></table>"


def warnings_text(warnings: Iterable[Message]) -> dict[str, str]:
    """The row of a summary with the codes of all warnings; empty if there are no warnings."""
    codes = list(dict.fromkeys(warning.code for warning in warnings))
    return {"Warnings": ", ".join(codes)} if codes else {}


def columns_of(documents: Sequence[dict[str, object]]) -> dict[str, list[object]]:
    """Convert rows to columns.  All rows must have the same names."""
    if not documents:
        return {}
    return {name: [document[name] for document in documents] for name in documents[0]}
