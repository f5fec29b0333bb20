"""Generates the reference of the command line as Markdown, from the commands."""

from functools import partial
from importlib import import_module
from inspect import getclosurevars
from re import fullmatch

from aosplan import units as q
from aosplan.cli.app import COMMANDS, GROUP
from aosplan.planning import option_parsers as parsers
from aosplan.planning.options import BY_NAME

UNITS = {
    "M": "metres",
    "MM": "millimetres",
    "PX": "pixels",
    "DEG": "degrees",
    "S": "seconds",
    "MIN": "minutes",
    "M/S": "metres per second",
    "M/S²": "metres per second squared",
}
"""Unit of a value, by its placeholder in the help."""

DOMAINS = {
    q.number: "any number",
    q.positive: "above 0",
    q.at_least_zero: "0 or more",
    q.whole: "a whole number from 1",
    q.index: "a whole number from 0",
    q.share: "from 0 to 1, or a percentage",
    q.share_above_zero: "above 0, up to 1, or a percentage",
    q.flag: "given or not",
    q.word: "",
    q.latitude_longitude: "latitude and longitude in degrees, north and east positive",
    parsers.target_share: "from 0 to below 1, or a percentage",
    parsers.field_of_view: "above 0, below 180",
    parsers.altitude: "above 0, or a range such as `40..80`",
    parsers.file_waypoints: "a whole number from 2",
    parsers.heading_or_auto: "any number, `best`, or `auto`",
    parsers.target_name: "`person` (lying), or width and length such as `2x4`, from 0.1 to 10 m",
    parsers.contrast: "a number that is not 0",
    parsers.radiance: "any number up to 1,000",
    parsers.false_alarms: "a number from 1e-06 to 100",
    parsers.length_unit: "a unit of length by its short name or its name in EPSG",
    parsers.length_units: "one or two units of length by their short names or their names in EPSG",
    parsers.payload: "a payload of [](presets.md#payloads)",
}
"""Text about the values that each parser of `aosplan.planning.option_parsers` accepts."""


def domain(parse):
    """Text about the values that an option's parser accepts."""
    while isinstance(parse, partial):
        parse = parse.args[0] if parse.func is parsers.bounded else parse.func
    if parse in DOMAINS:
        return DOMAINS[parse]
    kept = getclosurevars(parse).nonlocals
    if "allowed" in kept:
        return "one of " + ", ".join(f"`{word}`" for word in kept["allowed"])
    return f"{domain(kept['parse'])}, or `best`"


def loaded(name):
    """A command by its name."""
    return import_module(f"aosplan.cli.{name}").COMMAND


def overview():
    """The list of commands, with one line for each command."""
    rows = [f"- [`aosplan {name}`](#aosplan-{name}): {text}" for name, text in COMMANDS.items()]
    return "\n".join(rows)


def program():
    """The options of the program that belong to no command."""
    options = "\n".join(_option(each) for each in GROUP.params)
    return f"```{{program}} aosplan\n```\n\n{options}"


def command(name):
    """The reference of one command: usage, arguments, options by group, and examples."""
    found = loaded(name)
    arguments = [each for each in found.params if each.param_type_name == "argument"]
    named = [each for each in found.params if each.param_type_name == "option"]
    shared = [each for each in named if name != "plan" and _is_plans(each)]
    panels = {}
    for each in named:
        if each not in shared:
            panels.setdefault(getattr(each, "rich_help_panel", None) or "Options", []).append(each)
    lines = [found.help, "", f"```text\n{usage(found, name)}\n```", ""]
    for argument in arguments:
        lines += [f"`{argument.metavar or argument.name.upper()}`\n: {_text(argument.help)}", ""]
    for panel, members in panels.items():
        lines += [f"**{panel}**", "", *(_option(each) for each in members)]
    if shared:
        lines += ["**Of a plan**", "", "As for `aosplan plan`:", ""]
        lines += [", ".join(f"{{option}}`aosplan plan {flag(each)}`" for each in shared), ""]
    if found.epilog:
        lines += ["**Examples**", "", f"```console\n{found.epilog}\n```", ""]
    return "\n".join(["```{program} aosplan " + name + "\n```", "", *lines])


def usage(found, name):
    """The line that shows the usage of a command."""
    words = ["aosplan", name, "[OPTIONS]"]
    for each in found.params:
        if each.param_type_name == "argument":
            word = each.metavar or each.name.upper()
            words.append(word if each.required or word.startswith("[") else f"[{word}]")
    return " ".join(words)


def flag(parameter):
    """The name of an option with its placeholder."""
    return parameter.opts[-1]


def described(parameter):
    """The description and the default of an option.  In the help, the default is in brackets."""
    match = fullmatch(r"(.*?)\s*\[([^\[\]]+)\]", parameter.help or "")
    return (match[1], match[2]) if match else (parameter.help or "", "")


def facts(parameter):
    """Text about unit, domain and default of an option."""
    known = BY_NAME.get(flag(parameter)[2:].replace("-", "_"))
    unit = UNITS.get(parameter.metavar or "", "")
    accepted = domain(known.parse) if known is not None and _is_plans(parameter) else ""
    default = described(parameter)[1]
    said = (unit, accepted, f"default {default}" if default else "")
    return [fact for fact in said if fact]


def _is_plans(parameter):
    """Whether an option has the name and meaning of an option of a plan's request."""
    name = flag(parameter)[2:].replace("-", "_")
    return name in BY_NAME and BY_NAME[name].help == parameter.help


def _option(parameter):
    signature = " ".join(word for word in (flag(parameter), parameter.metavar) if word)
    repeated = ["may be repeated"] if parameter.multiple else []
    said = "; ".join(facts(parameter) + repeated)
    text = _text(described(parameter)[0])
    return f"````{{option}} {signature}\n{text}\n{f'*{said[0].upper()}{said[1:]}.*' if said else ''}\n````\n"


def _text(text):
    """Text of the help as Markdown.  Only its backticks are treated as markup."""
    kept = "".join(f"\\{c}" if c in "*_<>[]$" else c for c in text)
    return kept.replace("--", "\\-\\-") if "`" not in kept else kept
