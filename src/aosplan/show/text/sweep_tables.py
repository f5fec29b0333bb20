"""Results of a sweep as tables of at most 80 columns."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING, Any

from rich.table import Table

from aosplan.planning.options import BY_NAME
from aosplan.show.text.tables import one_line, screen_width, show
from aosplan.units import percent

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

STATUSES = {"ok": "met", "infeasible": "infeasible", "invalid": "invalid"}

MOST_REASONS = 10
"""Largest number of kinds of reasons that are shown.  The JSON document lists more kinds."""


def print_summary(document: dict[str, Any]) -> None:
    """Print counts, results with their extremes, and the values of each input."""
    where = document["where"]
    kept = "" if where is None else f"; {document['rows']} kept by --where {where}"
    show(one_line(f"{document['scenarios']} scenarios{kept}"))
    _print(
        ("", "scenarios", "share"),
        (
            (STATUSES[status], str(count), _percent(count / document["scenarios"]))
            for status, count in document["statuses"].items()
        ),
    )
    _print_reasons(document)
    rows: dict[int, Mapping[str, Any]] = {}
    _print_results(document["results"], rows)
    for entry in document["inputs"]:
        _print_input(entry, document, where=where is not None)
    varying = [entry["name"] for entry in document["inputs"]]
    show("")
    for row, request in sorted(rows.items()):
        show(one_line(f"row {row}: {_named(request, varying)}"))
    if document["fixed"]:
        show(one_line(f"every row: {_named(document['fixed'], document['fixed'])}"))
    if {"samples", "baseline"} <= {*varying, *document["fixed"]}:
        show(
            one_line(
                "If both samples and baseline are given, every row counts as feasible, even "
                "if it misses the target."
            )
        )


def _print_reasons(document: dict[str, Any]) -> None:
    reasons = document["reasons"]
    if not reasons:
        return
    shown = reasons[:MOST_REASONS]
    left = sum(each["count"] for each in reasons[MOST_REASONS:]) + document["other_reasons"]
    lines = [
        (str(each["count"]), str(each["first"]["row"]), each["first"]["reason"]) for each in shown
    ]
    show("")
    _print(
        ("scenarios", "first row", "reason in this row"),
        [*lines, *([(str(left), "", "other reasons")] if left else [])],
        left_from=2,
    )


def _print_results(results: Mapping[str, Any], rows: dict[int, Mapping[str, Any]]) -> None:
    """Print the extremes, and collect the rows that have them."""

    def line(name: str, found: Mapping[str, Any]) -> list[str]:
        cells = [name]
        for extreme in (found["minimum"], found["maximum"]):
            if extreme is None:
                cells += ["-", ""]
                continue
            rows[extreme["row"]] = extreme["request"]
            cells += [_figure(extreme["value"]), str(extreme["row"])]
        return [*cells[:3], _figure(found["mean"]), *cells[3:]]

    show("")
    _print(
        ("result", "min", "row", "mean", "max", "row"),
        [line(name, found) for name, found in results.items()],
    )


def _print_input(entry: Mapping[str, Any], document: Mapping[str, Any], *, where: bool) -> None:
    objective = document["objective"]["column"]

    def line(group: Mapping[str, Any]) -> list[str]:
        cells = [_label(group), str(group["scenarios"])]
        cells += [str(group["rows"])] if where else []
        share = group["met_share"]
        return [
            *cells,
            "-" if share is None else _percent(share),
            _figure(group["best"]),
            _figure(group["approximate_median"]),
        ]

    show("")
    _print(
        (
            entry["name"],
            "scenarios",
            *(("kept",) if where else ()),
            "met",
            f"best {objective}",
            "median (approx.)",
        ),
        [line(group) for group in entry["groups"]],
    )


def _label(group: Mapping[str, Any]) -> str:
    if "first" in group:
        return f"{_figure(group['first'])} to {_figure(group['last'])}"
    if group.get("others"):
        return "others"
    value = group["value"]
    if value is None:
        return "(left out)"
    return f"{value:.6g}" if isinstance(value, float) else _text(value)


def print_verification(document: Mapping[str, Any]) -> None:
    """Print the simulated rows, and whether the largest of their differences can be explained by
    chance.
    """
    worst, comparisons = document["worst"], document["comparisons"]
    simulated = document["simulated"]
    rows = "row" if simulated == 1 else "rows"
    show("", one_line(f"{simulated} {rows} simulated, seed {document['seed']}"))
    lines = []
    for row in document["rows"]:
        if row["reason"] is not None:
            continue
        found = max(row["comparisons"], key=lambda each: -each["chance"], default=None)
        lines.append([str(row["row"]), str(row["samples"]), *_compared(row, found)])
    header = ("row", "N", "", "predicted", "simulated", "difference", "std. errors")
    if lines:
        _print(header, lines)
    for row in document["rows"]:
        if row["reason"] is not None:
            show(one_line(f"row {row['row']} is not simulated: {row['reason']}"))
    if document["strata_left_out"]:
        show(
            one_line(
                "Values that are not simulated, because the sample has too few rows: "
                f"{', '.join(document['strata_left_out'])}"
            )
        )
    if worst is None:
        show(one_line("No row could be compared with its prediction."))
        return
    show("", *map(one_line, _verdict(document, worst, comparisons)))
    request = next(row for row in document["rows"] if row["row"] == worst["row"])
    again = [
        *options(request["request"]),
        f"--view {request['view']}",
        f"--seed {request['seed']}",
        f"--precision {document['precision']:g}",
    ]
    # Long commands are divided by backslashes. Unlike wrapped lines, they can be copied.
    show("Again:", *map(one_line, _folded(["aosplan simulate", *again])))


def _verdict(
    document: Mapping[str, Any], worst: Mapping[str, Any], comparisons: int
) -> Iterable[str]:
    yield (
        "Predicted and simulated agree."
        if document["agree"]
        else "Predicted and simulated disagree:"
    )
    name = SYMBOLS[worst["quantity"]]
    beyond = "infinitely many" if worst["beyond"] is None else f"{worst['beyond']:.2f}"
    yield (
        f"Least probable of {comparisons} comparisons: {name} of row {worst['row']}, with a "
        f"difference of {abs(worst['difference']):.4f}"
    )
    yield (
        f"  The difference is {beyond} standard errors larger than the tolerance; chance alone "
        f"gives such a comparison with probability {worst['chance_of_worst']:.2g}"
    )
    yield (
        f"  By chance, {document['expected_worst']:.2f} standard errors are expected, and "
        f"{document['critical']:.2f} are exceeded with probability {document['level']:g} (Šidák)"
    )
    largest = document["largest_difference"]
    yield (
        f"Largest difference: {SYMBOLS[largest['quantity']]} of row {largest['row']}, "
        f"{abs(largest['difference']):.4f}"
    )


SYMBOLS = {"density": "p", "expected": "V", "normalized": "V̂"}


def _compared(row: Mapping[str, Any], found: Mapping[str, Any] | None) -> list[str]:
    """Table cells of a row: the comparison whose difference is least probable."""
    if found is None:
        return ["", "-", "-", "-", "-"]
    name, errors = found["quantity"], found["standard_errors"]
    return [
        SYMBOLS[name],
        f"{row['predicted'][name]:.4f}",
        f"{row['simulated'][name]:.4f}",
        f"{found['difference']:+.4f}",
        "-" if errors is None else f"{errors:.2f}",
    ]


def options(request: Mapping[str, Any]) -> list[str]:
    """The options of a request as command-line arguments."""
    words = []
    for name, value in request.items():
        option = BY_NAME[name]
        if option.kind == "flag":
            words += [option.flag] if value else []
        else:
            words.append(f"{option.flag} {shlex.quote(_text(value))}")
    return words


def _folded(words: Iterable[str]) -> list[str]:
    """A command in lines that fit the screen.  Each line except the last ends with a backslash."""
    lines = [""]
    for word in words:
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and len(longer) > screen_width() - 6:
            lines.append(word)
        else:
            lines[-1] = longer
    indented = [f"{'    ' if place else '  '}{line}" for place, line in enumerate(lines)]
    return [f"{line} \\" for line in indented[:-1]] + indented[-1:]


def _named(request: Mapping[str, Any], names: Iterable[str]) -> str:
    return ", ".join(f"{name} {_text(request[name])}" for name in names if name in request)


def _text(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return ",".join(map(_text, value))
    if isinstance(value, float) and value.is_integer() and abs(value) < 1e15:
        return str(int(value))
    return str(value)


def _figure(value: float | None) -> str:
    if value is None:
        return "-"
    return str(value) if isinstance(value, int) else f"{value:.4g}"


def _percent(share: float) -> str:
    """A share in per cent. 0 % and 100 % are shown only if the share is exactly 0 or 1."""
    return "< 0.1 %" if 0.0 < share < 0.0005 else percent(share)


def _print(header: Sequence[str], rows: Iterable[Sequence[str]], *, left_from: int = 99) -> None:
    """Print a table.  The first column and the columns from `left_from` on are text; the other
    columns are numbers.
    """
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="bold")
    for place, name in enumerate(header):
        text = place == 0 or place >= left_from
        table.add_column(name, justify="left" if text else "right", overflow="fold")
    for row in rows:
        table.add_row(*(one_line(cell) for cell in row))
    show(table)
