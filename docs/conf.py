"""Settings of the documentation:  sphinx-build -W -n --keep-going -b html docs docs/_build/html

Everything is built offline: formulas are MathML, fonts are those of the reader, and figures are
drawn by the commands on the pages.
"""

import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import aosplan

project = "aosplan"
author = "the aosplan authors"
copyright = author  # noqa: A001 (Sphinx's name)
version = release = aosplan.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "extensions.accessible",
    "extensions.architecture",
    "extensions.mathml",
    "extensions.drawn",
    "extensions.generated",
]
exclude_patterns = ["_build", "extensions"]
nitpicky = True
# Types of other packages, whose documentation would have to be downloaded, and our own types in
# annotations that are not public.
nitpick_ignore_regex = [
    ("py:.*", r"(np|numpy|collections|decimal|fractions|typing|os|pathlib)\..*"),
    ("py:class", "Any|ArrayLike|Axes|Decimal|Fraction|NDArray|aosplan.camera.disparity.Slab"),
]
nitpick_ignore = {
    ("py:class", name)
    for path in Path(aosplan.__file__).parent.rglob("*.py")
    for name in re.findall(
        r"^ *(?:class )?([A-Z]\w+)(?: = |\(|:)", path.read_text("utf-8"), re.MULTILINE
    )
}

myst_enable_extensions = ["attrs_block", "deflist", "dollarmath"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
default_role = "code"
smartquotes = False  # --flags keep their two hyphens
python_display_short_literal_types = True
python_maximum_signature_line_length = 88
napoleon_google_docstring = False
napoleon_use_rtype = False

html_theme = "furo"
html_title = "aosplan"
html_static_path = ["_static"]
html_css_files = ["aosplan.css"]
html_copy_source = False
html_show_sphinx = False
html_theme_options = {"navigation_with_keys": True}
html_math_renderer = "mathml"


HOMES = {
    "FlightSettings": "mission.mission",
    "Limit": "messages",
    "Message": "messages",
    "Prediction": "models.model",
    "Row": "solver.tradeoff",
    "Solution": "solver.solution",
}
"""Modules that document names which others import for type checkers only."""


def _find_home(app, env, node, content):
    """Resolve the target of a bare name in an annotation."""
    home = HOMES.get(node.get("reftarget", ""))
    if home is None or node.get("refdomain") != "py":
        return None
    target = f"aosplan.{home}.{node['reftarget']}"
    return env.domains["py"].resolve_xref(
        env, node["refdoc"], app.builder, "class", target, node, content
    )


def _whole_sentences(app, what, name, obj, options, lines):
    """Start properties with an empty comment, because napoleon reads text before a colon as a type."""
    if what == "property":
        lines[:0] = ["..", ""]


def setup(app):
    app.connect("missing-reference", _find_home)
    app.connect("autodoc-process-docstring", _whole_sentences, priority=100)
