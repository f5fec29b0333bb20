"""The directive ``{chapters}``, which draws the diagram of the chapters when the page is built."""

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

from . import chapters


class Chapters(SphinxDirective):
    """The directive ``{chapters}``."""

    def run(self):
        for path in chapters.SOURCE.rglob("*.py"):
            self.env.note_dependency(str(path))
        return [nodes.raw("", chapters.svg(), format="html")]


def setup(app):
    app.add_directive("chapters", Chapters)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
