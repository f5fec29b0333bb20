"""Patterns: tests of their sites, of the order of the sites, and of properties that the solver
assumes.
"""

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from reference import exact

from aosplan.errors import RequestError
from aosplan.flight.kinematics import Leg, Timing, path_of
from aosplan.grid.patterns import (
    GRIDS,
    LATTICES,
    MOST_SITES,
    NARROWEST_TURNS,
    Frame,
    Pattern,
    frame_at,
    frames,
    pattern_for,
)
from aosplan.models.layered import LayeredModel
from aosplan.models.positions import pattern_shortfall
from aosplan.scenes.scene import Layer

MOST = 600
"""Largest number of samples that is compared with the documented rule."""


def rectangle_for(samples):
    """The smallest rectangle of r x r or r x (r+1) sites that has at least `samples` sites."""
    sizes = ((r, r + more) for r in itertools.count(1) for more in (0, 1))
    return next((rows, columns) for rows, columns in sizes if rows * columns >= samples)


def sites_left(samples):
    """Sites that the trimming rule leaves, computed from all sites of the rectangle.

    Surplus sites are removed in point-symmetric pairs, beginning with those farthest from the
    centre.  Sites at the same distance are removed in the order of (row, column).  If the surplus
    is odd, the last site is removed alone.
    """
    rows, columns = rectangle_for(samples)

    def farthest_first(site):
        row, column = site
        return -((2 * row - rows + 1) ** 2 + (2 * column - columns + 1) ** 2), row, column

    left = set(itertools.product(range(rows), range(columns)))
    for row, column in sorted(left, key=farthest_first):
        if len(left) == samples:
            break
        if (row, column) not in left:
            continue
        left.remove((row, column))
        if len(left) > samples:
            left.remove((rows - 1 - row, columns - 1 - column))
    return rows, columns, left


# --- The trimmed grid ----------------------------------------------------------------------


def test_the_trimmed_grid_of_every_count_follows_the_rule():
    for samples in range(1, MOST + 1):
        pattern = pattern_for("trimmed", samples)
        rows, columns, left = sites_left(samples)
        assert (pattern.rows, pattern.columns) == (rows, columns), samples
        assert set(pattern.sites()) == left, samples
        assert len(left) == samples


@pytest.mark.parametrize(
    ("samples", "rows", "columns", "removed"),
    [
        (1, 1, 1, ()),
        (2, 1, 2, ()),
        (3, 2, 2, ((0, 0),)),
        (4, 2, 2, ()),
        (5, 2, 3, ((0, 0),)),
        (10, 3, 4, ((0, 0), (2, 3))),
        (49, 7, 7, ()),
        (50, 7, 8, ((0, 0), (0, 7), (1, 0), (5, 7), (6, 0), (6, 7))),
        (55, 7, 8, ((0, 0),)),
    ],
)
def test_trimmed_grids_have_known_rows_columns_and_removed_sites(samples, rows, columns, removed):
    assert pattern_for("trimmed", samples) == Pattern(rows, columns, 1.0, removed)


def test_the_centroid_lies_within_a_third_of_a_pitch_of_the_centre():
    for samples in range(1, MOST + 1):
        pattern = pattern_for("trimmed", samples)
        sites = list(pattern.sites())
        row = sum(row for row, _ in sites) / samples - (pattern.rows - 1) / 2
        column = sum(column for _, column in sites) / samples - (pattern.columns - 1) / 2
        assert math.hypot(row, column) <= 1 / 3 + 1e-12, samples


def test_sites_are_removed_in_mirrored_pairs_except_an_odd_last_one():
    for samples in range(1, MOST + 1):
        pattern = pattern_for("trimmed", samples)
        mirrored = {
            (pattern.rows - 1 - row, pattern.columns - 1 - column)
            for row, column in pattern.removed
        }
        alone = set(pattern.removed) - mirrored
        assert len(alone) == len(pattern.removed) % 2, samples


@given(samples=st.integers(1, 3_000_000))
def test_large_trimmed_grids_have_exactly_the_requested_samples(samples):
    pattern = pattern_for("trimmed", samples)
    assert pattern.samples == samples
    assert (pattern.rows, pattern.columns) == rectangle_for_large(samples)
    assert len(set(pattern.removed)) == len(pattern.removed)
    assert list(pattern.removed) == sorted(pattern.removed)
    assert all(
        0 <= row < pattern.rows and 0 <= column < pattern.columns for row, column in pattern.removed
    )


def rectangle_for_large(samples):
    side = math.isqrt(samples - 1) + 1
    return (side - 1, side) if side * (side - 1) >= samples else (side, side)


def test_trimming_never_removes_a_whole_row_or_column():
    for samples in range(1, MOST + 1):
        pattern = pattern_for("trimmed", samples)
        sites = list(pattern.sites())
        assert {row for row, _ in sites} == set(range(pattern.rows)), samples
        assert {column for _, column in sites} == set(range(pattern.columns)), samples


# --- The other kinds -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("grid", "size"),
    [
        ("rectangle", rectangle_for),
        ("square", lambda n: (math.isqrt(n - 1) + 1, math.isqrt(n - 1) + 1)),
        ("line", lambda n: (1, n)),
        ("lanes", lambda n: (3, math.ceil(n / 3))),
    ],
)
def test_other_kinds_are_the_smallest_whole_rectangle_of_their_shape(grid, size):
    for samples in range(1, 300):
        pattern = pattern_for(grid, samples)
        assert (pattern.rows, pattern.columns) == size(samples), samples
        assert pattern.removed == ()
        assert pattern.samples >= samples
        assert len(list(pattern.sites())) == pattern.samples


def test_lanes_keep_their_number_and_pitch():
    pattern = pattern_for("lanes", 10, lanes=4, lane_pitch=2.5)
    assert pattern == Pattern(4, 3, row_pitch=2.5)
    assert pattern.extent == (2.0, 7.5)
    assert pattern.longer_side == 7.5


def test_more_sites_than_memory_holds_are_refused_with_a_hint():
    assert pattern_for("square", 2236**2).samples <= MOST_SITES
    for grid in GRIDS:
        with pytest.raises(RequestError, match="5000001 samples, but a plan has") as caught:
            pattern_for(grid, MOST_SITES + 1)
        assert caught.value.hint


# --- Frames --------------------------------------------------------------------------------


@pytest.mark.parametrize("grid", GRIDS)
def test_frames_have_increasing_sample_counts(grid):
    some = list(itertools.islice(frames(grid), 60))
    assert some[0].fewest == (3 if grid == "lanes" else 1)
    for before, after in itertools.pairwise(some):
        assert before.fewest <= before.most < after.fewest
        assert after.longer_side >= before.longer_side or grid == "spiral"
    assert some == [frame_at(grid, index) for index in range(1, 61)]


def test_frames_of_the_trimmed_grid_contain_every_count():
    counts = [
        samples
        for frame in itertools.islice(frames("trimmed"), 60)
        for samples in range(frame.fewest, frame.most + 1)
    ]
    assert counts == list(range(1, len(counts) + 1))


@pytest.mark.parametrize("grid", GRIDS)
def test_a_frame_makes_the_patterns_of_its_counts(grid):
    for frame in itertools.islice(frames(grid), 25):
        for samples in range(frame.fewest, frame.most + 1):
            pattern = frame.pattern(samples)
            assert pattern == pattern_for(grid, samples)
            assert pattern.samples == samples
            assert pattern.longer_side == frame.longer_side
            assert pattern.nearest == frame.nearest
        assert frame.whole == frame.pattern(frame.most)


# --- What the solver assumes ---------------------------------------------------------------

ROUNDING = 1e-13

DISPARITIES = (
    *(10.0 ** (-exponent / 8) for exponent in range(1, 40)),
    *(1.0 / k for k in range(2, 24)),
    *(0.35, 0.45, 0.55, 0.65, 0.77, 0.9, 0.98, math.nextafter(1.0, 0.0), 1.0),
)


def test_the_shortfall_decreases_with_every_sample_of_a_frame():
    for dhat in DISPARITIES:
        for frame in itertools.islice(frames("trimmed"), 1, 26):
            shortfalls = [
                pattern_shortfall(frame.pattern(samples), dhat)
                for samples in range(frame.fewest, frame.most + 1)
            ]
            for fewer, more in itertools.pairwise(shortfalls):
                assert more <= fewer * (1.0 + ROUNDING), (frame, dhat)


def test_the_exact_shortfall_decreases_with_every_sample_of_a_frame():
    for dhat in (0.003, 0.1, 1 / 7, 0.3, 0.49, 0.51, 0.77, 0.99):
        for frame in itertools.islice(frames("trimmed"), 1, 11):
            shortfalls = [
                exact.lattice_pair_sum(frame.pattern(samples).sites(), dhat)
                for samples in range(frame.fewest, frame.most + 1)
            ]
            assert shortfalls == sorted(shortfalls, reverse=True), (frame, dhat)


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("row_pitch", [1.0, 4.0])
def test_the_shortfall_decreases_from_each_frame_to_the_next(grid, row_pitch):
    pitch = max(row_pitch, NARROWEST_TURNS) if grid == "spiral" else row_pitch
    most = 50 if grid == "spiral" else 120  # For spirals, the sum is over all pairs, which is slow.
    for dhat in DISPARITIES:
        shortfalls = [
            pattern_shortfall(frame.whole, dhat)
            for frame in itertools.islice(frames(grid, lane_pitch=pitch), most)
        ]
        for before, after in itertools.pairwise(shortfalls):
            assert after <= before * (1.0 + ROUNDING), dhat


def test_shortfalls_of_layers_decrease_with_every_sample_and_every_frame():
    layers = (
        Layer(0.5, 1.5, 0.9, 0.05),
        Layer(2.0, 4.0, 0.05, 2.0),
        Layer(5.0, 6.0, 0.3, 0.3),
        Layer(10.0, 20.0, 0.5, 8.0),
    )
    for chosen in (layers, layers[:2], layers[1:], layers[::3]):
        model = LayeredModel(chosen, 50.0)
        for share in (0.003, 0.03, 0.2, 0.6, 0.95):
            baseline = share * model.independent_baseline_m
            last_whole = math.inf
            for frame in itertools.islice(frames("trimmed"), 14):
                last = math.inf
                for samples in range(frame.fewest, frame.most + 1):
                    shortfall = model.predict(frame.pattern(samples), baseline).shortfall
                    assert shortfall <= last * (1.0 + 1e-12), (frame, share)
                    last = shortfall
                assert last <= last_whole * (1.0 + 1e-12), (frame, share)
                last_whole = last


# --- Flight order --------------------------------------------------------------------------


@pytest.mark.parametrize("grid", LATTICES)
def test_sites_are_flown_in_lines_of_alternating_direction(grid):
    for samples in range(1, 200):
        pattern = pattern_for(grid, samples)
        sites = list(pattern.sites())
        assert len(set(sites)) == len(sites) == pattern.samples
        assert [row for row, _ in sites] == sorted(row for row, _ in sites)
        for row, line in itertools.groupby(sites, key=lambda site: site[0]):
            columns = [column for _, column in line]
            assert columns == sorted(columns, reverse=row % 2 == 1)


def test_a_small_grid_is_flown_in_the_known_order():
    assert list(Frame(3, 3, 1.0, 7, 9).pattern(7).sites()) == [
        *[(0, 1), (0, 2)],
        *[(1, 2), (1, 1), (1, 0)],
        *[(2, 0), (2, 1)],
    ]


def test_the_path_of_a_complete_grid_has_no_detours():
    path = path_of(Pattern(4, 6))
    assert path.legs == ((Leg(1.0), 23),)
    assert path.length_m(2.5) == 57.5
    lanes = path_of(Pattern(3, 5, row_pitch=4.0))
    assert lanes.legs == ((Leg(1.0), 12), (Leg(4.0), 2))
    assert lanes.length_m(2.0) == 40.0


@given(samples=st.integers(1, 200), baseline=st.floats(0.01, 100.0))
def test_a_path_is_as_long_as_its_legs_and_takes_as_long(samples, baseline):
    pattern = pattern_for("trimmed", samples)
    timing = Timing(speed_mps=5.0, acceleration_mps2=2.0, hold_s=1.5)
    length = time = 0.0
    for (row, column), (to_row, to_column) in itertools.pairwise(pattern.sites()):
        leg = baseline * math.hypot(to_row - row, to_column - column)
        length += leg
        # Accelerating to 5 m/s and stopping again takes 12.5 m and 5 s.
        time += 5.0 + (leg - 12.5) / 5.0 if leg >= 12.5 else 2.0 * math.sqrt(leg / 2.0)
    path = path_of(pattern)
    assert path.samples == samples
    assert path.length_m(baseline) == pytest.approx(length, rel=1e-12, abs=0.0)
    assert path.time_s(baseline, timing) == pytest.approx(time + 1.5 * samples, rel=1e-12, abs=0.0)
