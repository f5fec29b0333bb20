"""Figures have accessible colours and reproducible files, and the command `figure` writes them."""

import itertools
import json
import subprocess
import sys
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from approved.make import planned, shown
from PIL import Image

from aosplan.cli.app import run
from aosplan.cli.schema import json_schema
from aosplan.show.figures.canvas import FigureStyle, rendered
from aosplan.show.figures.draw import KINDS
from aosplan.show.figures.grid import grid_of
from aosplan.show.figures.style import DARK, LEAST_CONTRAST, LEAST_STEP, LIGHT, plain
from aosplan.show.figures.tradeoff import tradeoff_of
from aosplan.show.figures.visibility import visibility_of

jsonschema = pytest.importorskip("jsonschema")
SVG = "{http://www.w3.org/2000/svg}"


# The colours


def luminance(colour):
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    return np.array([c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts])


WEIGHTS = np.array([0.2126, 0.7152, 0.0722])
# Machado, Oliveira and Fernandes (2009), severity 1: linear RGB for three kinds of colour
# blindness.
EYES = {
    "normal": np.eye(3),
    "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritan": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}  # fmt: skip


def lab(linear):
    xyz = np.array([[0.4124, 0.3576, 0.1805], WEIGHTS, [0.0193, 0.1192, 0.9505]]) @ linear
    x, y, z = (
        np.cbrt(v) if v > 0.008856 else 7.787 * v + 16 / 116 for v in xyz / [0.95047, 1, 1.08883]
    )
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def contrast(one, other):
    low, high = sorted(WEIGHTS @ luminance(colour) for colour in (one, other))
    return (high + 0.05) / (low + 0.05)


def test_contrast_is_that_of_wcag():
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.01)


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
def test_colours_stand_out_from_their_background(theme):
    assert contrast(theme.text, theme.background) >= 7.0
    assert contrast(theme.muted, theme.background) >= 4.5
    for colour in theme.data:
        assert contrast(colour, theme.background) >= LEAST_CONTRAST
        assert contrast(colour, theme.shade) >= 0.85 * LEAST_CONTRAST


@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
def test_colours_differ_for_colour_blind_readers_and_in_grey(theme, eye):
    seen = [lab(np.clip(np.array(EYES[eye]) @ luminance(c), 0, 1)) for c in theme.data]
    for one, other in itertools.combinations(seen, 2):
        assert np.linalg.norm(one - other) >= 20.0
    if eye == "normal":
        lightness = sorted(each[0] for each in seen)
        assert np.diff(lightness).min() >= LEAST_STEP


# The files


@pytest.mark.parametrize(
    ("kind", "form"),
    [
        ("baseline-curve", "svg"),
        ("grid", "png"),
        *(
            pytest.param(kind, form, marks=pytest.mark.slow)
            for kind, form in [
                *((kind, "svg") for kind in KINDS if kind != "baseline-curve"),
                ("correlogram", "pdf"),
            ]
        ),
    ],
)
def test_a_file_is_the_same_each_time(kind, form):
    first = rendered(KINDS[kind], shown(kind), form)
    assert first == rendered(KINDS[kind], shown(kind), form)


def test_figure_files_neither_use_nor_change_the_users_matplotlib_settings():
    import matplotlib as mpl

    first = rendered(KINDS["density"], shown("density"), "svg")
    with mpl.rc_context({"font.size": 20.0, "axes.facecolor": "red", "svg.hashsalt": "x"}):
        assert rendered(KINDS["density"], shown("density"), "svg") == first
        assert mpl.rcParams["font.size"] == 20.0


def test_an_svg_is_an_image_with_a_title_and_a_description():
    told = shown("baseline-curve")
    root = ET.fromstring(rendered(KINDS["baseline-curve"], told, "svg"))
    assert root.get("role") == "img"
    named = {
        child.get("id"): child.text for child in root if child.tag in (f"{SVG}title", f"{SVG}desc")
    }
    words = [named[name] for name in root.get("aria-labelledby").split()]
    assert words == [told.title, told.description()]


def test_a_png_and_a_pdf_say_what_they_show(tmp_path):
    path = tmp_path / "x.png"
    told = shown("baseline-curve")
    path.write_bytes(rendered(KINDS["baseline-curve"], told, "png"))
    with Image.open(path) as image:
        assert image.text["Description"] == told.description()
        assert image.text["Title"] == told.title
        assert "Software" not in image.text
    pdf = rendered(KINDS["density"], shown("density"), "pdf")
    assert shown("density").title.encode() in pdf
    assert b"CreationDate" not in pdf


@pytest.mark.parametrize(
    "look", [FigureStyle(), FigureStyle(DARK), FigureStyle(width_mm=150.0, dpi=100.0)]
)
def test_a_png_has_its_background_and_its_width(look, tmp_path):
    path = tmp_path / "x.png"
    path.write_bytes(rendered(KINDS["baseline-curve"], shown("baseline-curve"), "png", look))
    with Image.open(path) as image:
        assert image.width == pytest.approx(look.width_mm / 25.4 * look.dpi, abs=1.0)
        corner = image.convert("RGB").getpixel((0, image.height - 1))
    assert "#{:02x}{:02x}{:02x}".format(*corner) == look.theme.background


@pytest.mark.parametrize(
    "name",
    ["<script>alert('x')</script>", "a $ b $ \\frac שלום 森林 \x00\x07\ud800", "x" * 10_000],
)
@pytest.mark.parametrize(
    "form",
    [
        "svg",
        pytest.param("png", marks=pytest.mark.slow),
        pytest.param("pdf", marks=pytest.mark.slow),
    ],
)
def test_names_in_figures_are_shown_as_plain_text(name, form, tmp_path):
    hostile = shown("density")._replace(scene=name)
    content = rendered(KINDS["density"], hostile, form)
    if form == "svg":
        root = ET.fromstring(content)
        assert "script" not in {element.tag.rpartition("}")[2] for element in root.iter()}
        if name.startswith("<"):
            assert name in root.find(f"{SVG}title").text


def test_dollar_signs_are_not_read_as_mathematics():
    assert plain("5 $ or 6 $") == r"5 \$ or 6 \$"


@pytest.mark.parametrize(
    ("changed", "kinds"),
    [
        ({"samples": 1, "baseline": 2.0}, {"visibility": visibility_of, "grid": grid_of}),
        ({"vhat": 0}, {"tradeoff": tradeoff_of}),
        ({"samples": 2, "baseline": 1.0}, {"grid": grid_of}),
    ],
)
def test_the_smallest_plans_have_figures(changed, kinds):
    for kind, of in kinds.items():
        assert rendered(KINDS[kind], of(planned(max_samples=9, **changed)), "svg")


# The command


@pytest.mark.parametrize(
    ("line", "ending"),
    [
        ("visibility --altitude 40", None),
        ("trade-off --altitude 40 --vhat 0.8 --max-samples 20", None),
        ("grid --altitude 40", "svg"),
        ("density paper-forest", "png"),
        ("baseline-curve paper-forest --altitude 40", "pdf"),
    ],
)
def test_the_command_writes_a_figure_and_its_words(line, ending, tmp_path, capsys):
    path = tmp_path / f"figure.{ending}"
    out = ["--out", str(path)] if ending else []
    assert run(["plot", *line.split(), *out, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    jsonschema.validate(told, json_schema("figure"))
    if ending:
        assert path.read_bytes()[:4] == {"png": b"\x89PNG", "svg": b"<?xm", "pdf": b"%PDF"}[ending]
    assert run(["plot", *line.split()]) == 0
    assert capsys.readouterr().out.splitlines() == [told["description"], "Next: --out figure.png"]


def test_a_saved_plan_is_drawn_as_it_was(tmp_path, capsys):
    assert run(["plan", "--altitude", "40", "--heading", "20", "--json"]) == 0
    saved = json.loads(capsys.readouterr().out)
    (tmp_path / "plan.json").write_text(json.dumps(saved))
    for kind in ("visibility", "grid", "density"):
        assert run(["plot", kind, str(tmp_path / "plan.json"), "--json"]) == 0
        told = json.loads(capsys.readouterr().out)["data"]
        if kind == "visibility":
            assert told["normalized"] == saved["visibility"]["normalized"]
        if kind == "grid":
            assert told["heading_deg"] == 20.0


WRONG = """
plot pie --altitude 40 | unknown kind of figure 'pie' |
plot visibilty --altitude 40 | unknown kind of figure 'visibilty' | did you mean visibility?
plot grid --altitude 40 --out grid.gif | figure 'grid.gif' does not have one of the extensions .png, .svg, .pdf |
plot grid --altitude 40 --out - | figure '-' does not have one of the extensions .png, .svg, .pdf |
plot grid --altitude 40 --out nowhere/grid.svg | there is no folder 'nowhere' | create this folder first
plot grid --altitude 40 --dpi 1e9 | --dpi 1e+09 is not from 50 to 1200 |
plot grid --altitude 40 --width-mm -3 | --width-mm |
plot grid --altitude 40 --width-mm 90 | --width-mm 90 is not from 140 to 1000 |
plot grid --altitude 40 --width-mm 1000 --dpi 1200 | million pixels | .svg or .pdf
plot grid | altitude |
plot density | no scene is given | preset
plot density paper-forest --scene conifer-forest | give only one of them |
plot density no-such-forest | unknown scene 'no-such-forest' |
plot correlogram paper-forest | has neither a correlogram | point cloud
plot visibility --altitude 40 --density 0 --occluder-size 0.2 --volume-height 9 | no occluder is above |
plot density --density 0 --occluder-size 0.2 --volume-height 9 | no occluder is above |
"""


@pytest.mark.parametrize("case", WRONG.strip().splitlines())
def test_invalid_figure_requests_give_one_error_line(case, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    line, words, hint = (part.strip() for part in case.split("|"))
    assert run(line.split()) == 2
    out, err = capsys.readouterr()
    assert out == ""
    first, *rest = [text for text in err.splitlines() if not text.startswith("warning:")]
    assert first.startswith("error: ")
    assert words in first + " ".join(rest)
    assert hint in " ".join(rest)
    assert list(tmp_path.iterdir()) == []


def test_an_existing_figure_stays_unless_forced(tmp_path, capsys):
    path = tmp_path / "x.svg"
    path.write_text("mine")
    line = ["plot", "density", "paper-forest", "--out", str(path), "--quiet"]
    assert run(line) == 2
    assert path.read_text() == "mine"
    assert run([*line, "--force"]) == 0
    assert path.read_text().startswith("<?xml")


def test_descriptions_and_numbers_need_no_matplotlib():
    code = (
        "import sys\nfrom aosplan.cli.app import run\n"
        "assert run(['plot', 'visibility', '--altitude', '40', '--json']) == 0\n"
        "assert 'matplotlib' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, timeout=60)


def test_without_matplotlib_there_is_a_hint(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    assert run(["plot", "density", "paper-forest", "--out", str(tmp_path / "x.png")]) == 2
    err = capsys.readouterr().err
    assert "needs the optional extra 'figures'" in err
    assert 'pip install "aosplan[figures]"' in err


def test_figures_use_the_users_own_defaults(tmp_path, capsys):
    (tmp_path / "own.toml").write_text("vhat = 0.9\n")
    told = []
    for more in ([], ["--defaults", str(tmp_path / "own.toml")], ["--defaults", "none"]):
        assert run(["plot", "visibility", "--altitude", "40", *more, "--json"]) == 0
        told.append(json.loads(capsys.readouterr().out)["data"]["samples"])
    assert told == [50, 10, 50]
