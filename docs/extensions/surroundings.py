"""Generates tables of exit statuses and warnings as Markdown, from the source of the program."""

import ast
from pathlib import Path
from re import fullmatch

import aosplan
from aosplan import errors

SOURCE = Path(aosplan.__file__).parent

ELSEWHERE = {"heading": "at --heading …, V̂ of this grid would be higher"}
"""Texts of warnings that are not written beside their codes in the source."""


def statuses():
    """The errors that aosplan raises, each with its exit status."""
    rows = ["| error | status | meaning |", "|---|---|---|"]
    for name, each in vars(errors).items():
        if isinstance(each, type) and issubclass(each, errors.AosplanError):
            meaning = (each.__doc__ or "").split("\n\n")[0].strip()
            home = "aosplan" if name in aosplan.__all__ else "aosplan.errors"
            rows.append(f"| {{py:exc}}`~{home}.{name}` | {each.exit_status} | {meaning} |")
    return "\n".join(rows)


def warnings():
    """All warnings by code, with their texts.  An ellipsis replaces each value."""
    said = dict(ELSEWHERE)
    for path in sorted(SOURCE.rglob("*.py")):
        for code, text in _warnings_in(ast.parse(path.read_text("utf-8"))):
            said.setdefault(code, text)
    rows = ["| code | message |", "|---|---|"]
    rows += [f"| `{code}` | {said[code]} |" for code in sorted(said)]
    return "\n".join(rows)


def _warnings_in(tree):
    """Pairs of a code and a sentence in a source file."""
    sentences = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign):
            sentences.setdefault(getattr(node.targets[0], "id", ""), {})[node.lineno] = node.value
    for node in ast.walk(tree):
        is_message = isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Message"
        pair = node.args if is_message else getattr(node, "elts", ())
        if len(pair) != 2 or not isinstance(pair[0], ast.Constant):
            continue
        code, said = pair
        if isinstance(said, ast.Name):
            before = {
                line: each
                for line, each in sentences.get(said.id, {}).items()
                if line < node.lineno
            }
            said = before[max(before)] if before else said
        text = _text(said)
        is_code = isinstance(code.value, str) and fullmatch(r"[a-z]+(_\w+)*", code.value)
        if is_code and text and (is_message or text.count(" ") > 3):
            yield code.value, text


def _text(node):
    """The text of a string or of an f-string."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value.replace("|", "\\|")
    if isinstance(node, ast.JoinedStr):
        return "".join(_text(part) or "…" for part in node.values)
    if isinstance(node, ast.BinOp):
        return (_text(node.left) or "…") + (_text(node.right) or "…")
    return ""
