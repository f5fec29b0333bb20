"""The documentation: its examples print what it shows, and it leaves nothing out."""

import re
import sys
from pathlib import Path

import pytest

from aosplan.cli.app import COMMANDS
from aosplan.documents import DOCUMENTS, json_schema
from aosplan.export import formats
from aosplan.meanings import MEANINGS

DOCS = Path(__file__).parents[1] / "docs"
sys.path.insert(0, str(DOCS))

from extensions import commands, documents, examples, presets  # noqa: E402

PAGES = examples.pages()


def text_of(*names):
    return "\n".join((DOCS / name).read_text(encoding="utf-8") for name in names)


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(DOCS)))
def test_the_examples_of_a_page_print_what_it_shows(page, tmp_path):
    for block, printed in examples.follow(page.read_text(encoding="utf-8"), tmp_path):
        if block.kind == "text":
            assert examples.same(block.body, printed), f"shown:\n{block.body}printed:\n{printed}"
        else:
            assert (tmp_path / block.argument).stat().st_size > 1000


def test_every_command_is_in_the_reference():
    told = re.findall(r"\{generated\} command (\w+)", text_of("reference/commands.md"))
    assert sorted(told) == sorted(COMMANDS)


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
    from aosplan.options import BY_NAME

    assert commands.domain(BY_NAME["altitude"].parse) == "above 0"
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


def test_every_meaning_is_of_a_field_that_exists():
    fields = set()
    for name in DOCUMENTS:
        schema = json_schema(name)
        for table in (schema, *schema.get("$defs", {}).values()):
            for field in table["properties"]:
                fields |= {field, f"{table['title']}.{field}"}
    assert set(MEANINGS) <= fields


def test_every_format_is_in_the_table_of_formats():
    assert set(re.findall(r"^\| `(\w+)`", presets.formats(), re.MULTILINE)) == set(formats())


def test_every_picture_says_in_words_what_it_shows():
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"!\[\]\(", text), page
        for block in examples.blocks(text):
            if block.kind in ("drawn", "figure", "image"):
                said = "aosplan plot" in block.body and block.options.get("alt") == "described"
                assert said or len(block.options.get("alt", "")) > 60, (page, block.argument)


# The machinery itself.


def shown(text, folder):
    return [examples.same(block.body, printed) for block, printed in examples.follow(text, folder)]


def test_an_output_that_differs_is_found(tmp_path):
    page = "```sh\naosplan --version\n```\n\n```text\n{}\n```\n"
    from aosplan import __version__

    assert shown(page.format(f"aosplan {__version__}"), tmp_path) == [True]
    assert shown(page.format("aosplan 9"), tmp_path) == [False]
    assert shown(page.format("...\naosplan"), tmp_path) == [False]


def test_dots_stand_for_any_lines():
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
