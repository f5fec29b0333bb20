"""Output and files of commands, and the files that remain if a command fails."""

import csv
import io
import math
import os

import pytest
from support.command_line import check_refusal, loads

from aosplan.cli.output import print_json
from aosplan.errors import RequestError

WIDE = "--allow-no-common-ground"
"""Option that allows apertures wider than the footprint, with a warning."""


def test_out_writes_a_file_and_reports_it(folder, command):
    status, out, err = command(
        "plan", "--altitude=40", "--origin=48,14", "--out=a.csv", "--out=b.geojson"
    )
    assert (status, err) == (0, "")
    assert "Wrote a.csv, b.geojson" in out
    assert {path.name for path in folder.iterdir()} == {"a.csv", "b.geojson"}


def test_out_with_json_prints_one_document_and_writes_the_file(folder, document):
    result = document("plan", "--altitude", "40", "--out", "a.csv")
    rows = list(csv.DictReader(io.StringIO((folder / "a.csv").read_text())))
    assert len(rows) == result["samples"]


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_json_never_contains_nan_or_infinity(capsys, value):
    with pytest.raises(RequestError, match="too large for a number"):
        print_json({"a": value})
    assert capsys.readouterr().out == ""


def test_output_to_a_dash_is_the_only_text_on_stdout(command):
    for arguments in (["--out", "csv:-"], ["--out", "-", "--format", "csv"]):
        status, out, err = command("plan", "--altitude", "40", *arguments)
        assert (status, err) == (0, "")
        rows = list(csv.DictReader(io.StringIO(out)))
        assert len(rows) == 50
        assert set(rows[0]) == {"index", "east_m", "north_m", "altitude_m"}


def test_warnings_are_not_printed_on_stdout(command):
    status, out, err = command("plan", "--altitude", "40", "--grid", "line", WIDE, "--out", "csv:-")
    assert status == 0
    assert out.count("\n") == 51
    assert err.startswith("warning: no ground is in all photos")


def test_an_existing_output_is_kept_without_force(folder, command):
    (folder / "a.csv").write_text("old")
    check_refusal(*command("plan", "--altitude", "40", "--out", "a.csv"))
    assert (folder / "a.csv").read_text() == "old"
    status, _, _ = command("plan", "--altitude", "40", "--out", "a.csv", "--force")
    assert status == 0
    assert (folder / "a.csv").read_text().startswith("index,")


def test_one_existing_output_prevents_all_outputs(folder, command):
    (folder / "b.csv").write_text("old")
    check_refusal(*command("plan", "--altitude", "40", "--out", "a.csv", "--out", "b.csv"))
    assert {path.name: path.read_text() for path in folder.iterdir()} == {"b.csv": "old"}


def test_one_file_is_not_written_twice_under_two_names(folder, command):
    arguments = ["--out", "csv:a", "--out", "geojson:./a", "--force", "--origin=48,14"]
    check_refusal(*command("plan", "--altitude", "40", *arguments))
    assert list(folder.iterdir()) == []


def test_special_files_are_never_replaced(folder, command):
    # --force once replaced a device by an ordinary file, for all users of the machine.
    os.mkfifo("pipe")
    status, _, err = command("plan", "--altitude", "40", "--out", "csv:pipe", "--force")
    assert status in (1, 2), err
    assert (folder / "pipe").is_fifo()


def test_an_infeasible_plan_leaves_no_file(folder, command):
    check_refusal(
        *command("plan", "--altitude", "40", "--max-aperture", "5", "--out", "a.csv", "--force")
    )
    assert list(folder.iterdir()) == []


def test_a_full_disk_gives_status_1_and_leaves_no_files(folder, command, monkeypatch):
    def full(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    failed = command("plan", "--altitude", "40", "--out", "a.csv")
    check_refusal(*failed, expected=1)
    assert "a.csv" in failed[2]
    assert "no space left" in failed[2]
    assert list(folder.iterdir()) == []


def test_a_missing_permission_ends_with_status_1(command, monkeypatch):
    def refuse(*arguments, **words):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("tempfile.mkstemp", refuse)
    check_refusal(*command("plan", "--altitude", "40", "--out", "a.csv"), expected=1)


def test_ctrl_c_causes_no_traceback(command, monkeypatch):
    def interrupt(handle):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupt)
    status, _, err = command("plan", "--altitude", "40", "--out", "a.csv")
    assert status == 130
    assert "Traceback" not in err


@pytest.mark.parametrize("more", [[], ["--grid", "line", WIDE], ["--out", "a.csv"]])
def test_quiet_prints_nothing(command, more):
    assert command("plan", "--altitude", "40", "--quiet", *more) == (0, "", "")


def test_quiet_does_not_silence_json(command):
    status, out, err = command(
        "plan", "--altitude", "40", "--grid", "line", WIDE, "--json", "--quiet"
    )
    assert (status, err) == (0, "")
    assert loads(out)["samples"] == 50


def test_quiet_does_not_silence_errors(command):
    check_refusal(*command("plan", "--altitude", "10", "--quiet"))
