"""The chapters of ``src/aosplan``: a diagram of their imports, and a description of each chapter.

    ```{chapters}
    ```

The imports are read from the syntax trees of the source files.  Each chapter is one row above the
highest chapter that it imports.  All arrows of the diagram therefore point downwards.  The build
fails if imports between chapters form a cycle.
"""

import ast
from collections import Counter
from functools import cache
from graphlib import TopologicalSorter
from html import escape
from itertools import accumulate, pairwise
from pathlib import Path
from typing import NamedTuple

import aosplan

SOURCE = Path(aosplan.__file__).parent

BOX_PX = (124, 40)
ROW_PX, COLUMN_PX, POINT_PX, MARGIN_PX = 80, 150, 60, 12


class Arrow(NamedTuple):
    """An import of one chapter by another, with the number of places of this import."""

    upper: str
    lower: str
    imports: int
    is_implied: bool
    """Whether a path along other arrows leads to the same chapter."""


def chapters():
    """Names of the packages directly below ``aosplan``."""
    return sorted(path.parent.name for path in SOURCE.glob("*/__init__.py"))


def root_modules():
    """Names of the modules directly below ``aosplan`` that every chapter may import."""
    return sorted(path.stem for path in SOURCE.glob("*.py") if not path.stem.startswith("__"))


@cache
def arrows():
    """Imports between chapters, including those in functions and for type checkers."""
    names = set(chapters())
    found = Counter()
    for path in sorted(SOURCE.rglob("*.py")):
        upper = path.relative_to(SOURCE).parts[0]
        if upper in names:
            found.update((upper, lower) for lower in _imported(path) & names if lower != upper)
    below = {name: {lower for upper, lower in found if upper == name} for name in names}
    reached = {}
    for name in TopologicalSorter(below).static_order():
        reached[name] = below[name].union(*(reached[lower] for lower in below[name]))
    return [
        Arrow(upper, lower, found[upper, lower], any(lower in reached[x] for x in below[upper]))
        for upper, lower in sorted(found)
    ]


def _imported(path):
    """Chapters and root modules that a file imports."""
    modules = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            modules |= {f"{node.module}.{alias.name}" for alias in node.names}
    return {name.split(".")[1] for name in modules if name.startswith("aosplan.")}


def rows(found):
    """The chapters of each row, from top to bottom."""
    below = {name: {each.lower for each in found if each.upper == name} for name in chapters()}
    height = {}
    for name in TopologicalSorter(below).static_order():
        height[name] = max((height[lower] + 1 for lower in below[name]), default=0)
    return [
        sorted(name for name in height if height[name] == level)
        for level in range(max(height.values()), -1, -1)
    ]


def places(found):
    """Centres of the boxes in the diagram, and intermediate points of long arrows [px].

    The boxes of a row are ordered by the mean positions of their neighbours (Sugiyama, Tagawa and
    Toda, 1981).  An arrow over several rows has a point in each row between its ends, so that it
    does not cross a box.
    """
    table = [list(row) for row in rows(found)]
    level = {name: line for line, row in enumerate(table) for name in row}
    joined = []
    for each in found:
        if not each.is_implied:
            passed = [(each, line) for line in range(level[each.upper] + 1, level[each.lower])]
            for point in passed:
                table[point[1]].append(point)
            chain = [each.upper, *passed, each.lower]
            joined += pairwise(chain)
    near = {node: [] for row in table for node in row}
    for one, other in joined:
        near[one].append(other)
        near[other].append(one)
    for _ in range(8):
        for order in (table, table[::-1]):
            for row in order:
                x = {node: place for each in table for node, place in _spread(each)}
                row.sort(key=lambda node: sum(x[o] for o in near[node]) / max(1, len(near[node])))
    y0 = MARGIN_PX + 0.5 * BOX_PX[1]
    return {
        node: (x, y0 + ROW_PX * line) for line, row in enumerate(table) for node, x in _spread(row)
    }


def _spread(row):
    """Nodes of a row with their x coordinates [px], relative to the middle of the row."""
    widths = [COLUMN_PX if isinstance(node, str) else POINT_PX for node in row]
    ends = list(accumulate(widths))
    return [
        (node, end - 0.5 * (width + ends[-1]))
        for node, end, width in zip(row, ends, widths, strict=True)
    ]


def svg():
    """The diagram as SVG for an HTML page, with the colours of the theme."""
    found = arrows()
    place = places(found)
    left = min(x for x, _ in place.values()) - 0.5 * COLUMN_PX
    width = max(x for x, _ in place.values()) + 0.5 * COLUMN_PX - left
    bar = max(y for _, y in place.values()) + 56
    names = ", ".join(root_modules())
    parts = [
        f'<svg class="chapters" viewBox="{left:g} 0 {width:g} {bar + BOX_PX[1]:g}" role="img" '
        f'aria-label="{escape(described(found))}" xmlns="http://www.w3.org/2000/svg">',
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" '
        'markerHeight="7" orient="auto"><path d="M0 0L8 4L0 8z"/></marker></defs>',
    ]
    parts += [_curve(each, place) for each in found if not each.is_implied]
    parts += [_box(name, *place[name], *BOX_PX) for row in rows(found) for name in row]
    parts.append(_box(names, left + 0.5 * width, bar, width - 2 * MARGIN_PX, BOX_PX[1], "root"))
    return "\n".join([*parts, "</svg>"])


def _curve(arrow, place):
    """An arrow as a smooth line from the lower edge of one box to the upper edge of another box."""
    (x0, y0), *points, (x1, y1) = (
        place[arrow.upper],
        *(xy for node, xy in place.items() if node[0] == arrow),
        place[arrow.lower],
    )
    line, x, y = f"M{x0:g} {y0 + 0.5 * BOX_PX[1]:g}", x0, y0 + 0.5 * BOX_PX[1]
    for to_x, to_y in [*points, (x1, y1 - 0.5 * BOX_PX[1])]:
        middle = 0.5 * (y + to_y)
        line += f"C{x:g} {middle:g} {to_x:g} {middle:g} {to_x:g} {to_y:g}"
        x, y = to_x, to_y
    title = f"{arrow.upper} imports {arrow.lower} in {arrow.imports} places"
    return f'<path marker-end="url(#tip)" d="{line}"><title>{title}</title></path>'


def _box(text, x, y, width, height, kind="box"):
    return (
        f'<rect class="{kind}" x="{x - 0.5 * width:g}" y="{y - 0.5 * height:g}" '
        f'width="{width:g}" height="{height:g}" rx="6"/>'
        f'<text class="{kind}" x="{x:g}" y="{y + 5:g}" text-anchor="middle">{escape(text)}</text>'
    )


def described(found):
    """A description of the diagram as text."""
    table = "; ".join(", ".join(row) for row in rows(found))
    direct = ", ".join(f"{each.upper} to {each.lower}" for each in found if not each.is_implied)
    return (
        f"The chapters of aosplan, from the top row to the bottom one: {table}. Arrows point down, "
        f"from a chapter to one that it imports: {direct}."
    )


def owned():
    """Descriptions of each chapter as Markdown, from the docstrings of its package and modules."""
    parts = []
    for row in rows(arrows()):
        for name in row:
            parts += [f"### {name}", "", _first(SOURCE / name / "__init__.py"), ""]
            parts += _table(sorted((SOURCE / name).rglob("*.py")))
    parts += ["### The root", "", "Modules that every chapter may import.", ""]
    parts += _table([SOURCE / f"{name}.py" for name in root_modules()])
    return "\n".join(parts)


def _table(files):
    return [
        "| file | contents |",
        "|---|---|",
        *(
            f"| `{path.relative_to(SOURCE).as_posix()}` | {_first(path)} |"
            for path in files
            if path.name != "__init__.py"
        ),
        "",
    ]


def _first(path):
    """The first paragraph of a module's docstring."""
    text = ast.get_docstring(ast.parse(path.read_text("utf-8"))) or ""
    line = " ".join(text.split("\n\n")[0].split())
    return line.replace("``", "`").replace("|", "\\|")
