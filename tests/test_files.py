"""Files are read within limits, and written whole or not at all.

The tests may run as root, for whom permissions do not count, so failures of the machine are
put in by hand; nothing outside `tmp_path` is ever written.
"""

import errno
import io
import os
import stat
import sys
import tempfile

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aosplan import files
from aosplan.errors import AosplanError, RequestError, SurroundingsError
from aosplan.files import check_input, check_output, read_bytes, read_table, write_all
from aosplan.raster import read_canopy


def content_of(folder):
    """Every file of a folder, hidden ones too."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def failing(error, real, *, on):
    """A function that fails with an OSError at one of its calls, counted from 1."""
    calls = []

    def call(*arguments, **words):
        calls.append(arguments)
        if len(calls) == on:
            raise OSError(error, os.strerror(error))
        return real(*arguments, **words)

    return call


def test_every_file_has_its_content(folder):
    write_all({"a.csv": b"one\n", "b.csv": b"", str(folder / "c"): b"\0\xff"})
    assert content_of(folder) == {"a.csv": b"one\n", "b.csv": b"", "c": b"\0\xff"}


def test_nothing_to_write_writes_nothing(folder):
    write_all({})
    assert content_of(folder) == {}


def test_an_existing_file_stays(folder):
    (folder / "a.csv").write_bytes(b"old")
    with pytest.raises(RequestError) as caught:
        write_all({"a.csv": b"new"})
    assert caught.value.message == "output 'a.csv' exists"
    assert caught.value.hint == "give --force to overwrite it"
    assert content_of(folder) == {"a.csv": b"old"}


def test_an_existing_second_file_keeps_the_first_from_being_written(folder):
    (folder / "b.csv").write_bytes(b"old")
    with pytest.raises(RequestError, match=r"'b\.csv' exists"):
        write_all({"a.csv": b"new", "b.csv": b"new"})
    assert content_of(folder) == {"b.csv": b"old"}


def test_force_overwrites(folder):
    (folder / "a.csv").write_bytes(b"a longer old content")
    write_all({"a.csv": b"new", "b.csv": b"new"}, force=True)
    assert content_of(folder) == {"a.csv": b"new", "b.csv": b"new"}


def test_a_dangling_link_is_not_written_through(folder):
    (folder / "a.csv").symlink_to(folder / "elsewhere")
    with pytest.raises(RequestError, match="exists"):
        write_all({"a.csv": b"new"})
    assert not (folder / "elsewhere").exists()


def test_force_never_replaces_what_is_no_regular_file(folder):
    # With --force and enough rights, a device once became an ordinary file.
    os.mkfifo("pipe.csv")
    with pytest.raises(AosplanError):
        write_all({"pipe.csv": b"new"}, force=True)
    assert stat.S_ISFIFO(os.lstat("pipe.csv").st_mode)
    assert content_of(folder) == {}


def test_a_special_file_is_refused_before_any_work_is_done(folder):
    os.mkfifo("pipe.csv")
    with pytest.raises(AosplanError):
        check_output("pipe.csv", force=True)


def test_an_existing_file_is_refused_before_any_work_is_done(folder):
    (folder / "a.csv").write_bytes(b"old")
    with pytest.raises(RequestError, match="exists"):
        check_output("a.csv", force=False)
    check_output("a.csv", force=True)
    check_output("b.csv", force=False)


def test_a_file_that_appears_meanwhile_is_not_overwritten(folder, monkeypatch):
    monkeypatch.setattr(files, "check_output", lambda *_, **__: None)
    (folder / "b.csv").write_bytes(b"somebody else's")
    with pytest.raises(RequestError, match=r"'b\.csv' exists"):
        write_all({"a.csv": b"new", "b.csv": b"new"})
    assert content_of(folder) == {"b.csv": b"somebody else's"}


def test_a_folder_is_no_output(folder):
    (folder / "plans").mkdir()
    for force in (False, True):
        with pytest.raises(RequestError, match="'plans' is a folder"):
            write_all({"a.csv": b"new", "plans": b"new"}, force=force)
    assert content_of(folder) == {}


def test_a_missing_folder_is_an_error_and_is_not_made(folder):
    with pytest.raises(RequestError) as caught:
        write_all({"a.csv": b"new", "no/b.csv": b"new"})
    assert caught.value.message == "output 'no/b.csv': there is no folder 'no'"
    assert content_of(folder) == {}
    assert not (folder / "no").exists()


def test_a_file_is_no_folder(folder):
    (folder / "plan").write_bytes(b"old")
    with pytest.raises(RequestError, match="there is no folder 'plan'"):
        write_all({"plan/a.csv": b"new"})
    assert content_of(folder) == {"plan": b"old"}


def test_a_zero_byte_in_a_name_is_refused(folder):
    with pytest.raises(AosplanError):
        write_all({"a\0.csv": b"new"})
    assert content_of(folder) == {}


def test_a_name_that_is_too_long_leaves_nothing_behind(folder):
    with pytest.raises(AosplanError):
        write_all({"a.csv": b"new", "n" * 300: b"new"})
    assert content_of(folder) == {}


@pytest.mark.parametrize("existing", [False, True])
def test_the_longest_name_that_a_file_system_takes_works(folder, existing):
    name = "n" * 255
    if existing:
        (folder / name).write_bytes(b"old")
    write_all({name: b"new"}, force=existing)
    assert content_of(folder) == {name: b"new"}


FAILURES = [
    (module, name, error)
    for module, name in ((os, "fsync"), (os, "chmod"), (tempfile, "mkstemp"))
    for error in (errno.ENOSPC, errno.EACCES, errno.EROFS)
]


@pytest.mark.parametrize("force", [False, True])
@pytest.mark.parametrize("on", [1, 2])
@pytest.mark.parametrize(
    ("module", "name", "error"), FAILURES, ids=[f"{n}-{errno.errorcode[e]}" for _, n, e in FAILURES]
)
def test_a_machine_that_fails_leaves_everything_as_it_was(
    folder, monkeypatch, module, name, error, on, force
):
    if force:
        (folder / "a.csv").write_bytes(b"old")
    before = content_of(folder)
    monkeypatch.setattr(module, name, failing(error, getattr(module, name), on=on))
    with pytest.raises(SurroundingsError) as caught:
        write_all({"a.csv": b"new", "b.csv": b"new"}, force=force)
    assert caught.value.message.startswith(f"cannot write '{'ab'[on - 1]}.csv': ")
    assert os.strerror(error).lower() in caught.value.message
    assert caught.value.exit_status == 1
    assert content_of(folder) == before


def test_a_disk_that_fills_while_writing_leaves_nothing(folder, monkeypatch):
    real = os.fdopen

    def full(*arguments, **words):
        file = real(*arguments, **words)

        class Full:
            def __enter__(self):
                return self

            def __exit__(self, *details):
                file.close()

            def write(self, content):
                file.write(content[:1])
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        return Full()

    monkeypatch.setattr(os, "fdopen", full)
    with pytest.raises(SurroundingsError, match="no space left on device"):
        write_all({"a.csv": b"new"})
    assert content_of(folder) == {}


@pytest.mark.parametrize("existing", [(), ("a.csv",), ("b.csv",), ("a.csv", "b.csv")])
@pytest.mark.parametrize("on", [1, 2, 3, 4])
@pytest.mark.parametrize("name", ["replace", "rename", "link"])
def test_names_are_given_to_all_files_or_to_none(folder, monkeypatch, name, on, existing):
    for file in existing:
        (folder / file).write_bytes(b"old")
    before = content_of(folder)
    monkeypatch.setattr(os, name, failing(errno.EACCES, getattr(os, name), on=on))
    try:
        write_all({"a.csv": b"new", "b.csv": b"new"}, force=bool(existing))
    except SurroundingsError:
        assert content_of(folder) == before
    else:  # there were not so many calls, or another way was found
        assert content_of(folder) == {"a.csv": b"new", "b.csv": b"new"}


def test_a_name_that_cannot_be_given_is_reported(folder, monkeypatch):
    monkeypatch.setattr(os, "link", failing(errno.EPERM, os.link, on=1))
    monkeypatch.setattr(os, "replace", failing(errno.EACCES, os.replace, on=1))
    with pytest.raises(SurroundingsError, match=r"cannot write 'a\.csv': permission denied"):
        write_all({"a.csv": b"new"})
    assert content_of(folder) == {}


@pytest.mark.parametrize("on", [1, 2])
def test_an_interrupted_run_leaves_nothing(folder, monkeypatch, on):
    calls = []

    def interrupted(handle):
        calls.append(handle)
        if len(calls) == on:
            raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_all({"a.csv": b"new", "b.csv": b"new"})
    assert content_of(folder) == {}


def test_new_files_have_the_permissions_of_the_user_not_of_temporary_files(folder):
    mask = os.umask(0o027)
    try:
        write_all({"a.csv": b"new"})
    finally:
        os.umask(mask)
    assert stat.S_IMODE((folder / "a.csv").stat().st_mode) == 0o640


def test_the_umask_is_left_as_it_was(folder):
    mask = os.umask(0o013)
    try:
        write_all({"a.csv": b"new"})
        after = os.umask(0o013)
    finally:
        os.umask(mask)
    assert after == 0o013


def test_an_overwritten_file_does_not_become_readable_to_others(folder):
    (folder / "a.csv").write_bytes(b"old")
    (folder / "a.csv").chmod(0o600)
    write_all({"a.csv": b"new"}, force=True)
    assert stat.S_IMODE((folder / "a.csv").stat().st_mode) == 0o600


def test_stdout_is_written_for_a_dash(folder, monkeypatch):
    screen = io.TextIOWrapper(io.BytesIO())
    monkeypatch.setattr(sys, "stdout", screen)
    write_all({"-": b"data\xff", "a.csv": b"new"})
    assert screen.buffer.getvalue() == b"data\xff"
    assert content_of(folder) == {"a.csv": b"new"}


def test_stdout_stays_empty_when_a_file_fails(folder, monkeypatch):
    screen = io.TextIOWrapper(io.BytesIO())
    monkeypatch.setattr(sys, "stdout", screen)
    monkeypatch.setattr(os, "fsync", failing(errno.ENOSPC, os.fsync, on=1))
    with pytest.raises(SurroundingsError):
        write_all({"-": b"data", "a.csv": b"new"})
    assert screen.buffer.getvalue() == b""


def test_a_dash_is_never_a_file(folder):
    (folder / "-").mkdir()
    check_output("-", force=False)


# Reading


def test_a_file_is_read_as_it_is(folder):
    (folder / "a").write_bytes(b"\0\xff\r\n")
    assert read_bytes("a") == b"\0\xff\r\n"


@pytest.mark.parametrize("name", ["no.toml", "no/no.toml", "file/x.toml", "\0", "", "n" * 5000])
def test_a_file_that_is_not_there_is_an_error_of_one_line(folder, name):
    (folder / "file").write_bytes(b"")
    with pytest.raises(AosplanError) as caught:
        read_bytes(name)
    assert caught.value.message


def test_a_missing_file_is_named(folder):
    with pytest.raises(RequestError) as caught:
        read_bytes("no.toml")
    assert caught.value.message == "no file 'no.toml'"


def test_a_folder_is_no_file(folder):
    with pytest.raises(RequestError, match="is a folder, not a file"):
        read_bytes(".")


READERS = [(read_bytes, "file"), (check_input, "file"), (read_canopy, "raster")]


@pytest.mark.parametrize(("read", "what"), READERS)
@pytest.mark.parametrize(
    "name", ["no", "it's", 'a "b"', 'it\'s "b"', "a\nb", "a\\b", "a\0b", "\x1b"]
)
def test_odd_names_are_quoted_alike_whatever_reads_them(folder, monkeypatch, read, what, name):
    with pytest.raises(RequestError) as caught:
        read(name)
    assert caught.value.message == f"no {what} '{name}'"
    if "\0" in name:
        return
    (folder / name).mkdir()
    with pytest.raises(RequestError) as caught:
        read(name)
    assert caught.value.message == f"'{name}' is a folder, not a {what}"
    monkeypatch.setattr("builtins.open", failing(errno.EIO, open, on=1))
    with pytest.raises(SurroundingsError) as caught:
        read(name)
    assert caught.value.message == f"cannot read '{name}': {os.strerror(errno.EIO).lower()}"


@pytest.mark.parametrize("error", [errno.EACCES, errno.EIO])
def test_a_file_that_cannot_be_read_is_the_machine_s_fault(folder, monkeypatch, error):
    def refuse(*arguments, **words):
        raise OSError(error, os.strerror(error))

    monkeypatch.setattr("builtins.open", refuse)
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
        file.truncate(100 * 2**20)  # sparse: no disk is used
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
@pytest.mark.parametrize(
    "content", ["altitude = 40 # é".encode("latin-1"), "altitude = 40".encode("utf-16"), b"\x80"]
)
def test_what_is_not_utf_8_is_refused_and_the_byte_is_named(folder, name, content):
    (folder / name).write_bytes(content)
    with pytest.raises(RequestError, match=r"is not UTF-8 text \(byte \d+\)"):
        read_table(name)


@pytest.mark.parametrize(
    ("name", "text", "place"),
    [
        ("a.toml", "altitude = 40\naltitude = 41\n", "line 2"),
        ("a.toml", "altitude = \n", "line 1"),
        ("a.toml", "altitude 40", "line 1"),
        ("a.json", '{"altitude": 40,\n}', "line 2"),
        ("a.json", "", "line 1"),
        ("a.json", "{'altitude': 40}", "line 1"),
        ("a.json", '{"altitude": 40} x', "line 1"),
    ],
)
def test_what_does_not_parse_is_refused_with_its_line(folder, name, text, place):
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
def test_json_has_no_nan(folder, constant):
    (folder / "a.json").write_text(f'{{"altitude": {constant}}}')
    with pytest.raises(RequestError, match="is not a number"):
        read_table("a.json")


@pytest.mark.parametrize("text", ["[1, 2]", "3", '"altitude"', "null", "[]"])
def test_json_without_names_is_refused(folder, text):
    (folder / "a.json").write_text(text)
    with pytest.raises(RequestError, match="holds no table"):
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
def test_bombs_of_brackets_are_refused(folder, name, text):
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
    # A dotted key of a few ten thousand names takes gigabytes, so depth is bounded early.
    (folder / name).write_text(text)
    with pytest.raises(RequestError, match="nested too deeply"):
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
