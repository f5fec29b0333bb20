"""Parsers of all values that a user gives: they return correct values, or raise one clear error."""

import math
import string

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aosplan import units as q
from aosplan.errors import RequestError

PARSERS = {
    "number": q.number,
    "positive": q.positive,
    "at_least_zero": q.at_least_zero,
    "whole": q.whole,
    "share": q.share,
    "share_above_zero": q.share_above_zero,
    "one_of": q.one_of(("auto", "class")),
    "word": q.word,
    "latitude_longitude": q.latitude_longitude,
}

NUMERIC = ("number", "positive", "at_least_zero", "whole", "share", "share_above_zero")


def refusal(parse, value, *arguments):
    with pytest.raises(RequestError) as caught:
        parse(value, *arguments)
    return caught.value


def outcome(parse, *arguments):
    """The result, or an error of aosplan.  Any other exception is raised."""
    try:
        return parse(*arguments)
    except RequestError as error:
        return error


def is_one_line(text):
    return not any(mark in text for mark in "\n\r\x0b\x0c\x85\u2028\u2029")


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("40", 40.0),
        (" 40 ", 40.0),
        ("+40", 40.0),
        ("4e1", 40.0),
        (".5", 0.5),
        ("5.", 5.0),
        ("-0.25", -0.25),
        ("40m", 40.0),
        ("40 m", 40.0),
        ("4e1m", 40.0),
    ],
)
def test_numbers_may_carry_their_own_unit(text, value):
    assert q.number(text, "--altitude", "m") == value


@pytest.mark.parametrize("value", [40, 40.0, "40"])
def test_numbers_in_every_notation_become_floats(value):
    result = q.number(value, "x")
    assert result == 40.0
    assert type(result) is float


@pytest.mark.parametrize(
    "text", ["", " ", "m", "e", "4 0", "--5", "0x28", "1,5", "1_000", "4_0m", "40 parsecs", "40%"]
)
def test_values_that_are_not_numbers_are_refused(text):
    error = refusal(q.number, text, "--altitude", "m")
    assert error.message == f"--altitude '{text.strip()}' is not a finite number"
    assert error.hint == "give a number of metres"


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("100ft", "m", 30.48),
        ("100 FT", "m", 30.48),
        ("100 feet", "m", 30.48),
        ("100'", "m", 30.48),
        ("10yd", "m", 9.144),
        ("250cm", "m", 2.5),
        ("0.04km", "m", 40.0),
        ("100in", "m", 2.54),
        ("18km/h", "m/s", 5.0),
        ("10mph", "m/s", 4.4704),
        ("3600kn", "m/s", 1852.0),  # A knot is a nautical mile per hour.
        ("2min", "s", 120.0),
    ],
)
def test_other_units_of_the_same_quantity_are_converted(text, unit, value):
    assert q.number(text, "x", unit) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize("text", ["30ft", "30 mph", "30s"])
def test_a_length_given_as_another_quantity_gets_no_wrong_conversion(text):
    assert refusal(q.number, text, "--heading", "deg").hint == "give a number of degrees"


@pytest.mark.parametrize("value", ["nan", "NaN", "inf", "-inf", "Infinity", "1e400", "nanm"])
def test_text_that_is_not_finite_is_refused(value):
    assert "is not a finite number" in refusal(q.number, value, "x", "m").message


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 10**400, None, [], {}, [1], 1j])
@pytest.mark.parametrize("name", NUMERIC)
def test_values_that_are_not_finite_numbers_are_refused(name, value):
    assert refusal(PARSERS[name], value, "x").message.startswith("x '")


@pytest.mark.parametrize("value", [True, False])
@pytest.mark.parametrize("name", NUMERIC)
def test_booleans_are_refused_as_numbers(name, value):
    assert refusal(PARSERS[name], value, "x").message == f"x '{value}' is not a finite number"


@pytest.mark.parametrize("name", ["number", "whole"])
def test_an_integer_too_long_to_print_is_refused_like_any_other(name):
    # Python refuses to convert integers with more than 4300 digits to text.
    assert refusal(PARSERS[name], 10**5000, "x").message.startswith("x ")


@pytest.mark.parametrize("text", ["４０", "٤٠", "४०"])
def test_digits_of_other_scripts_are_the_number_that_they_show(text):
    assert q.number(text, "x") == 40.0


@pytest.mark.parametrize("value", [0, -1, "0", "-0", "-1e-9", -0.0])
def test_positive_refuses_zero_and_below(value):
    assert "is not above zero" in refusal(q.positive, value, "x").message


def test_positive_takes_the_smallest_float():
    assert q.positive(5e-324, "x") == 5e-324


@pytest.mark.parametrize("value", [-1, "-1", "-1e-300"])
def test_at_least_zero_refuses_negative_values(value):
    assert "is below zero" in refusal(q.at_least_zero, value, "x").message


@pytest.mark.parametrize("value", [-0.0, "-0", 0])
def test_at_least_zero_has_no_negative_zero(value):
    assert math.copysign(1.0, q.at_least_zero(value, "x")) == 1.0


@pytest.mark.parametrize(("value", "whole"), [(1, 1), ("7", 7), (50.0, 50), ("5e1", 50)])
def test_whole_numbers_in_any_notation_are_returned_as_int(value, whole):
    result = q.whole(value, "x")
    assert result == whole
    assert type(result) is int


@pytest.mark.parametrize("value", [0, -1, 1.5, "1.5", "0", 2**53 + 2, 10**23, "1e300"])
def test_whole_refuses_fractions_zero_and_what_a_float_cannot_count(value):
    assert "is not a whole number from 1" in refusal(q.whole, value, "--samples").message


@pytest.mark.parametrize("value", ["9007199254740993", 2**53 + 1])
def test_whole_never_changes_a_number_silently(value):
    # The nearest float is 2^53.
    refusal(q.whole, value, "--samples")


@pytest.mark.parametrize(
    ("value", "share"),
    [("98%", 0.98), ("98 %", 0.98), (0.98, 0.98), ("0", 0.0), (1, 1.0), ("100%", 1.0)],
)
def test_shares_may_be_percentages(value, share):
    assert q.share(value, "x") == share


@pytest.mark.parametrize("value", [98, "98", 98.0])
def test_a_percentage_without_its_sign_is_an_error_whose_hint_works(value):
    error = refusal(q.share, value, "--coverage")
    assert error.message == f"--coverage '{value}' is not between 0 and 1"
    assert error.hint == "write 98%"
    assert q.share(error.hint.removeprefix("write "), "--coverage") == 0.98


@pytest.mark.parametrize("value", ["101%", "-1%", 1.0000001, -1e-9, 200, "98%%", "%", "0.98m"])
def test_shares_outside_0_to_1_are_refused(value):
    refusal(q.share, value, "x")


@pytest.mark.parametrize("value", [200, -3, "x", None])
def test_values_that_are_not_percentages_get_no_percent_hint(value):
    assert q.percent_hint(value) == ""


@pytest.mark.parametrize("value", [0, "0%", "0"])
def test_share_above_zero_refuses_zero(value):
    assert refusal(q.share_above_zero, value, "--coverage").message.endswith("is not above zero")


def test_one_of_names_the_choices_and_the_nearest():
    error = refusal(PARSERS["one_of"], "clas", "--ground")
    assert error.message == "--ground 'clas' is not one of auto, class"
    assert error.hint == "did you mean class?"


@pytest.mark.parametrize("value", [3, None, ["auto"], {"auto": 1}, "AUTO", " auto"])
def test_one_of_refuses_values_that_are_no_choice(value):
    refusal(PARSERS["one_of"], value, "--ground")


def test_without_a_similar_name_there_is_no_hint():
    assert q.nearest_hint("zzzzzz", ["auto", "class"]) == ""


def test_a_long_name_does_not_slow_the_search_for_the_nearest():
    assert q.nearest_hint("paper-forest" * 100_000, ["paper-forest"]) in (
        "",
        "did you mean paper-forest?",
    )


@pytest.mark.parametrize("value", ["", "  ", "\t", 3, None, ["x"], True])
def test_word_refuses_text_that_cannot_be_a_name(value):
    assert refusal(q.word, value, "--scene").message.endswith("is not a name")


def test_word_refuses_zero_bytes_and_shows_them_escaped():
    error = refusal(q.word, "a\0b", "--scene")
    assert error.message == "--scene 'a\\x00b' contains a zero byte"


@pytest.mark.parametrize(
    "value", ["48.3358,14.3261", " 48.3358 , 14.3261 ", (48.3358, 14.3261), [48.3358, 14.3261]]
)
def test_a_place_is_latitude_then_longitude(value):
    assert q.latitude_longitude(value, "--origin") == (48.3358, 14.3261)


@pytest.mark.parametrize("value", ["90,180", "-90,-180", "0,0", (90, -180)])
def test_latitudes_of_90_and_longitudes_of_180_are_accepted(value):
    latitude, longitude = q.latitude_longitude(value, "--origin")
    assert abs(latitude) in (0, 90)
    assert abs(longitude) in (0, 180)


@pytest.mark.parametrize(
    "value", ["48", "48,14,300", "", ",", 48, None, (1,), (1, 2, 3), {}, "48 14"]
)
def test_a_place_is_two_numbers(value):
    refusal(q.latitude_longitude, value, "--origin")


@pytest.mark.parametrize("value", [(math.nan, 1), (1, math.inf), (True, 1), "nan,1", ("x", 1)])
def test_a_place_has_finite_numbers(value):
    assert "of --origin" in refusal(q.latitude_longitude, value, "--origin").message


@pytest.mark.parametrize("tiny", [1e-12, -1e-15, "1e-13", 5e-324])
def test_tiny_angles_from_rounding_are_accepted(tiny):
    # A script may compute 1e-15 degrees instead of 0.
    assert q.latitude_longitude((tiny, tiny), "--origin") == (float(tiny), float(tiny))
    assert q.number(tiny, "--heading", "deg") == float(tiny)


def test_swapped_coordinates_are_recognised_and_the_hint_works():
    error = refusal(q.latitude_longitude, "151.21,-33.86", "--origin")
    assert error.hint == "give the latitude first: -33.86,151.21"
    swapped = error.hint.removeprefix("give the latitude first: ")
    assert q.latitude_longitude(swapped, "--origin") == (-33.86, 151.21)


def test_the_hint_for_swapped_coordinates_keeps_their_digits():
    # With six digits the position would be 30 m off.
    error = refusal(q.latitude_longitude, "151.2093123,-33.8688197", "--origin")
    assert error.hint.endswith("-33.8688197,151.2093123")


@pytest.mark.parametrize("value", ["95,200", "190,10", (90.0000001, 181)])
def test_coordinates_that_are_not_swapped_get_no_swap_hint(value):
    assert refusal(q.latitude_longitude, value, "--origin").hint == ""


def test_a_longitude_out_of_range_is_named():
    assert "longitude 200" in refusal(q.latitude_longitude, "14,200", "--origin").message


def test_long_values_are_cut_in_messages():
    error = refusal(q.number, "9" * 5000 + "x", "--altitude")
    assert len(error.message) < 120


anything = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.integers(min_value=10**300, max_value=10**320),
    st.floats(),
    st.text(),
    st.text(alphabet=string.digits + "+-.,eE_% mft°'/\n"),
    st.binary(),
    st.lists(st.one_of(st.floats(), st.text()), max_size=3),
    st.dictionaries(st.text(), st.integers(), max_size=2),
)


@pytest.mark.parametrize("name", PARSERS)
@given(value=anything)
def test_any_value_is_read_or_refused_in_one_line(name, value):
    result = outcome(PARSERS[name], value, "--option")
    if isinstance(result, RequestError):
        assert "--option" in result.message
        assert is_one_line(result.message)
        assert is_one_line(result.hint)
        assert len(result.message) < 400
    else:
        numbers = result if isinstance(result, tuple) else (result,)
        assert all(isinstance(n, str) or math.isfinite(n) for n in numbers)


@pytest.mark.parametrize("unit", ["", "m", "deg", "s", "m/s"])
@given(value=st.floats(allow_nan=False, allow_infinity=False))
def test_a_number_written_out_is_read_back_exactly(unit, value):
    assert q.number(repr(value), "x", unit) == value
    assert q.number(f"{value!r} {unit}", "x", unit) == value


@given(name=st.sampled_from(["number", "positive", "share"]), value=st.text(max_size=200))
def test_the_result_does_not_depend_on_blanks_around(name, value):
    plain = outcome(PARSERS[name], value, "x")
    padded = outcome(PARSERS[name], f"  {value}\t", "x")
    if isinstance(plain, RequestError):
        assert isinstance(padded, RequestError)
    else:
        assert padded == plain


def test_flags_accept_only_true_and_false():
    assert [q.flag(value, "--x") for value in (True, "true", "False", False)] == [
        True,
        True,
        False,
        False,
    ]
    for wrong in (1, 0, "", "yes", None, 1.0, [True]):
        with pytest.raises(RequestError, match=r"--x .* is not true or false"):
            q.flag(wrong, "--x")


@pytest.mark.parametrize(
    ("value", "text"), [(0.98, "98.0"), (1.0, "100.0"), (0.99999, "99.999"), (0.0, "0.0")]
)
def test_shares_near_one_keep_the_digits_that_matter(value, text):
    assert q.percent(value) == f"{text} %"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.0, "0 s"), (59.6, "1 min 0 s"), (168.0, "2 min 48 s"), (3600.0, "1 h 0 min 0 s")],
)
def test_durations_are_whole_seconds(seconds, text):
    assert q.duration(seconds) == text


@pytest.mark.parametrize("digits", [2, 4])
def test_a_number_rounded_up_is_not_below_it_by_more_than_its_last_digit(digits):
    for value in (0.012345, 0.25, 3.14159, 9.9999, 42.0, 123.4, 99999.0):
        shown = float(q.rounded_up(value, digits))
        assert value <= shown < value + 10.0 ** (math.floor(math.log10(value)) + 1 - digits)
    assert [q.rounded_up(value, 2) for value in (0.25, 1.01, 120.0)] == ["0.25", "1.1", "120"]


@pytest.mark.parametrize(
    ("metres", "text"),
    [(0.05, "0.05 m"), (2.84, "2.8 m"), (123.4, "120 m"), (1000.0, "1 km"), (14_260.0, "14.3 km")],
)
def test_lengths_beyond_a_thousand_metres_are_kilometres(metres, text):
    assert q.length(metres) == text
