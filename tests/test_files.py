"""Files are written completely or not at all.

Failures of the machine are simulated, because the tests may run as root, for whom permissions have
no effect.  Nothing outside `tmp_path` is written.
"""

import errno
import io
import os
import stat
import sys
import tempfile

import pytest

from aosplan import files
from aosplan.errors import AosplanError, RequestError, SurroundingsError
from aosplan.files import check_output, write_all


def content_of(folder):
    """The content of every file in a folder, including hidden ones."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def failing(error, real, *, on):
    """A function that fails with an OSError at the n-th of its calls, counted from 1."""
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


def test_an_empty_set_of_files_writes_nothing(folder):
    write_all({})
    assert content_of(folder) == {}


def test_an_existing_file_is_not_overwritten(folder):
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


def test_force_never_replaces_special_files(folder):
    # --force once replaced a device by an ordinary file, if the user had the rights.
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


def test_a_folder_is_refused_as_output_file(folder):
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


def test_a_file_in_place_of_a_folder_is_refused(folder):
    (folder / "plan").write_bytes(b"old")
    with pytest.raises(RequestError, match="there is no folder 'plan'"):
        write_all({"plan/a.csv": b"new"})
    assert content_of(folder) == {"plan": b"old"}


def test_a_zero_byte_in_a_name_is_refused(folder):
    with pytest.raises(AosplanError):
        write_all({"a\0.csv": b"new"})
    assert content_of(folder) == {}


def test_too_long_file_names_leave_no_files(folder):
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
def test_an_error_of_the_machine_changes_no_file(
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


def test_a_disk_that_becomes_full_while_writing_leaves_no_files(folder, monkeypatch):
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
def test_either_all_files_or_none_are_renamed(folder, monkeypatch, name, on, existing):
    for file in existing:
        (folder / file).write_bytes(b"old")
    before = content_of(folder)
    monkeypatch.setattr(os, name, failing(errno.EACCES, getattr(os, name), on=on))
    try:
        write_all({"a.csv": b"new", "b.csv": b"new"}, force=bool(existing))
    except SurroundingsError:
        assert content_of(folder) == before
    else:  # There were fewer calls than `on`, or the program continued without the file.
        assert content_of(folder) == {"a.csv": b"new", "b.csv": b"new"}


def test_a_failed_rename_is_reported(folder, monkeypatch):
    monkeypatch.setattr(os, "link", failing(errno.EPERM, os.link, on=1))
    monkeypatch.setattr(os, "replace", failing(errno.EACCES, os.replace, on=1))
    with pytest.raises(SurroundingsError, match=r"cannot write 'a\.csv': permission denied"):
        write_all({"a.csv": b"new"})
    assert content_of(folder) == {}


@pytest.mark.parametrize("on", [1, 2])
def test_an_interrupted_run_leaves_no_files(folder, monkeypatch, on):
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


def test_a_dash_is_the_standard_output_even_if_a_folder_has_this_name(folder):
    (folder / "-").mkdir()
    check_output("-", force=False)
