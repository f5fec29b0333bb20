"""Drawings of grids and flights: every site is shown, at any size of the drawing."""

import re

import pytest

from aosplan.grid.patterns import Pattern, pattern_for
from aosplan.grid.spiral import Spiral
from aosplan.show.text.grid_drawing import (
    ASCII,
    HEIGHT,
    UNICODE,
    flight_picture,
    grid_picture,
    to_scale,
)

PATTERNS = [
    pattern_for("trimmed", 50),
    pattern_for("trimmed", 1234),
    pattern_for("square", 10_000),
    pattern_for("lanes", 201),
    pattern_for("lanes", 5000, lanes=5, lane_pitch=6.0),
    pattern_for("line", 50),
    pattern_for("line", 100_000),
    Pattern(400, 3),
    Spiral(20, 2.0),
    Spiral(3000, 6.0),
]


def parts_of(picture):
    """Drawing and legend."""
    middle = len(picture) - picture[::-1].index("") - 1
    return picture[:middle], picture[middle + 1 :]


def dots_of(lines):
    """Number of the dots that are not hidden by the characters of marks."""
    return sum((ord(c) - 0x2800).bit_count() for line in lines for c in line if c >= "\u2800")


@pytest.mark.parametrize("pattern", PATTERNS, ids=lambda p: f"{type(p).__name__}-{p.samples}")
@pytest.mark.parametrize("width", [18, 38, 58, 72, 500])
@pytest.mark.parametrize("plain", [True, False])
def test_drawings_fit_their_size_and_show_both_ends(pattern, width, plain):
    drawing, legend = parts_of(grid_picture(pattern, plain=plain, width=width))
    marks = ASCII if plain else UNICODE
    assert len(drawing) <= HEIGHT
    assert all(len(line) <= min(width, 72) for line in drawing)
    assert all(len(line) <= max(width, 40) for line in legend)
    text = "\n".join(drawing)
    assert text.count(marks.first) == text.count(marks.last) == 1
    assert text.isascii() == plain
    assert f"{marks.first} first photo" in legend[0]


@pytest.mark.parametrize(
    ("pattern", "under_marks"),
    [
        # A baseline is two dots wide, so each letter hides one site.
        (pattern_for("lanes", 201), 2),
        (pattern_for("rectangle", 40 * 40), 4),  # It also hides two sites of neighbouring rows.
    ],
)
def test_every_site_is_drawn_as_a_dot_if_the_legend_says_so(pattern, under_marks):
    drawing, legend = parts_of(grid_picture(pattern))
    assert "dots are sites" in " ".join(legend)
    assert dots_of(drawing) == pattern.samples - under_marks


def test_every_site_is_drawn_as_a_letter_if_the_legend_says_so():
    drawing, legend = parts_of(grid_picture(pattern_for("lanes", 201), plain=True))
    assert "letters are sites" in " ".join(legend)
    assert "".join(drawing).count("o") == 201 - 2


@pytest.mark.parametrize("samples", [50, 55, 1441, 1500, 1999, 2500, 3001])
@pytest.mark.parametrize("plain", [True, False])
def test_a_grid_to_scale_is_that_of_all_its_sites(samples, plain):
    pattern = pattern_for("trimmed", samples)
    marks = ASCII if plain else UNICODE
    sites = [(float(column), float(row)) for row, column in pattern.sites()]
    wanted, _ = to_scale(sites, marks, 30, plain=plain, even=True)
    drawing, legend = parts_of(grid_picture(pattern, plain=plain, width=30))
    if samples > 100:
        assert drawing == wanted
        assert re.search(r"(up to \d+ x \d+ sites|are sites)", " ".join(legend))
    else:
        assert len([c for line in drawing for c in line if c != " "]) == samples


@pytest.mark.parametrize("pattern", [Pattern(2000, 2000), pattern_for("trimmed", 1_000_000)])
def test_a_huge_grid_has_no_holes(pattern):
    drawing, _ = parts_of(grid_picture(pattern))
    inner = "".join(line[2:-2] for line in drawing[2:-2])
    assert set(inner) == {"\u28ff"}


def test_a_single_site_is_not_drawn():
    assert grid_picture(pattern_for("trimmed", 1)) == []
    assert flight_picture([(0.0, 0.0)]) == []


def test_a_flight_has_north_above_and_east_at_the_right():
    drawing, legend = parts_of(flight_picture([(0.0, 0.0), (0.0, 90.0), (180.0, 90.0)], plain=True))
    assert drawing[0].lstrip()[-1] == "E"
    assert drawing[-1] == "S"
    assert "north is up" in " ".join(legend)
    width, height = max(map(len, drawing)), len(drawing)
    # Characters are twice as high as they are wide.
    assert width == pytest.approx(2 * 2 * height, abs=4)


def test_flights_of_one_place_and_of_many_points_are_drawn():
    assert parts_of(flight_picture([(1.0, 1.0)] * 3))[0] == ["▶"]
    loop = [(float(i % 500), float(i // 500)) for i in range(200_000)]
    drawing, _ = parts_of(flight_picture(loop, width=40))
    assert max(map(len, drawing)) <= 40
