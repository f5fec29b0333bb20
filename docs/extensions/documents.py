"""Generates the reference of documents as Markdown, from the JSON Schemas that `aosplan schema`
prints.
"""

import re

from aosplan.cli.schema import DOCUMENTS, json_schema

UNITS = {
    "m": "m",
    "m2": "m²",
    "mm": "mm",
    "px": "px",
    "deg": "°",
    "s": "s",
    "min": "min",
    "mps": "m/s",
    "mps2": "m/s²",
}
"""Unit of a field, by the last part of its name."""


def unit(name):
    """The unit in a field's name, or an empty text."""
    return UNITS.get(name.rpartition("_")[2], "") if "_" in name else ""


def document(name):
    """Description and fields of one document."""
    schema = json_schema(name)
    return f"{_sentence(schema)}\n\n{fields(schema)}\n"


def parts():
    """The tables within documents, by name.  Each table is included once."""
    found = {}
    for name in DOCUMENTS:
        found |= json_schema(name).get("$defs", {})
    return "\n\n".join(
        f"({_anchor(title)})=\n### {_title(title)}\n\n{_sentence(found[title])}\n\n{fields(found[title])}"
        for title in sorted(found, key=_title)
    )


def fields(schema):
    """The fields of a schema as a table."""
    required = schema.get("required", ())
    rows = ["| name | kind | meaning |", "|---|---|---|"]
    for name, about in schema["properties"].items():
        facts = [_kind(about, name).removesuffix(" or null" if name not in required else "")]
        if name not in required:
            default = about.get("default")
            facts.append("optional" if default in (None, "") else f"default `{default}`")
        rows.append(f"| `{name}` | {', '.join(facts)} | {_cell(about.get('description', ''))} |")
    return "\n".join(rows)


def _kind(about, name):
    """Text about the allowed values."""
    if "$ref" in about:
        title = about["$ref"].rpartition("/")[2]
        return f"[{_title(title)}](#{_anchor(title)})"
    if "anyOf" in about:
        return " or ".join(dict.fromkeys(_kind(each, name) for each in about["anyOf"]))
    if "const" in about:
        return f"`{about['const']}`"
    if "enum" in about:
        return " or ".join(f"`{word}`" for word in about["enum"])
    if about.get("type") == "array":
        inner = about.get("prefixItems")
        if inner is not None:
            return f"pair of {_kind(inner[0], name)}s"
        return f"list of {_kind(about['items'], name)}"
    kind = {
        "number": "number",
        "integer": "whole number",
        "string": "text",
        "boolean": "true or false",
        "object": "table",
        "null": "null",
    }.get(about.get("type", ""), "any")
    measured = unit(name) if about.get("type") == "number" else ""
    return f"{kind} [{measured}]" if measured else kind


def _sentence(schema):
    """The description of a document as Markdown."""
    text = " ".join(schema.get("description", "").split())
    return re.sub(r"`mission\.FlightSettings`", "the waypoints", text)


def _title(name):
    """A part's name as text: "waypoint" for ``WaypointDocument``."""
    words = re.findall(r"[A-Z][a-z0-9]*", name.removesuffix("Document"))
    return " ".join(words).capitalize()


def _anchor(name):
    return "document-" + "-".join(_title(name).lower().split())


def _cell(text):
    """Text of a table cell.  The default of an option is written as a phrase instead of
    brackets.
    """
    return re.sub(r"\s*\[([^\[\]]+)\]$", r" Default: \1.", text).replace("|", "\\|")
