"""The directive ``{generated}``, which inserts text that is generated from the program.

    ```{generated} command plan
    ```

The functions in `TEXTS` return Markdown.  `tests/docs` checks it without Sphinx.
"""

from sphinx.util.docutils import SphinxDirective

from . import chapters, commands, documents, presets, results, surroundings

TEXTS = {
    "chapters": chapters.owned,
    "command": commands.command,
    "commands": commands.overview,
    "program": commands.program,
    "document": documents.document,
    "parts": documents.parts,
    "cameras": presets.cameras,
    "drones": presets.drones,
    "scenes": presets.scenes,
    "formats": presets.formats,
    "sources": presets.sources,
    "payloads": presets.payloads,
    "flown": presets.flown,
    "results": results.results,
    "stress": results.stress,
    "statuses": surroundings.statuses,
    "warnings": surroundings.warnings,
}


class Generated(SphinxDirective):
    """The directive ``{generated}``."""

    required_arguments = 1
    optional_arguments = 3

    def run(self):
        name, *arguments = self.arguments
        return self.parse_text_to_nodes(TEXTS[name](*arguments), allow_section_headings=True)


def setup(app):
    app.add_directive("generated", Generated)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
