"""The documentation: its examples print the output that the pages show, and it is complete."""

import ast
import re
import sys
import tomllib

import pytest
from support.paths import ROOT

from aosplan.cli.app import COMMANDS, GROUP
from aosplan.cli.field_descriptions import FIELD_DESCRIPTIONS
from aosplan.cli.schema import DOCUMENTS, json_schema
from aosplan.mission.export import formats

DOCS = ROOT / "docs"
SOURCE = DOCS.parent / "src" / "aosplan"
sys.path.insert(0, str(DOCS))

from extensions import commands, documents, examples, presets, surroundings  # noqa: E402

PAGES = examples.pages()


def text_of(*names):
    return "\n".join((DOCS / name).read_text(encoding="utf-8") for name in names)


def is_drawn(page):
    """Whether a page has pictures. The build of the documentation runs the examples of
    such pages.
    """
    return "```{drawn}" in page.read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize(
    "page",
    [pytest.param(page, marks=[pytest.mark.drawn] if is_drawn(page) else []) for page in PAGES],
    ids=lambda path: str(path.relative_to(DOCS)),
)
def test_the_examples_of_a_page_print_what_it_shows(page, tmp_path):
    for block, printed in examples.follow(page.read_text(encoding="utf-8"), tmp_path):
        if block.kind == "text":
            assert examples.same(block.body, printed), f"shown:\n{block.body}printed:\n{printed}"
        else:
            assert (tmp_path / block.argument).stat().st_size > 1000


def test_every_command_is_in_the_reference():
    told = re.findall(r"\{generated\} command (\w+)", text_of("reference/commands.md"))
    assert sorted(told) == sorted(COMMANDS)


def test_the_program_s_own_options_are_in_the_reference():
    assert "{generated} program" in text_of("reference/commands.md")
    assert {flag for each in GROUP.params for flag in each.opts} == set(
        re.findall(r"^````\{option\} (--[\w-]+)", commands.program(), re.MULTILINE)
    )


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_and_argument_of_a_command_is_in_its_reference(name):
    text = commands.command(name)
    for parameter in commands.loaded(name).params:
        if parameter.param_type_name == "argument":
            assert f"`{parameter.metavar}`" in text
        else:
            flag = commands.flag(parameter)
            own = re.search(rf"^````{{option}} {flag}\b", text, re.MULTILINE)
            assert own or f"`aosplan plan {flag}`" in text, flag


def test_every_option_of_a_plan_says_what_it_accepts():
    for parameter in commands.loaded("plan").params:
        if parameter.param_type_name == "option":
            commands.facts(parameter)


def test_domains_are_those_that_the_parsers_accept():
    from aosplan.planning.options import BY_NAME

    assert commands.domain(BY_NAME["gsd"].parse) == "above 0"
    assert commands.domain(BY_NAME["altitude"].parse) == "above 0, or a range such as `40..80`"
    assert commands.domain(BY_NAME["lanes"].parse) == "a whole number from 1, or `best`"
    assert "`telecentric`" in commands.domain(BY_NAME["view"].parse)


def test_every_document_is_in_the_reference():
    told = re.findall(r"\{generated\} document (\w+)", text_of("reference/files.md"))
    assert sorted(told) == sorted(DOCUMENTS)


@pytest.mark.parametrize("name", DOCUMENTS)
def test_every_unit_that_a_field_names_is_known(name):
    for field in re.findall(r"^\| `(\w+)` \| [^|]*number", documents.document(name), re.MULTILINE):
        suffix = field.rpartition("_")[2] if "_" in field else ""
        looks_like_a_unit = re.fullmatch(r"m|m2|mm|cm|km|px|deg|rad|s|ms|min|mps\d?|kmh", suffix)
        assert not looks_like_a_unit or documents.unit(field), field


@pytest.mark.parametrize("name", DOCUMENTS)
def test_every_field_of_a_document_says_what_it_means(name):
    schema = json_schema(name)
    for table in (schema, *schema.get("$defs", {}).values()):
        for field, about in table["properties"].items():
            assert about.get("description"), (table["title"], field)


def test_every_field_description_belongs_to_an_existing_field():
    fields = set()
    for name in DOCUMENTS:
        schema = json_schema(name)
        for table in (schema, *schema.get("$defs", {}).values()):
            for field in table["properties"]:
                fields |= {field, f"{table['title']}.{field}"}
    assert set(FIELD_DESCRIPTIONS) <= fields


def test_every_format_is_in_the_table_of_formats():
    assert set(re.findall(r"^\| `([\w-]+)`", presets.formats(), re.MULTILINE)) == set(formats())


def test_every_picture_has_an_alternative_text():
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"!\[\]\(", text), page
        for block in examples.blocks(text):
            if block.kind in ("drawn", "figure", "image") and not block.argument.endswith(".html"):
                said = "aosplan plot" in block.body and block.options.get("alt") == "described"
                assert said or len(block.options.get("alt", "")) > 60, (page, block.argument)


def test_every_extra_is_in_the_installation():
    project = tomllib.loads((DOCS.parent / "pyproject.toml").read_text(encoding="utf-8"))
    told = re.findall(r"^\| `(\w+)` \|", text_of("install.md"), re.MULTILINE)
    assert sorted(told) == sorted(project["project"]["optional-dependencies"])


def test_every_environment_variable_is_in_the_reference():
    text = text_of("reference/errors.md")
    for path in SOURCE.rglob("*.py"):
        for name in re.findall(r"\bAOSPLAN_[A-Z]+\b", path.read_text(encoding="utf-8")):
            assert f"`{name}`" in text, (path, name)


def test_every_unit_is_in_the_glossary():
    told = re.findall(r"`_(\w+)`", text_of("reference/glossary.md"))
    assert set(told) == set(documents.UNITS)


def test_every_symbol_s_name_is_a_name_of_the_program():
    rows = re.findall(r"^\| \$[^|]*\| ([^|]*) \|", text_of("reference/glossary.md"), re.MULTILINE)
    assert len(rows) > 12
    sources = "\n".join(path.read_text(encoding="utf-8") for path in SOURCE.rglob("*.py"))
    for name in re.findall(r"`([\w.]+)`", " ".join(rows)):
        assert re.search(rf"\b{name.rpartition('.')[2]}\b", sources), name


def test_every_term_that_pages_use_is_in_the_glossary():
    glossary = re.search(r"```\{glossary\}\n(.*?)```", text_of("reference/glossary.md"), re.DOTALL)[
        1
    ]
    terms = set(re.findall(r"^(\S.*)$", glossary, re.MULTILINE))
    for page in PAGES:
        for text in re.findall(r"\{term\}`([^`]*)`", page.read_text(encoding="utf-8")):
            target = re.search(r"<(.*)>", text)
            assert (target[1] if target else text) in terms, (page, text)


def test_every_warning_is_in_the_reference():
    told = dict(re.findall(r"^\| `(\w+)` \| (.*) \|$", surroundings.warnings(), re.MULTILINE))
    codes = {"small_plot", "sparse_cloud", "target_missed"}
    for path in SOURCE.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        if "Message(" not in text:
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Message":
                codes |= {each.value for each in node.args[:1] if isinstance(each, ast.Constant)}
    assert len(codes) > 20
    assert codes <= set(told)
    assert min(map(len, told.values())) > 20


def test_every_format_has_its_how_to():
    titles = re.findall(r"^## .*$", text_of("howto/ground-stations.md"), re.MULTILINE)
    assert set(re.findall(r"`([\w-]+)`", " ".join(titles))) == set(formats())


def test_every_page_is_in_a_table_of_contents():
    listed = re.findall(r"^(?!:)([\w/-]+)$", text_of("index.md"), re.MULTILINE)
    assert {f"{name}.md" for name in listed} | {"index.md"} == {
        str(page.relative_to(DOCS)) for page in PAGES
    }


# Tests of the test helpers


def shown(text, folder):
    return [examples.same(block.body, printed) for block, printed in examples.follow(text, folder)]


def test_an_output_that_differs_is_found(tmp_path):
    page = "```sh\naosplan --version\n```\n\n```text\n{}\n```\n"
    from aosplan import __version__

    assert shown(page.format(f"aosplan {__version__}"), tmp_path) == [True]
    assert shown(page.format("aosplan 9"), tmp_path) == [False]
    assert shown(page.format("...\naosplan"), tmp_path) == [False]


def test_an_ellipsis_matches_any_lines():
    assert examples.same("a\n...\nd\n", "a\nb\nc\nd\n")
    assert examples.same("a\n...\nd\n", "a\nd\n")
    assert not examples.same("a\n...\nd\n", "a\nb\n")
    assert not examples.same("a\n", "a\nb\n")


def test_an_error_that_the_page_does_not_show_fails(tmp_path):
    page = "```sh\naosplan plan --altitude 0\n```\n"
    with pytest.raises(examples.Failed, match="is not above zero"):
        examples.follow(page, tmp_path)


def test_a_line_that_cannot_be_run_fails(tmp_path):
    with pytest.raises(examples.Failed, match="no way to run"):
        examples.follow("```sh\nrm stand.laz\n```\n", tmp_path)
