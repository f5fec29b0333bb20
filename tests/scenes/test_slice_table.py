"""Tables of slices: valid tables give the scene that they describe, and other tables give one clear
error.
"""

import pytest

from aosplan.errors import RequestError
from aosplan.planning.planner import plan
from aosplan.planning.request import PlanRequest
from aosplan.scenes.files.slice_table import read_slices
from aosplan.scenes.scene import Layer

HEADER = "bottom_m,top_m,density,occluder_size_m"
GOOD = f"{HEADER}\n2,4,0.02,0.3\n4,6.5,5%,0.25\n"
LAYERS = (Layer(2.0, 4.0, 0.02, 0.3), Layer(4.0, 6.5, 0.05, 0.25))


@pytest.fixture
def table(tmp_path):
    def write(content):
        path = tmp_path / "slices.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return str(path)

    return write


@pytest.mark.parametrize(
    "text",
    [
        GOOD,
        GOOD.replace("\n", "\r\n"),
        "\ufeff" + GOOD,
        GOOD + "\n,,,\n\n",
        f"{HEADER}\n4,6.5,5%,0.25\n2,4,0.02,0.3\n",
        "comment,Top_M,occluder_size_m, bottom_m ,density\nx,4 m,0.3,2,0.02\ny,6.5,.25,4.0,5 %\n",
        f'{HEADER}\n"2","4","0.02","0.3"\n4,6.5,0.05,0.25',
    ],
)
def test_a_table_is_a_layered_scene(table, text):
    assert read_slices(table(text)).layers == LAYERS


def test_other_units_of_length_are_converted(table):
    assert read_slices(table(GOOD.replace("2,4,", "2,13ft,"))).layers[0].top_m == 13 * 0.3048


def test_a_slice_table_can_be_planned(table):
    path = table(GOOD)
    result = plan(PlanRequest(altitude=40, scene=path, vhat=0.9))
    assert result.model == "layered"
    assert result.scene.integrated_density == pytest.approx(1 - 0.98 * 0.95)
    assert plan(PlanRequest(**result.request.document())).document() == result.document()


@pytest.mark.parametrize(
    ("text", "said", "hint"),
    [
        ("", "no header line", "bottom_m,top_m"),
        (HEADER, "a header but no slices", ""),
        ("2,4,0.02,0.3\n", "no column bottom_m", "must have the columns"),
        (GOOD.replace(",", ";"), "by semicolons", "commas"),
        (GOOD.replace(",", "\t"), "by tabs", "commas"),
        (GOOD.replace("0.02", "dense"), "line 2, density 'dense'", ""),
        (GOOD.replace("0.25", ""), "line 3, occluder_size_m ''", ""),
        (GOOD.replace("6.5", "nan"), "line 3, top_m 'nan'", ""),
        (GOOD.replace("6.5", "1e999"), "line 3, top_m '1e999'", ""),
        (GOOD.replace("0.02", "2"), "line 2, density '2'", "write 2%"),
        (GOOD.replace("2,4,", "2,13 leagues,"), "line 2, top_m '13 leagues'", ""),
        (GOOD.replace("2,4,", "-2,4,"), "line 2, bottom_m '-2'", ""),
        (GOOD.replace("6.5", "6,5"), "line 3 has 5 cells, but the header has 4", "decimal points"),
        (GOOD.replace("4,6.5", "3,6.5"), "layer 1: bottom_m 3 is below", ""),
        (GOOD.replace("top_m", "top_ft"), "no column top_m", "'top_ft' is similar"),
        (GOOD.replace("density", "density_percent"), "no column density", "density_percent"),
        (GOOD.replace("top_m", "bottom_m"), "two columns bottom_m", ""),
        (GOOD + '"2,4', "is not valid CSV", ""),
        (b"\xff\xfe\x00", "not UTF-16", ""),
        (b"\x00" * 100, "no column bottom_m", ""),
    ],
)
def test_faults_in_a_slice_table_are_named_with_their_place(table, text, said, hint):
    path = table(text)
    with pytest.raises(RequestError) as caught:
        read_slices(path)
    assert said in caught.value.message
    assert hint in caught.value.hint
    assert "\n" not in caught.value.message


def test_an_endless_slice_table_is_refused(table, monkeypatch):
    monkeypatch.setattr("aosplan.scenes.files.slice_table.MOST_SLICES", 5)
    with pytest.raises(RequestError, match="more than 5"):
        read_slices(table(HEADER + "\n2,4,0.02,0.3" * 9))


def test_options_of_clouds_are_refused(table):
    with pytest.raises(RequestError, match="--voxel needs a point cloud"):
        plan(PlanRequest(altitude=40, scene=table(GOOD), voxel=0.5))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize(
    "text",
    [
        "bottom_m,top_m,density,occluder_size_m,,\r\n2,4,5%,0.3,,\r\n,,,,,\r\n4,6,7%,0.3\r\n",
        "bottom_m,top_m,density,occluder_size_m\n2,4,5%,0.3,,\n\n,,\n4,6,7%,0.3,\n",
    ],
)
def test_blank_rows_and_trailing_commas_of_spreadsheets_are_passed_over(tmp_path, encoding, text):
    path = tmp_path / "slices.csv"
    path.write_bytes(text.encode(encoding))
    assert [tuple(layer)[2] for layer in read_slices(str(path)).layers] == [0.05, 0.07]
