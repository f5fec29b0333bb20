"""The directive ``{drawn}``: shows commands and the pictures that they draw.

    ```{drawn} forest.png
    :alt: What is to be seen, for those who do not see it
    :caption: What it says

    aosplan simulate --altitude 40 --picture forest.png
    ```

When the first picture of a page is needed, all blocks of the page run from top to bottom.  A
picture can therefore use files that earlier blocks have written.  If the output of a block differs
from the one on the page, the build reports an error.  The repository does not contain the pictures.
With ``:language: python``, the content is Python code that saves the picture.  With
``:alt: described``, the description is the text that the command prints, as `aosplan plot` does,
and the figure is drawn a second time for dark pages.  If the output is an ``.html`` file, the page
has a link to this file.
"""

import os
from pathlib import Path

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx import addnodes
from sphinx.util.docutils import SphinxDirective

from .examples import Failed, command_lines, follow, inside, run_line, same


class Drawn(SphinxDirective):
    """The directive ``{drawn}``."""

    required_arguments = 1
    has_content = True
    option_spec = {  # noqa: RUF012 (as docutils has it)
        "alt": directives.unchanged_required,
        "caption": directives.unchanged_required,
        "language": directives.unchanged_required,
        "width": directives.length_or_percentage_or_unitless,
    }

    def run(self):
        name = self.arguments[0]
        if "caption" not in self.options or ("alt" not in self.options and not is_page(name)):
            raise self.error("a drawn picture needs :alt: and :caption:")
        try:
            folder, printed = self._followed()
            if name not in printed or not (folder / name).is_file():
                raise self.error(f"no block of this page writes '{name}'")
            command = "\n".join(self.content).strip()
            shown = nodes.literal_block(
                command, command, language=self.options.get("language", "sh")
            )
            if is_page(name):
                return [shown, self._link(folder / name)]
            images = list(self._images(folder, name, printed[name]))
        except Failed as failed:
            raise self.error(f"an example of this page: {failed}") from failed
        texts, messages = self.parse_inline(self.options["caption"])
        figure = nodes.figure("", *images, nodes.caption("", "", *texts))
        # If an earlier block has written the picture, this block has no command.
        return [*([shown] if command else []), figure, *messages]

    def _followed(self):
        """The folder of the page's files, and the output of the commands that draw its pictures."""
        folder = Path(self.env.doctreedir).parent / "drawn" / self.env.docname
        if "drawn" not in self.env.temp_data:
            folder.mkdir(parents=True, exist_ok=True)
            _empty(folder)
            page = Path(self.env.doc2path(self.env.docname)).read_text("utf-8")
            found = follow(page, folder)
            for block, text in found:
                if block.kind == "text" and not same(block.body, text):
                    raise Failed(f"the page shows\n{block.body}where this is printed\n{text}")
            self.env.temp_data["drawn"] = {
                block.argument: text for block, text in found if block.kind == "drawn"
            }
        return folder, self.env.temp_data["drawn"]

    def _images(self, folder, name, printed):
        """The picture, or a light and a dark version of it."""
        if self.options["alt"] != "described":
            yield self._image(folder / name, self.options["alt"])
            return
        words = " ".join(
            line
            for line in printed.splitlines()
            if not line.startswith(("Wrote ", "warning: ", "hint: "))
        )
        yield self._image(folder / name, words, "only-light")
        (line,) = command_lines("\n".join(self.content))
        with inside(folder):
            run_line(f"{line.replace(name, f'dark-{name}')} --dark --quiet")
        yield self._image(folder / f"dark-{name}", words, "only-dark")

    def _image(self, picture, words, *classes):
        uri, width = self._from_here(picture), self.options.get("width")
        wide = {} if width is None else {"width": width}
        return nodes.image(uri=uri, alt=words, classes=[*classes], **wide)

    def _link(self, page):
        """A link to an HTML page that a command has written."""
        words = self.options["caption"]
        link = addnodes.download_reference("", words, reftarget=self._from_here(page))
        return nodes.paragraph("", "", link)

    def _from_here(self, path):
        return os.path.relpath(path, Path(self.env.doc2path(self.env.docname)).parent)


def is_page(name):
    """Whether the output is an HTML page instead of a picture."""
    return name.endswith(".html")


def _empty(folder):
    """Remove the files of an earlier build."""
    for path in sorted(folder.rglob("*"), reverse=True):
        if path.is_dir():
            path.rmdir()
        else:
            path.unlink()


def setup(app):
    app.add_directive("drawn", Drawn)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
