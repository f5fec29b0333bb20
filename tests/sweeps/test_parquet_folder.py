"""A result in a folder of parts is either complete or missing, and is repaired if it was
damaged.
"""

import json
import os
import shutil
from pathlib import Path

import pytest
from support.campaigns import contents, sweep

from aosplan.sweeps import run as run_module
from aosplan.sweeps import scenarios as scenarios_module

pl = pytest.importorskip("polars")

CAMPAIGN = """
[sweep]
altitude = { start = 10, stop = 120, count = 12 }
vhat = [0.9, "98%"]
density = { start = 0.001, stop = 0.02, count = 4, spacing = "log" }
occluder_size = 0.2
volume_height = 15
"""
NAMES = [f"part-0000{index}.parquet" for index in range(4)]


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    monkeypatch.setattr(scenarios_module, "ROWS_A_BLOCK", 25)


@pytest.fixture
def campaign(tmp_path):
    path = tmp_path / "campaign.toml"
    path.write_text(CAMPAIGN, encoding="utf-8")
    return path


@pytest.fixture
def solved(monkeypatch):
    """A list of the indices of parts, in the order in which they are solved."""
    solve, places = run_module.solve_part, []

    def noted(sweep, index, *rest):
        places.append(index)
        return solve(sweep, index, *rest)

    monkeypatch.setattr(run_module, "solve_part", noted)
    return places


def test_a_folder_result_has_the_rows_of_a_file_and_no_other_files(campaign, tmp_path):
    folder, file = tmp_path / "r.parquet", tmp_path / "whole.parquet"
    assert sweep(campaign, "--out", f"{folder}/") == 0
    assert sweep(campaign, "--out", file) == 0
    assert sorted(os.listdir(folder)) == NAMES
    assert sorted(os.listdir(tmp_path)) == [
        "campaign.toml", "r.parquet", "r.parquet.journal.jsonl", "whole.parquet"
    ]  # fmt: skip
    whole = pl.read_parquet(file)
    assert whole.height == 96
    for source in (folder, f"{folder}/", f"{folder}/*.parquet"):
        assert pl.read_parquet(source).equals(whole)


def test_conditions_keep_rows_of_every_part(campaign, tmp_path):
    folder = tmp_path / "results"
    assert sweep(campaign, "--out", f"{folder}/", "--where", "altitude > 100") == 0
    assert sorted(os.listdir(folder)) == NAMES
    assert pl.read_parquet(folder)["altitude"].unique().to_list() == [110.0, 120.0]


@pytest.mark.parametrize("damage", ["truncated", "turned", "gone"])
def test_only_a_damaged_part_is_written_again(campaign, tmp_path, solved, damage):
    folder = tmp_path / "r.parquet"
    assert sweep(campaign, "--out", f"{folder}/") == 0
    before = contents(folder)
    journal = (tmp_path / "r.parquet.journal.jsonl").read_bytes()
    solved.clear()
    assert sweep(campaign, "--out", folder, "--resume") == 0
    assert solved == []
    part = folder / NAMES[2]
    if damage == "gone":
        part.unlink()
    elif damage == "truncated":
        part.write_bytes(before[NAMES[2]][:-7])
    else:
        turned = bytearray(before[NAMES[2]])
        turned[100] ^= 1
        part.write_bytes(turned)
    assert sweep(campaign, "--out", folder, "--resume") == 0
    assert solved == [2]
    assert contents(folder) == before
    assert (tmp_path / "r.parquet.journal.jsonl").read_bytes() == journal


def test_a_result_folder_appears_only_when_it_is_complete(campaign, tmp_path, monkeypatch):
    whole, folder = tmp_path / "whole", tmp_path / "r"
    assert sweep(campaign, "--out", f"{whole}/") == 0
    solve = run_module.solve_part

    def interrupted(sweep, index, *rest):
        if index == 2:
            raise KeyboardInterrupt
        return solve(sweep, index, *rest)

    with monkeypatch.context() as patch:
        patch.setattr(run_module, "solve_part", interrupted)
        assert sweep(campaign, "--out", f"{folder}/") == 130
    assert not folder.exists()
    # The result exists, and neither --resume nor --force is given.
    assert sweep(campaign, "--out", f"{folder}/") == 2
    # The interrupted run has left an incomplete line in the journal, and incomplete files.
    with (tmp_path / "r.journal.jsonl").open("a") as journal:
        journal.write('{"part": 2, "ro')
    (tmp_path / "r.parts" / f"part-00002.parquet.{'0' * 32}.tmp").write_bytes(b"PAR1")
    (tmp_path / "r.parts" / f"writing-{'0' * 32}").mkdir()
    assert sweep(campaign, "--out", f"{folder}/", "--resume") == 0
    assert contents(folder) == contents(whole)
    assert not (tmp_path / "r.parts").exists()
    notes = [json.loads(line) for line in (tmp_path / "r.journal.jsonl").read_text().splitlines()]
    assert [note.get("part") for note in notes] == [None, 0, 1, 2, 3]


def test_a_part_that_vanishes_while_others_are_written_is_an_error(
    campaign, tmp_path, monkeypatch, capsys
):
    solve = run_module.solve_part

    def thief(sweep, index, path, *rest):
        if index == 3:
            (tmp_path / "r.parts" / NAMES[1]).unlink()
        return solve(sweep, index, path, *rest)

    monkeypatch.setattr(run_module, "solve_part", thief)
    assert sweep(campaign, "--out", f"{tmp_path}/r/") == 1
    assert NAMES[1] in capsys.readouterr().err
    monkeypatch.undo()
    monkeypatch.setattr(scenarios_module, "ROWS_A_BLOCK", 25)
    assert sweep(campaign, "--out", f"{tmp_path}/r/", "--resume") == 0
    assert sorted(os.listdir(tmp_path / "r")) == NAMES


def test_an_earlier_folder_stays_unless_forced(campaign, tmp_path, capsys):
    folder = tmp_path / "r"
    assert sweep(campaign, "--out", f"{folder}/") == 0
    before = contents(folder)
    assert sweep(campaign, "--out", folder) == 2
    assert "exists" in capsys.readouterr().err
    campaign.write_text(CAMPAIGN.replace("120", "130"), encoding="utf-8")
    assert sweep(campaign, "--out", folder, "--resume") == 2
    assert "another sweep" in capsys.readouterr().err
    assert contents(folder) == before
    assert sweep(campaign, "--out", folder, "--force") == 0
    assert contents(folder).keys() == before.keys()
    assert contents(folder) != before
    (tmp_path / "r.journal.jsonl").unlink()
    assert sweep(campaign, "--out", folder, "--resume") == 2
    assert "has no journal" in capsys.readouterr().err


def test_files_created_during_a_sweep_are_not_changed(campaign, tmp_path, monkeypatch, capsys):
    solve, folder = run_module.solve_part, tmp_path / "r"

    def other(sweep, index, *rest):
        if index == 3:
            folder.mkdir()
            (folder / NAMES[0]).write_text("another's")
        return solve(sweep, index, *rest)

    monkeypatch.setattr(run_module, "solve_part", other)
    assert sweep(campaign, "--out", f"{folder}/") == 2
    assert "exists" in capsys.readouterr().err
    assert contents(folder) == {NAMES[0]: b"another's"}
    monkeypatch.undo()
    monkeypatch.setattr(scenarios_module, "ROWS_A_BLOCK", 25)
    assert sweep(campaign, "--out", folder, "--resume", "--force") == 0
    assert sorted(contents(folder)) == NAMES
    assert sorted(os.listdir(tmp_path)) == ["campaign.toml", "r", "r.journal.jsonl"]


def test_an_earlier_folder_remains_complete_until_it_is_replaced(campaign, tmp_path, monkeypatch):
    folder = tmp_path / "r"
    assert sweep(campaign, "--out", f"{folder}/") == 0
    before = contents(folder)
    replaced, remove = [], shutil.rmtree

    def watched(path, *arguments, **named):
        if str(path).endswith(".earlier"):
            replaced.append((contents(Path(path)), sorted(contents(folder))))
        remove(path, *arguments, **named)

    monkeypatch.setattr(shutil, "rmtree", watched)
    assert sweep(campaign, "--out", folder, "--force") == 0
    assert replaced == [(before, NAMES)]


@pytest.mark.parametrize("ending", ["", ".csv"])
def test_a_link_is_kept_and_its_target_is_replaced(campaign, tmp_path, ending):
    there, link = tmp_path / "there" / f"r{ending}", tmp_path / f"link{ending}"
    there.parent.mkdir()
    assert sweep(campaign, "--out", there if ending else f"{there}/") == 0
    before = there.read_bytes() if ending else contents(there)
    link.symlink_to(there)
    campaign.write_text(CAMPAIGN.replace("120", "130"), encoding="utf-8")
    assert sweep(campaign, "--out", link, "--force") == 0
    assert link.is_symlink()
    assert (there.read_bytes() if ending else contents(there)) != before
    assert sorted(os.listdir(tmp_path)) == ["campaign.toml", link.name, "there"]


@pytest.mark.parametrize("force", [[], ["--force"], ["--resume"]])
def test_files_that_no_sweep_wrote_are_not_changed(campaign, tmp_path, capsys, force):
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "thesis.txt").write_text("mine")
    assert sweep(campaign, "--out", tmp_path / "data", *force) == 2
    assert "thesis.txt" in capsys.readouterr().err
    assert contents(tmp_path / "data") == {"thesis.txt": b"mine"}
    assert sorted(os.listdir(tmp_path)) == ["campaign.toml", "data"]


@pytest.mark.parametrize(
    ("out", "arguments", "words"),
    [
        ("r.csv/", [], ["contains Parquet files"]),
        ("none/r/", [], ["no folder", "none"]),
        ("campaign.toml/", [], ["is a file"]),
        ("r/", ["--best", "samples"], ["--best", "best.parquet"]),
        ("results", [], ["does not have one of the extensions", "for a folder of Parquet files"]),
    ],
)
def test_wrong_folders_are_errors(campaign, tmp_path, capsys, out, arguments, words):
    assert sweep(campaign, "--out", f"{tmp_path}/{out}", *arguments) == 2
    error = capsys.readouterr().err
    assert all(word in error for word in words), error
    assert os.listdir(tmp_path) == ["campaign.toml"]


def test_every_part_has_the_types_of_the_whole(tmp_path):
    # In the first part, these columns are empty. The column heading has a number in the second part
    # and text in the last.
    path, rows = tmp_path / "rows.csv", []
    for row in range(75):
        heading = ("", "12.5", "best")[row // 25]
        rows.append(
            f"{30 + row},{'' if row < 30 else 'square'},{heading},{'' if row < 30 else 50.5}"
        )
    path.write_text("\n".join(["altitude,grid,heading,max_aperture", *rows, ""]))
    assert sweep(path, "--out", f"{tmp_path}/r/") == 0
    assert sweep(path, "--out", tmp_path / "r.parquet") == 0
    frame = pl.read_parquet(tmp_path / "r.parquet")
    assert pl.read_parquet(tmp_path / "r").equals(frame)
    assert frame.dtypes[:4] == [pl.Float64, pl.String, pl.String, pl.Float64]
    assert frame["heading"][::25].to_list() == [None, "12.5", "best"]


def test_an_empty_folder_is_filled(campaign, tmp_path):
    (tmp_path / "r").mkdir()
    assert sweep(campaign, "--out", tmp_path / "r") == 0
    assert sorted(os.listdir(tmp_path / "r")) == NAMES
