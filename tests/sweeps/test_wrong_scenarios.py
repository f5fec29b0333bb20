"""Invalid sweeps give one error line with the value and its place, and no file.

Valid tables in other notations are accepted.
"""

import datetime as dt
import decimal
import json

import pytest

from aosplan.cli.app import run
from aosplan.sweeps.scenarios import read_scenarios

pl = pytest.importorskip("polars")
pytestmark = pytest.mark.usefixtures("folder")


@pytest.fixture
def refused(folder, capsys):
    """Sweep an invalid file, check that nothing is written, and return the error line."""

    def execute(path):
        before = sorted(folder.iterdir())
        assert run(["sweep", path, "--out", "r.csv"]) == 2
        out, err = capsys.readouterr()
        assert out == ""
        first, *rest = err.splitlines()
        assert first.startswith("error: ")
        assert path in first
        assert len(rest) == 0 or (len(rest) == 1 and rest[0].startswith("hint: "))
        assert sorted(folder.iterdir()) == before
        return err

    return execute


CROSSINGS = [
    ("altitud = 40", ["unknown name 'altitud'", "did you mean altitude?"]),
    ("", ["[sweep] is empty"]),
    ("altitude = 40\nvhat = []", ["vhat has no values"]),
    ("altitude = { file = 'empty.txt' }", ["altitude has no values"]),
    ("altitude = { file = 'text.txt' }", ["altitude 'fifty'"]),
    ("altitude = [40, nan]", ["altitude 'nan'"]),
    ("altitude = [40, inf]", ["altitude 'inf'"]),
    ("altitude = [40, -inf]", ["altitude '-inf'"]),
    ("altitude = [40, true]", ["altitude 'True'"]),
    ("altitude = [40, 'high']", ["altitude 'high'"]),
    ("altitude = [40, [50]]", ["altitude '[50]'"]),
    ("altitude = [2020-01-01]", ["altitude", "2020"]),
    ("altitude = 12:00:00", ["altitude", "12"]),
    ("altitude = [{ start = 1 }]", ["altitude", "start"]),
    ("altitude = 40\nsensitivity = [1]", ["sensitivity '1' is not true or false"]),
    ("altitude = 40\nscene = [3]", ["scene '3' is not a name"]),
    ("altitude = 40\nvhat = [0.9, 98]", ["vhat '98'", "write 98%"]),
    ("altitude = 40\ngrid = ['trimmed', 'hexagon']", ["grid 'hexagon' is not one of"]),
    ("altitude = 40\naltitude = 50", ["is not valid TOML", "line 3"]),
    ("altitude = { start = 1, stop = 2, count = 0 }", ["altitude.count '0'"]),
    ("altitude = { start = 1, stop = 2, count = 1.5 }", ["altitude.count '1.5'"]),
    ("altitude = { start = nan, stop = 2, count = 2 }", ["altitude.start 'nan'"]),
    ("altitude = { start = 1, stop = 2, count = 2, spacing = 'cubic' }", ["altitude.spacing 'cubic'"]),
]  # fmt: skip


@pytest.mark.parametrize(("content", "words"), CROSSINGS)
def test_wrong_crossings_give_an_error_of_one_line(folder, refused, content, words):
    (folder / "empty.txt").write_text("\n \n")
    (folder / "text.txt").write_text("40\nfifty\n")
    (folder / "s.toml").write_text(f"[sweep]\n{content}\n")
    error = refused("s.toml")
    assert all(word in error for word in words), error


TABLES = [
    (b"", ["empty"]),
    (b"altitude,vhat\n", ["no rows"]),
    (b"altitude,samples\n40,10\n50,6x4\n", ["column 'samples'", "'6x4'", "(row 2)"]),
    (b"altitude;vhat\n40;0,9\n", ["separated by semicolons", "decimal points"]),
    (b"altitude\tvhat\n40\t0.9\n", ["separated by tabs"]),
    (b'altitude,vhat\n40,"0,9"\n', ["column 'vhat'", "'0,9'", "(row 1)"]),
    (b"altitude,vhat,altitude\n40,0.9,50\n", ["two columns 'altitude'"]),
    (b"altitude, vhat\n40, 0.9\n", ["column ' vhat'", "did you mean vhat?"]),
    (b"Altitude\n40\n", ["column 'Altitude'", "did you mean altitude?"]),
    (b"altitude,max-samples\n40,9\n", ["'max-samples'", "did you mean max_samples?"]),
    (b"altitude,\n40,1\n", ["column ''"]),
    (b"40,0.9\n50,0.8\n", ["column '40' is not an option"]),
    (b"altitude,vhat\n40,0.9,7\n", ["not a table", "more fields"]),
    (b"altitude\n40\nnan\n", ["'nan'", "(row 2)"]),
    (b"altitude\ninf\n", ["'inf'", "(row 1)"]),
    (b"altitude\ntrue\n", ["'true'", "(row 1)"]),
    (b"altitude\n2020-01-01\n", ["'2020-01-01'"]),
    (b"altitude,scene\n40,\xe9\n", ["not a table", "utf-8"]),
    (b"\xff\xfea", ["is not an option"]),
    (b"altitude,\n40,0.9\n", ["column ''"]),
    (b'altitude,vhat\n"40,0.9\n50,0.8\n', ["not a table"]),
    (b"PK\x03\x04" + bytes(100), ["is a spreadsheet", "CSV or Parquet"]),
]


@pytest.mark.parametrize(("content", "words"), TABLES)
def test_wrong_tables_give_an_error_of_one_line(folder, refused, content, words):
    (folder / "s.csv").write_bytes(content)
    error = refused("s.csv")
    assert all(word in error for word in words), error


def test_a_header_of_a_million_columns_is_not_read(folder, refused, monkeypatch):
    (folder / "s.csv").write_text(",".join(f"c{place}" for place in range(10**6)) + "\n1\n")
    monkeypatch.delattr(pl, "read_csv")
    assert "header is longer than" in refused("s.csv")


@pytest.mark.parametrize("suffix", ["toml", "csv", "parquet"])
def test_paths_that_are_not_files_are_refused(folder, refused, suffix):
    assert f"no file 's.{suffix}'" in refused(f"s.{suffix}")
    (folder / f"s.{suffix}").mkdir()
    assert "is a folder, not a file" in refused(f"s.{suffix}")


@pytest.mark.parametrize("name", ["s.xlsx", "s.XLS", "s.ods", "s.parquet"])
def test_spreadsheets_are_refused_and_called_spreadsheets(folder, refused, name):
    (folder / name).write_bytes(b"PK\x03\x04" + bytes(range(256)))
    assert "is a spreadsheet" in refused(name)


@pytest.mark.parametrize("content", [b"", b"PAR1 not really", b"PAR1" + bytes(20) + b"PAR1"])
def test_a_file_that_is_not_parquet_is_an_error(folder, refused, content):
    (folder / "s.parquet").write_bytes(content)
    assert "is not a table of scenarios" in refused("s.parquet")


def frames():
    """Columns that are not valid for any scenario, and words of the error message."""
    return [
        ({"height": [40.0]}, ["column 'height' is not an option"]),
        ({"altitude": pl.Series([], dtype=pl.Float64)}, ["no rows"]),
        ({"altitude": [40.0, float("nan")]}, ["column 'altitude': 'nan'", "(row 2)"]),
        ({"altitude": [True]}, ["'True'", "(row 1)"]),
        ({"altitude": [dt.date(2020, 1, 1)]}, ["2020", "(row 1)"]),
        ({"altitude": [dt.timedelta(1)]}, ["timedelta", "(row 1)"]),
        ({"altitude": [[40.0, 50.0]]}, ["'40.0,50.0'", "(row 1)"]),
        ({"altitude": [{"a": 40.0}]}, ["'{'a': 40.0}'", "(row 1)"]),
        ({"altitude": ["40", "high"]}, ["'high'", "(row 2)"]),
    ]


@pytest.mark.parametrize("place", range(len(frames())))
def test_parquet_files_that_are_not_sweeps_are_refused(folder, refused, place):
    columns, words = frames()[place]
    pl.DataFrame(columns).write_parquet(folder / "s.parquet")
    error = refused("s.parquet")
    assert all(word in error for word in words), error


# Other notations


def values(path):
    return {name: column.tolist() for name, column in read_scenarios(path).values.items()}


@pytest.mark.parametrize(
    "content",
    [
        b"\xef\xbb\xbfaltitude,vhat\n40,0.9\n50,\n",
        b"altitude,vhat\r\n40,0.9\r\n50,\r\n",
        b'"altitude","vhat"\n"40","0.9"\n"50",""\n',
        b"altitude,vhat\n40.0,0.90\n5e1\n",
        b"altitude,vhat\n40 m,90%\n50,",
    ],
)
def test_variants_of_csv_files_are_read(folder, content):
    (folder / "s.csv").write_bytes(content)
    assert values("s.csv") == {"altitude": [40.0, 50.0], "vhat": [0.9, None]}


def test_rows_without_holes_are_solved_beside_rows_with_them(folder):
    # The first row has no empty field, but the types of its columns are those of the whole table.
    (folder / "s.csv").write_text("altitude,vhat,samples\n40,0.9,20\n50,0.9,\n,0.9,\n")
    assert run(["sweep", "s.csv", "--out", "r.jsonl"]) == 0
    rows = [json.loads(line) for line in (folder / "r.jsonl").read_text().splitlines()]
    assert [(row["samples"], row["status"]) for row in rows] == [
        (20, "ok"),
        (10, "ok"),
        (None, "invalid"),
    ]


def arrow_columns(pa):
    return {
        "int32": pa.array([40, 50], pa.int32()),
        "uint8": pa.array([40, 50], pa.uint8()),
        "float32": pa.array([40, 50], pa.float32()),
        "decimal": pa.array([decimal.Decimal(40), decimal.Decimal(50)], pa.decimal128(10, 2)),
        "dictionary": pa.array([40.0, 50.0]).dictionary_encode(),
        "text": pa.array(["40", "50"]),
        "large text": pa.array(["40", "50"], pa.large_string()),
        "dictionary of text": pa.array(["40", "50"]).dictionary_encode(),
    }


@pytest.mark.parametrize("compression", ["zstd", "snappy", "gzip", "none"])
def test_arrow_types_are_read(folder, compression):
    pa = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    for name, column in arrow_columns(pa).items():
        table = pa.table({"altitude": column})
        parquet.write_table(table, folder / "s.parquet", compression=compression)
        assert values("s.parquet") == {"altitude": [40.0, 50.0]}, name


def test_arrow_columns_with_gaps_and_lists_are_read(folder):
    pa = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    table = pa.table(
        {
            "altitude": pa.array([40.0, 50.0]),
            "samples": pa.array([None, 9], pa.int16()),
            "vhat": pa.array([None, None], pa.null()),
            "origin": pa.array([[48.0, 14.0], None], pa.list_(pa.float64())),
        }
    )
    parquet.write_table(table, folder / "s.parquet")
    assert values("s.parquet") == {
        "altitude": [40.0, 50.0],
        "samples": [None, 9],
        "vhat": [None, None],
        "origin": [(48.0, 14.0), None],
    }


def test_pandas_types_are_read(folder):
    pd = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    frame = pd.DataFrame(
        {
            "altitude": [40.0, 50.0],
            "samples": pd.array([None, 9], dtype="Int64"),
            "scene": pd.Categorical(["paper-forest", "conifer-forest"]),
        }
    )
    frame.to_parquet(folder / "s.parquet")
    assert values("s.parquet") == {
        "altitude": [40.0, 50.0],
        "samples": [None, 9],
        "scene": ["paper-forest", "conifer-forest"],
    }
    assert run(["sweep", "s.parquet", "--out", "r.csv", "--quiet"]) == 0


def test_a_parquet_file_with_an_index_of_pandas_is_refused_with_a_hint(folder, refused):
    pd = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    pd.DataFrame({"altitude": [40.0, 50.0]}, index=[3, 7]).to_parquet(folder / "s.parquet")
    assert "index=False" in refused("s.parquet")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize(
    "text",
    [
        "altitude,vhat\n40,0.9\n",
        "altitude,vhat,\n40,0.9,\n",
        "altitude,vhat,,\r\n,,,\r\n40,0.9,,\r\n,,,\r\n",
    ],
)
def test_blank_rows_and_trailing_commas_are_not_scenarios(folder, encoding, text):
    (folder / "s.csv").write_bytes(text.encode(encoding))
    table = read_scenarios("s.csv")
    assert (table.names, table.rows) == (["altitude", "vhat"], 1)
