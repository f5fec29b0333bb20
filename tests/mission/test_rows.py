"""Rows of text: digits against exact decimal arithmetic, one way of writing against the other."""

import re
from decimal import ROUND_HALF_EVEN, Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aosplan.mission.formats.rows import CHUNK, FEW, Fields, blocks, by_column, rows

decimals = st.integers(0, 10)


@st.composite
def columns(draw):
    """Decimals and numbers, many of them exactly between two decimals."""
    places = draw(decimals)
    halves = st.integers(-(2**30), 2**30).map(lambda n: n / 2**11)
    near = st.integers(-(10**6), 10**6).map(lambda n: (n + 0.5) / 10**places)
    plain = st.floats(-4e5, 4e5)
    tiny = st.floats(-1e-9, 1e-9)
    return places, draw(st.lists(st.one_of(halves, near, plain, tiny), min_size=1, max_size=40))


def exactly(value, places):
    """The nearest decimal to the float itself, ties to even, and no negative zero."""
    nearest = Decimal(value).quantize(Decimal(1).scaleb(-places), ROUND_HALF_EVEN)
    return f"{nearest:f}" if nearest else f"{abs(nearest):f}"


@given(column=columns())
def test_digits_are_those_of_exact_arithmetic(column):
    places, values = column
    expected = "".join(f"{exactly(value, places)}\n" for value in values).encode()
    template = f"%.{places}f\n" if places else "%.0f\n"
    assert bytes(by_column(template, [values], Fields())) == expected
    if places:
        assert rows(template, values) == expected


@pytest.mark.parametrize("count", [1, FEW, FEW + 1, CHUNK, CHUNK + 1, 2 * CHUNK + 7])
def test_few_and_many_rows_read_alike(count):
    numbers = [(-1) ** index * index / 7 for index in range(count)]
    words = ["a" * (index % 3) for index in range(count)]
    text = rows("%d;%.10f;%s;%.4f%%\n", range(count), numbers, words, numbers).decode()
    lines = text.splitlines()
    assert len(lines) == count
    for index in {0, 1, count // 2, count - 1} & set(range(count)):
        number = exactly(numbers[index], 10)
        assert lines[index] == f"{index};{number};{words[index]};{exactly(numbers[index], 4)}%"


def test_numbers_beyond_the_fast_way_are_written_all_the_same():
    values = [1e14, -2.5e15] * FEW
    assert (
        rows("%.4f ", values).split() == [b"100000000000000.0000", b"-2500000000000000.0000"] * FEW
    )


def test_there_is_neither_an_exponent_nor_a_negative_zero():
    values = [-1e-12, 1e-300, -0.0, 123456.0, -0.00004] * FEW
    text = rows("%.4f\n", values).decode()
    assert re.fullmatch(r"(-?\d+\.\d{4}\n)+", text)
    assert "-0.0000" not in text


@pytest.mark.parametrize("count", [3, FEW + 1, CHUNK + 5])
def test_several_templates_are_those_of_one_each(count):
    numbers, others = [index / 3 for index in range(count)], [-0.5] * count
    pair = blocks(("%.3f,%.1f\n", [numbers, others]), ("%.3f;%.4f;%.3f ", [numbers] * 3))
    found = [b"".join(texts) for texts in zip(*pair, strict=True)]
    assert found[0] == rows("%.3f,%.1f\n", numbers, others)
    assert found[1] == rows("%.3f;%.4f;%.3f ", numbers, numbers, numbers)


def test_no_columns_have_no_rows():
    assert rows("x") == b""
    assert rows("%d", []) == b""
