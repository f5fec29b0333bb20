"""Files are read within limits, and errors in files give a message of one line."""

import errno
import io
import os
import sys
import warnings

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aosplan.errors import AosplanError, RequestError, SurroundingsError
from aosplan.files import check_input, decoding, read_bytes, read_table
from aosplan.scenes.files.canopy_raster import read_canopy


def refusing(error):
    """A replacement of `open` that fails with an OSError."""

    def call(*arguments, **words):
        raise OSError(error, os.strerror(error))

    return call


def test_a_file_is_read_without_changes(folder):
    (folder / "a").write_bytes(b"\0\xff\r\n")
    assert read_bytes("a") == b"\0\xff\r\n"


@pytest.mark.parametrize("name", ["no.toml", "no/no.toml", "file/x.toml", "\0", "", "n" * 5000])
def test_a_missing_file_gives_one_error_line(folder, name):
    (folder / "file").write_bytes(b"")
    with pytest.raises(AosplanError) as caught:
        read_bytes(name)
    assert caught.value.message


def test_a_missing_file_is_named(folder):
    with pytest.raises(RequestError) as caught:
        read_bytes("no.toml")
    assert caught.value.message == "there is no file 'no.toml'"


def test_a_folder_in_place_of_a_file_is_refused(folder):
    with pytest.raises(RequestError, match="is a folder, not a file"):
        read_bytes(".")


READERS = [(read_bytes, "file"), (check_input, "file"), (read_canopy, "raster")]


@pytest.mark.parametrize(("read", "what"), READERS)
@pytest.mark.parametrize(
    "name", ["no", "it's", 'a "b"', 'it\'s "b"', "a\nb", "a\\b", "a\0b", "\x1b"]
)
def test_unusual_names_are_quoted_in_the_same_way_by_every_reader(
    folder, monkeypatch, read, what, name
):
    with pytest.raises(RequestError) as caught:
        read(name)
    assert caught.value.message == f"there is no {what} '{name}'"
    if "\0" in name:
        return
    (folder / name).mkdir()
    with pytest.raises(RequestError) as caught:
        read(name)
    assert caught.value.message == f"'{name}' is a folder, not a {what}"
    monkeypatch.setattr("builtins.open", refusing(errno.EIO))
    with pytest.raises(SurroundingsError) as caught:
        read(name)
    assert caught.value.message == f"cannot read '{name}': {os.strerror(errno.EIO).lower()}"


@pytest.mark.parametrize("error", [errno.EACCES, errno.EIO])
def test_an_unreadable_file_is_reported_as_an_error_of_the_machine(folder, monkeypatch, error):
    monkeypatch.setattr("builtins.open", refusing(error))
    with pytest.raises(SurroundingsError) as caught:
        read_bytes("a.toml")
    assert caught.value.message == f"cannot read 'a.toml': {os.strerror(error).lower()}"


def test_stdin_is_read_for_a_dash(monkeypatch):
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"altitude = 40\n")))
    assert read_table("-") == {"altitude": 40}


def test_toml_on_stdin_may_begin_with_the_name_of_a_table(monkeypatch):
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"[sweep]\naltitude = 40\n")))
    assert read_table("-") == {"sweep": {"altitude": 40}}


def test_json_on_stdin_is_known_by_its_first_character(monkeypatch):
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b' {"altitude": 40}')))
    assert read_table("-") == {"altitude": 40}


def test_a_file_larger_than_the_limit_is_refused(folder):
    with open("big.toml", "wb") as file:
        file.truncate(100 * 2**20)  # The file is sparse, so that it needs no disk space.
    with pytest.raises(RequestError) as caught:
        read_table("big.toml")
    assert caught.value.message == "'big.toml' is larger than 64 MB"


@pytest.mark.parametrize(("size", "fits"), [(9, True), (10, True), (11, False)])
def test_the_limit_is_exact(folder, size, fits):
    (folder / "a").write_bytes(b"x" * size)
    if fits:
        assert len(read_bytes("a", most=10)) == size
    else:
        with pytest.raises(RequestError):
            read_bytes("a", most=10)


def test_an_endless_stdin_is_cut_at_the_limit(monkeypatch):
    class Endless(io.RawIOBase):
        def readable(self):
            return True

        def readinto(self, buffer):
            buffer[:] = b"x" * len(buffer)
            return len(buffer)

    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BufferedReader(Endless())))
    with pytest.raises(RequestError, match="larger than"):
        read_bytes("-", most=1000)


@pytest.mark.parametrize("name", ["a.toml", "a.txt", "a"])
def test_toml_is_read(folder, name):
    (folder / name).write_text('vhat = "98%"\n[x]\ny = 1\n')
    assert read_table(name) == {"vhat": "98%", "x": {"y": 1}}


@pytest.mark.parametrize("name", ["a.json", "a.JSON", "a.txt", "a"])
def test_json_is_read(folder, name):
    (folder / name).write_text('\n{"vhat": "98%", "x": {"y": 1}}')
    assert read_table(name) == {"vhat": "98%", "x": {"y": 1}}


@pytest.mark.parametrize("name", ["a.toml", "a.json"])
def test_a_byte_order_mark_is_overlooked(folder, name):
    text = "altitude = 40" if name == "a.toml" else '{"altitude": 40}'
    (folder / name).write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert read_table(name) == {"altitude": 40}


@pytest.mark.parametrize("name", ["a.toml", "a.json"])
@pytest.mark.parametrize("content", ["altitude = 40 # é".encode("latin-1"), b"\x80"])
def test_content_that_is_not_utf_8_is_refused_with_its_byte(folder, name, content):
    (folder / name).write_bytes(content)
    with pytest.raises(RequestError, match=r"is not UTF-8 text \(byte \d+\)"):
        read_table(name)


@pytest.mark.parametrize(
    ("name", "text", "place"),
    [
        ("a.toml", "altitude = 40\naltitude = 41\n", "line 2"),
        ("a.toml", "altitude = \n", "line 1"),
        ("a.toml", "altitude 40", "line 1"),
        ("a.json", '{"altitude": 40,\n"x"}', "line 2"),
        ("a.json", "", "line 1"),
        ("a.json", "{'altitude': 40}", "line 1"),
        ("a.json", '{"altitude": 40} x', "line 1"),
    ],
)
def test_syntax_errors_are_refused_with_their_line(folder, name, text, place):
    (folder / name).write_text(text)
    with pytest.raises(RequestError) as caught:
        read_table(name)
    kind = name[2:].upper()
    assert caught.value.message.startswith(f"'{name}' is not valid {kind}: ")
    assert place in caught.value.message


def test_a_name_given_twice_in_json_is_refused_as_in_toml(folder):
    (folder / "a.json").write_text('{"altitude": 40, "altitude": 41}')
    with pytest.raises(RequestError):
        read_table("a.json")


@pytest.mark.parametrize("constant", ["NaN", "Infinity", "-Infinity"])
def test_nan_in_json_is_refused(folder, constant):
    (folder / "a.json").write_text(f'{{"altitude": {constant}}}')
    with pytest.raises(RequestError, match="is not a number"):
        read_table("a.json")


@pytest.mark.parametrize("text", ["[1, 2]", "3", '"altitude"', "null", "[]"])
def test_json_without_names_is_refused(folder, text):
    (folder / "a.json").write_text(text)
    with pytest.raises(RequestError, match="contains no table"):
        read_table("a.json")


@pytest.mark.parametrize("digits", ["9" * 5000, "-" + "9" * 5000])
@pytest.mark.parametrize("name", ["a.json", "a.toml"])
def test_integers_without_end_are_refused(folder, name, digits):
    text = f'{{"altitude": {digits}}}' if name == "a.json" else f"altitude = {digits}"
    (folder / name).write_text(text)
    with pytest.raises(RequestError):
        read_table(name)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.json", "[" * 100_000),
        ("a.json", '{"a": ' * 100_000),
        ("a.json", '{"a": ' + "[" * 50_000 + "]" * 50_000 + "}"),
        ("a.toml", "a = " + "[" * 100_000),
        ("a.toml", "a = " + "{a = " * 100_000),
        ("a", "[" * 100_000),
    ],
    ids=["json lists", "json tables", "json closed", "toml lists", "toml tables", "no ending"],
)
def test_deeply_nested_brackets_are_refused(folder, name, text):
    (folder / name).write_text(text)
    with pytest.raises(RequestError):
        read_table(name)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.json", '{"a": ' * 500 + "1" + "}" * 500),
        ("a.toml", "a." * 500 + "a = 1"),
        ("a.toml", "[" + "a." * 500 + "a]\nb = 1"),
    ],
    ids=["json", "toml key", "toml header"],
)
def test_tables_nested_deeper_than_any_document_are_refused(folder, name, text):
    # A dotted key with tens of thousands of names would need gigabytes. Its depth is therefore
    # limited before parsing.
    (folder / name).write_text(text)
    with pytest.raises(RequestError, match="nested too deeply to be read"):
        read_table(name)


@given(content=st.binary(max_size=200), suffix=st.sampled_from([".toml", ".json", ""]))
def test_any_bytes_make_a_table_or_an_error(tmp_path_factory, content, suffix):
    path = tmp_path_factory.mktemp("any") / f"file{suffix}"
    path.write_bytes(content)
    try:
        table = read_table(str(path))
    except RequestError:
        return
    assert isinstance(table, dict)


class PanicException(BaseException):
    """What a panic in Rust code raises in Python.  It is not an `Exception`."""


@pytest.mark.parametrize(
    "error", [PanicException("a\nb"), ValueError("a\nb"), KeyError(), ArithmeticError()]
)
def test_any_exception_of_a_library_gives_one_error(error, capfd):
    def decode():
        os.write(2, b"thread 'main' panicked at frame.rs\n")
        warnings.warn("of a library", stacklevel=1)
        raise error

    with pytest.raises(RequestError) as caught, decoding("table", "a.x"):
        decode()
    assert caught.value.message.startswith("'a.x' is not a table that can be read")
    assert "\n" not in caught.value.message
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError, SystemExit, RequestError("a")])
def test_exceptions_not_caused_by_the_file_are_not_changed(error):
    with pytest.raises(error if isinstance(error, type) else type(error)), decoding("table", "a.x"):
        raise error


def test_stderr_is_there_again_after_a_library(capfd):
    with decoding("table", "a.x"):
        os.write(2, b"of the library")
    os.write(2, b"ours")
    assert capfd.readouterr().err == "ours"


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-8-sig"])
def test_text_of_powershell_and_notepad_is_read(folder, encoding):
    mark = "" if encoding in ("utf-16", "utf-8-sig") else "\ufeff"
    (folder / "a.toml").write_bytes(f'{mark}name = "Wald é"\r\n'.encode(encoding))
    assert read_table("a.toml") == {"name": "Wald é"}


def test_a_windows_path_in_double_quotes_gives_a_hint(folder):
    (folder / "a.toml").write_text('scene = "C:\\Users\\new\\stand.laz"\n')
    with pytest.raises(RequestError, match="line 1") as caught:
        read_table("a.toml")
    assert "single quotes" in caught.value.hint


DOTS = "a.b." * 100


@pytest.mark.parametrize(
    ("text", "value"),
    [
        (f'x = "{DOTS}" # {DOTS}', DOTS),
        (f"x = '{DOTS}'", DOTS),
        (f'x = """{DOTS}"""', DOTS),
        (f"x = '''{DOTS}''''", DOTS + "'"),
        (f'x = "\\"{DOTS}"', '"' + DOTS),
        (f'# "{DOTS}\nx = """\n#"{DOTS}\\""""', '#"' + DOTS + '"'),
    ],
)
def test_dots_in_text_and_comments_do_not_count_as_nesting(folder, text, value):
    (folder / "a.toml").write_text(text)
    assert read_table("a.toml") == {"x": value}


@pytest.mark.parametrize("key", [DOTS + "c", "'a'.\"b\" . " * 40 + "c", f"x = '#'\n[{DOTS}c]\ny"])
def test_dotted_keys_count_as_nesting(folder, key):
    (folder / "a.toml").write_text(f"{key} = 1")
    with pytest.raises(RequestError, match="nested too deeply to be read"):
        read_table("a.toml")
