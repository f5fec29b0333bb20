"""The report: tests of its content as text, and of its file.

`test_page_browser.py` opens the report in a real browser.
"""

import itertools
import json
import math
import re
import struct
from base64 import b64decode, b64encode
from hashlib import sha256
from html.parser import HTMLParser

import numpy as np
import pytest

from aosplan import PlanRequest, plan
from aosplan.cli.app import run
from aosplan.models.equations import visibility
from aosplan.show.page.charts import charts_of
from aosplan.show.page.height_profile import profile_of
from aosplan.show.page.number_text import short, spacing
from aosplan.show.page.page import check_extra, report_page

pytestmark = pytest.mark.usefixtures("folder")

VOID = {"meta", "input"}


class Page(HTMLParser):
    """The elements of a page in order, with the text in each.  It is checked that all elements are
    closed.
    """

    def __init__(self, content):
        super().__init__(convert_charrefs=True)
        self.elements, self.open = [], []
        self.feed(content.decode())
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        element = {"tag": tag, "text": "", **dict(attrs)}
        self.elements.append(element)
        if tag not in VOID and tag != "img":
            self.open.append(element)

    def handle_startendtag(self, tag, attrs):
        self.elements.append({"tag": tag, "text": "", **dict(attrs)})

    def handle_endtag(self, tag):
        assert self.open.pop()["tag"] == tag

    def handle_data(self, data):
        for element in self.open:
            element["text"] += data

    def of(self, tag, **attributes):
        return [
            element
            for element in self.elements
            if element["tag"] == tag and attributes.items() <= element.items()
        ]

    def json(self, name):
        (element,) = self.of("script", id=name)
        return json.loads(element["text"])

    def columns(self):
        """The columns of the waypoints, decoded."""
        unpacked = {}
        for element in self.of("script", **{"class": "column"}):
            packing, text = element["data-packing"], element["text"]
            if packing == "same":
                unpacked[element["data-name"]] = json.loads(text)
                continue
            content = b64decode(text, validate=True)
            form = f"<{len(content) // 8}d" if packing == "f8" else f"<{len(content)}?"
            unpacked[element["data-name"]] = list(struct.unpack(form, content))
        return unpacked


def at(document, place):
    """The value at a place of a document."""
    for name in place.split("."):
        document = document[int(name) if isinstance(document, list) else name]
    return document


@pytest.fixture(scope="module")
def default():
    return plan(PlanRequest(altitude=40))


@pytest.fixture(scope="module")
def content(default):
    return report_page(default)


@pytest.fixture(scope="module")
def page(content):
    return Page(content)


@pytest.fixture
def command(capfdbinary):
    def execute(*arguments):
        status = run([str(argument) for argument in arguments])
        out, err = capfdbinary.readouterr()
        return status, out, err.decode()

    return execute


# Content of the page


def test_ids_are_unique_and_everything_referred_to_is_there(page):
    ids = [element["id"] for element in page.elements if "id" in element]
    assert len(ids) == len(set(ids)) > 20
    for element in page.elements:
        for name in ("aria-labelledby", "aria-describedby", "for"):
            assert set(element.get(name, "").split()) <= set(ids)


def test_numbers_are_those_of_the_document(page, default):
    document = default.document()
    shown = page.of("data")
    assert len(shown) > 20
    for element in shown:
        assert json.loads(element["value"]) == at(document, element["data-of"])
    (samples,) = {e["text"] for e in shown if e["data-of"] == "samples"}
    (baseline,) = {e["text"] for e in shown if e["data-of"] == "baseline_m"}
    assert (samples, baseline) == ("50", "2.80 m")


def test_the_page_contains_document_and_waypoints_with_every_digit(page, default):
    document = default.document()
    waypoints = document.pop("waypoints")
    assert page.json("plan") == document
    columns = page.columns()
    assert set(columns) == set(waypoints[0]) - {"index"}
    for name, column in columns.items():
        values = column if isinstance(column, list) else [column] * len(waypoints)
        assert values == [waypoint[name] for waypoint in waypoints]


def test_turns_and_places_are_columns_as_well():
    request = PlanRequest(altitude=40, grid="lanes", trigger="distance", origin=(48.3, 14.3))
    turning = plan(request)
    columns = Page(report_page(turning, seed=None)).columns()
    rows = turning.document()["waypoints"]
    assert columns["photo"] == [row["photo"] for row in rows]
    assert columns["longitude"] == [row["longitude"] for row in rows]
    assert not all(columns["photo"])


def test_the_request_on_the_page_gives_the_same_plan(page, folder, command, default):
    for name in ("request-toml", "request-json"):
        (element,) = page.of("pre", id=name)
        file = folder / f"request.{name[8:]}"
        file.write_text(element["text"])
        status, out, err = command("plan", file, "--json")
        assert (status, err) == (0, "")
        assert json.loads(out) == default.document()


def test_the_page_loads_no_file_and_runs_only_its_own_script(page, content):
    (policy,) = (
        e["content"] for e in page.of("meta") if e.get("http-equiv") == "Content-Security-Policy"
    )
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == "'none'"
    assert rules["img-src"] == "data:"
    assert "unsafe" not in policy
    for tag, own in (
        ("script", [e for e in page.of("script") if "type" not in e]),
        ("style", page.of("style")),
    ):
        (element,) = own
        found = b64encode(sha256(element["text"].encode()).digest()).decode()
        assert rules[f"{tag}-src"] == f"'sha256-{found}'"
    assert not re.search(rb"https?://(?!www\.w3\.org)", content)
    assert not [e for e in page.elements if "style" in e or any(n.startswith("on") for n in e)]


def test_every_figure_says_what_it_shows(page):
    # There are two charts, and the map for browsers without scripts.
    assert len(page.of("svg")) == 3
    for picture in page.of("svg"):
        assert picture["role"] == "img"
    assert all(e["text"] for e in [*page.of("title"), *page.of("desc"), *page.of("figcaption")])
    assert len(page.of("img")) == 3
    assert all(e["alt"] for e in page.of("img"))
    assert all(e["aria-label"] for e in page.of("canvas"))
    assert all("scope" in e for e in page.of("th"))


def test_headings_go_down_one_step_at_a_time(page):
    levels = [int(e["tag"][1]) for e in page.elements if re.fullmatch(r"h\d", e["tag"])]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after - before <= 1 for before, after in itertools.pairwise(levels))


def test_limits_and_warnings_are_on_the_page():
    warned = plan(PlanRequest(altitude=40, samples=4, baseline=3.0))
    document = warned.document()
    assert document["warnings"]
    text = Page(report_page(warned, seed=None)).of("main")[0]["text"]
    for message in (*document["warnings"], *document["limits"]):
        assert message["message"] in text


# Curves


def test_curves_are_the_papers_equation(default):
    density = default.solution.prediction.density
    by_samples, by_baseline = charts_of(default)
    assert len(by_baseline.rows) > 20
    for baseline, normalized, expected in by_baseline.rows:
        # Below the baseline of the rule, the volume is treated as slices. V is then larger than
        # with a single d̂.
        dhat = baseline / default.coverage.baseline_m
        assert expected >= visibility(density, 7, 8, dhat) - 0.01
        assert expected == pytest.approx((1 - density) * (1 + density * normalized), rel=1e-12)
    squares = [row for row in by_samples.rows if math.isqrt(int(row[0])) ** 2 == row[0]]
    assert len(squares) > 3
    for samples, _, expected in squares:
        side = math.isqrt(int(samples))
        assert expected == pytest.approx(visibility(density, side, side, 1.0), rel=1e-12)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"grid": "spiral"},
        {"grid": "lanes"},
        {"model": "layered", "optimize": "time"},
        {"vhat": "99.9%", "allow_no_common_ground": True},
        {"samples": 2, "vhat": 0.4},
        {"baseline": 0.5},
        {"visibility": 0.6, "max_aperture": 20.0},
        pytest.param(
            {"rays": "oblique", "hold_error": 0.3, "vhat": 0.8},
            marks=pytest.mark.slow,
            id="oblique",
        ),
    ],
    ids=str,
)
def test_curves_pass_through_the_plan(options):
    own = plan(PlanRequest(altitude=40, **options))
    solution = own.solution
    charts = charts_of(own)
    assert charts
    for chart in charts:
        planned = solution.pattern.samples if chart.name == "samples" else solution.baseline_m
        prediction = solution.prediction
        assert [row for row in chart.rows if row[0] == planned] == [
            (planned, prediction.normalized, prediction.expected)
        ]
        x, normalized, expected = chart.chosen
        assert f"{x:.2f},{normalized:.2f}" in chart.normalized.split()
        assert f"{x:.2f},{expected:.2f}" in chart.expected.split()
        values = [float(pair.split(",")[0]) for pair in chart.normalized.split()]
        assert values == sorted(values)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({}, ["target V̂"]),
        ({"visibility": 0.6}, ["target V"]),
        ({"optimize": "contrast", "max_aperture": 15.0}, []),
        ({"optimize": "visibility", "max_samples": 9}, []),
    ],
)
def test_the_target_is_drawn_if_the_plan_has_one(options, words):
    for chart in charts_of(plan(PlanRequest(altitude=40, **options))):
        texts = [line.text for line in chart.levels]
        assert [text for text in texts if text.startswith("target")] == words
        assert {"∞ photos", "one photo"} <= set(texts)


def test_limits_are_drawn_at_their_values():
    bounded = plan(PlanRequest(altitude=40, vhat=0.9, max_aperture=8.0, max_samples=20))
    by_samples, by_baseline = charts_of(bounded)
    (limit,) = (limit for limit in bounded.limits if limit.quantity == "extent_m")
    widest = limit.bound / bounded.solution.pattern.longer_side
    assert widest == pytest.approx(bounded.solution.baseline_m)
    (line,) = (line for line in by_baseline.bounds if "--max-aperture" in line.text)
    assert line.place == pytest.approx(by_baseline.chosen[0], abs=0.06)
    (line,) = (line for line in by_samples.bounds if "fewest" in line.text)
    assert line.place == pytest.approx(by_samples.chosen[0], abs=0.06)


def test_the_page_of_a_scene_without_occluders_has_no_curves_and_no_picture():
    clear = plan(
        PlanRequest(altitude=40, integrated_density=0, occluder_size=0.2, volume_height=10)
    )
    text = Page(report_page(clear)).of("main")[0]["text"]
    assert charts_of(clear) == []
    assert text.count("No occluder is above the focal plane") == 1
    assert "no occluder is above the focal plane" in text


# Terrain


def test_the_height_profile_has_the_heights_of_the_waypoints(folder):
    rasterio = pytest.importorskip("rasterio")
    corner = rasterio.transform.from_origin(449_800, 5_354_000, 1.0, 1.0)
    heights = np.add.outer(np.zeros(400), 300.0 + 0.1 * np.arange(400.0)).astype(np.float32)
    shape = {"height": 400, "width": 400, "count": 1, "dtype": "float32"}
    with rasterio.open("dem.tif", "w", crs="EPSG:32633", transform=corner, **shape) as raster:
        raster.write(heights, 1)
    request = PlanRequest(altitude=40, origin=(48.3354, 14.32533), heading=90, terrain="dem.tif")
    flown = plan(request)
    profile = profile_of(flown)
    rows = flown.document()["waypoints"]
    assert max(row["ground_m"] for row in rows) > min(row["ground_m"] for row in rows) + 1.0
    places = {
        name: np.array([pair.split(",") for pair in points.split()], dtype=float)
        for name, points, _ in profile.lines
    }
    ground = np.array([row["ground_m"] for row in rows])
    low, *_, high = profile.y_ticks
    metres_a_unit = (float(high.text) - float(low.text)) / (low.place - high.place)
    drawn = float(low.text) + metres_a_unit * (low.place - places["ground"][:, 1])
    assert drawn == pytest.approx(ground, abs=0.051 * metres_a_unit)
    # Positions are written with a precision of a tenth of a unit.
    for name, above in (("canopy", flown.scene.canopy_top_m), ("flight", 40.0)):
        risen = metres_a_unit * (places["ground"][:, 1] - places[name][:, 1])
        assert risen == pytest.approx(np.full(len(rows), above), abs=0.101 * metres_a_unit)
    ways = np.hypot(*np.diff([(row["east_m"], row["north_m"]) for row in rows], axis=0).T)
    share = (places["ground"][:, 0] - 46.0) / 280.0
    assert share[1:] == pytest.approx(np.cumsum(ways) / ways.sum(), abs=0.001)
    page = Page(report_page(flown, seed=None))
    (described,) = page.of("desc", id="profile-desc")
    assert f"{ground.min():.1f} and {ground.max():.1f} m" in described["text"]


# Numbers as text


@pytest.mark.parametrize(
    ("metres", "text"),
    [(2.8, "2.80 m"), (0.0, "0.00 m"), (1e-6, "1e-06 m"), (0.05, "0.05 m"), (1e6, "1,000,000 m")],
)
def test_baselines_are_rounded_to_a_centimetre_if_that_is_meaningful(metres, text):
    assert spacing(metres) == text


def test_short_names_have_no_invisible_characters():
    assert short("a\u202eb\x00c\nd") == "a\ufffdb\ufffdc\ufffdd"
    assert len(short("x" * 10_000)) == 121


# Form of the file


def test_the_same_plan_and_seed_give_the_same_bytes(default, content):
    assert report_page(default) == content
    assert report_page(default, seed=2) != content


def test_the_page_shows_the_seed_only_with_a_picture(command, folder):
    assert command("plan", "--altitude", 40, "--report", "a.html", "--report-seed", 7)[0] == 0
    assert "seed 7" in (folder / "a.html").read_text()
    line = ("plan", "--altitude", 40, "--report", "b.html", "--no-report-picture")
    assert command(*line)[0] == 0
    assert Page((folder / "b.html").read_bytes()).of("img") == []


def test_an_existing_page_is_kept_unless_forced(command, folder):
    (folder / "a.html").write_text("mine")
    status, out, err = command("plan", "--altitude", 40, "--report", "a.html")
    assert (status, out) == (2, b"")
    assert "error: output 'a.html' exists" in err
    assert (folder / "a.html").read_text() == "mine"
    status, out, err = command("plan", "--altitude", 40, "--report", "a.html", "--force")
    assert (status, err) == (0, "")
    assert "Wrote a.html" in out.decode()
    assert (folder / "a.html").read_bytes().startswith(b"<!DOCTYPE html>")


def test_a_page_on_stdout_has_no_other_output(command):
    status, out, err = command("plan", "--altitude", 40, "--report", "-", "--no-report-picture")
    assert (status, err) == (0, "")
    assert out.startswith(b"<!DOCTYPE html>")
    assert out.rstrip().endswith(b"</html>")


def test_pages_and_waypoints_are_written_together_or_not_at_all(command, folder):
    line = ("plan", "--altitude", 40, "--report", "a.html", "--no-report-picture", "--out")
    assert command(*line, "grid.csv")[0] == 0
    assert sorted(path.name for path in folder.iterdir()) == ["a.html", "grid.csv"]
    (folder / "a.html").unlink()
    assert command(*line, "grid.csv")[0] == 2
    assert [path.name for path in folder.iterdir()] == ["grid.csv"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--report", "page.pdf"], "error: report 'page.pdf' does not end in .html"),
        (["--report", ""], "error: report '' does not end in .html"),
        (["--report", "no/page.html"], "there is no folder 'no'"),
        (["--report", "-", "--json"], "both write to stdout"),
        (["--report", "-", "--out", "csv:-"], "error: output '-' is given twice"),
        (["--report", "a.html", "--out", "csv:a.html"], "error: output 'a.html' is given twice"),
        (["--no-report-picture"], "error: --no-report-picture needs --report"),
        (["--report-seed", "1"], "error: --report-seed needs --report"),
        (["--report", "a.html", "--report-seed", "-1"], "is not a whole number from 0"),
        (["--report", "a.html", "--report-seed", "x"], "error: --report-seed 'x'"),
        (
            ["--report", "a.html", "--report-seed", "1", "--no-report-picture"],
            "contradict each other",
        ),
        (["--report", "a.html", "--visibility", "0.9"], "out of reach"),
    ],
)
def test_unwritable_pages_give_one_error_and_no_page(command, folder, arguments, message):
    status, out, err = command("plan", "--altitude", "40", *arguments)
    assert (status, out) == (2, b"")
    assert message in err
    assert err.count("\n") <= 2
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize(
    ("missing", "picture"), [("jinja2", True), ("jinja2", False), ("PIL", True)]
)
def test_a_missing_extra_is_one_line_and_a_hint(command, monkeypatch, missing, picture):
    import importlib.util

    found = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == missing else found(name)
    )
    line = ["--report", "a.html"] + ([] if picture else ["--no-report-picture"])
    status, out, err = command("plan", "--altitude", "40", *line)
    assert (status, out) == (2, b"")
    assert err == (
        "error: a report needs the optional extra 'report'\nhint: pip install \"aosplan[report]\"\n"
    )
    if missing == "PIL":
        check_extra(picture=False)


def test_pages_without_simulated_pictures_give_the_reason():
    for options, reason in (
        (
            {"hold_error": 0.3, "vhat": 0.8},
            "because a simulation takes each photo exactly at its site",
        ),
        ({"rays": "oblique", "vhat": 0.8}, "because a simulation always traces the slanted rays"),
        ({"vhat": "99.99%", "allow_no_common_ground": True}, "10000 photos"),
    ):
        text = Page(report_page(plan(PlanRequest(altitude=40, **options)))).of("main")[0]["text"]
        assert reason in text
