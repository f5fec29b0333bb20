"""Changes to the output of Sphinx and its theme, for users of keyboards and screen readers."""

import re

PARAMETERS = re.compile(r"<dl>\n(?:<dd>.*</dd>\n)+</dl>")
"""Matches a signature over several lines.  Sphinx writes it as a list of definitions without terms,
which is not valid HTML.
"""


def _mend(app, pagename, templatename, context, doctree):
    """Make scrolling blocks and tables reachable by keyboard, and give sidebar captions a level."""
    body, tree = context.get("body"), context.get("furo_navigation_tree")
    if body:
        body = body.replace("<pre>", '<pre tabindex="0">')
        body = body.replace('<div class="table-wrapper', '<div tabindex="0" class="table-wrapper')
        context["body"] = PARAMETERS.sub(
            lambda found: re.sub("<(dl|dd)>", r'<\1 role="none">', found[0]), body
        )
    if tree:
        context["furo_navigation_tree"] = tree.replace(
            'role="heading"', 'role="heading" aria-level="2"'
        )


def setup(app):
    app.connect("html-page-context", _mend, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
