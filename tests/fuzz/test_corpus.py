"""Damaged files of every kind that aosplan reads, found by the fuzzer.  Each gives one error line,
or if another photo is left, a warning that names the damaged photo.

Each line of ``corpus/commands.txt`` names a damaged file, the name of its copy in a folder with the
files of ``corpus/beside``, and the command that reads this copy.  To keep a file that
``test_readers.py`` has found, add the file and such a line.
"""

import shutil
from pathlib import Path

import pytest
from support.command_line import check_refusal
from support.fuzz_seeds import OUR_LINES

CORPUS = Path(__file__).parent / "corpus"
CASES = [line.split(" ", 2) for line in (CORPUS / "commands.txt").read_text().splitlines()]
NEEDS = {
    "las": "laspy", "laz": "lazrs", "tif": "rasterio", "png": "PIL", "jpg": "PIL", "kmz": "shapely",
    "parquet": "polars",
}  # fmt: skip


def test_every_file_of_the_corpus_has_a_command():
    files = {path.name for path in CORPUS.iterdir() if path.is_file()}
    assert files == {name for name, _, _ in CASES} | {"commands.txt"}


@pytest.mark.parametrize(("file", "name", "line"), CASES, ids=[case[0] for case in CASES])
def test_a_damaged_file_gives_one_error_line_or_is_left_out(folder, command, file, name, line):
    for needed in {NEEDS.get(name.rpartition(".")[2]), "PIL" if "integrate" in line else None} - {
        None
    }:
        pytest.importorskip(needed)
    here = folder / "here"
    shutil.copytree(CORPUS / "beside", here)
    shutil.copyfile(CORPUS / file, here / name)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(here)
        status, out, err = command(*line.split())
    assert "unexpected" not in err
    assert all(map(OUR_LINES.match, err.splitlines()))
    if file.endswith(".png"):
        assert status == 0
        assert "1 of 2 photos is damaged and left out: a.png" in err
        return
    errors = [text for text in err.splitlines() if text.startswith(("error", "hint"))]
    check_refusal(status, out, "".join(f"{text}\n" for text in errors))
