"""Pictures that a page's own commands make, and the commands with them.

    ```{drawn} forest.png
    :alt: What is to be seen, for those who do not see it
    :caption: What it says

    aosplan simulate --altitude 40 --picture forest.png
    ```

The blocks of the page run from top to bottom when its first picture is needed, so that a
picture may take what earlier blocks wrote; nothing drawn is kept in the repository.
"""

import os
from pathlib import Path

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.util.docutils import SphinxDirective

from .examples import Failed, follow


class Drawn(SphinxDirective):
    """The directive."""

    required_arguments = 1
    has_content = True
    option_spec = {  # noqa: RUF012 (as docutils has it)
        "alt": directives.unchanged_required,
        "caption": directives.unchanged_required,
    }

    def run(self):
        if "alt" not in self.options or "caption" not in self.options:
            raise self.error("a drawn picture needs :alt: and :caption:")
        folder = Path(self.env.doctreedir).parent / "drawn" / self.env.docname
        if "drawn" not in self.env.temp_data:
            self.env.temp_data["drawn"] = True
            folder.mkdir(parents=True, exist_ok=True)
            for left in folder.iterdir():
                if left.is_file():
                    left.unlink()
            try:
                follow(Path(self.env.doc2path(self.env.docname)).read_text("utf-8"), folder)
            except Failed as failed:
                raise self.error(f"an example of this page: {failed}") from failed
        picture = folder / self.arguments[0]
        if not picture.is_file():
            raise self.error(f"no block of this page writes '{picture.name}'")
        page = Path(self.env.doc2path(self.env.docname)).parent
        image = nodes.image(uri=os.path.relpath(picture, page), alt=self.options["alt"])
        texts, messages = self.parse_inline(self.options["caption"])
        figure = nodes.figure("", image, nodes.caption("", "", *texts))
        command = "\n".join(self.content).strip()
        shown = [nodes.literal_block(command, command, language="sh")] if command else []
        return [*shown, figure, *messages]


def setup(app):
    app.add_directive("drawn", Drawn)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
