"""Inverses of Eq. 2 to 5: samples, disparity and baseline for a target."""

import math
from decimal import Decimal
from fractions import Fraction

import mpmath
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.ulps import NAN, near

from aosplan.errors import RequestError
from aosplan.models.equations import (
    aperture,
    baseline_for_aperture,
    dhat_for_shortfall,
    line_shortfall,
    required_samples,
    required_samples_for_visibility,
    visibility_shortfall,
)

# --- Inverses of Eq. 2 and 5 ---------------------------------------------------------------


@given(
    rows=st.integers(1, 60),
    columns=st.integers(1, 60),
    share=st.floats(0.0, 1.0),
    pitch_ratio=st.floats(1.0, 8.0),
)
def test_dhat_for_shortfall_is_the_smallest_that_reaches_it(rows, columns, share, pitch_ratio):
    def shortfall(dhat):
        return line_shortfall(columns, dhat) * line_shortfall(rows, pitch_ratio * dhat)

    least = shortfall(1.0)
    target = least + (1.0 - least) * share
    dhat = dhat_for_shortfall(target, rows, columns, pitch_ratio=pitch_ratio)
    assert 0.0 <= dhat <= 1.0
    assert shortfall(dhat) <= target
    assert dhat == 0.0 or shortfall(math.nextafter(dhat, 0.0)) > target


def test_dhat_for_shortfall_inverts_eq_2():
    for side in (2, 5, 7, 30):
        for dhat in (0.05, 0.3, 0.5, 0.77, 1.0):
            found = dhat_for_shortfall(visibility_shortfall(side, side, dhat), side, side)
            assert found == near(dhat, rel=1e-13)


def test_a_shortfall_that_no_disparity_reaches_has_no_dhat():
    assert math.isnan(dhat_for_shortfall(1 / 49 * (1 - 1e-9), 7, 7))
    assert dhat_for_shortfall(1 / 49 * (1 + 1e-9), 7, 7) == near(1.0, rel=1e-6)
    assert math.isnan(dhat_for_shortfall(NAN, 7, 7))
    assert dhat_for_shortfall(1.0, 7, 7) == 0.0


@given(samples=st.integers(2, 10**12), baseline=st.floats(1e-6, 1e6))
def test_baseline_for_aperture_inverts_eq_5(samples, baseline):
    side = aperture(samples, baseline)
    assert baseline_for_aperture(side, samples) == near(baseline, rel=4e-16)
    with mpmath.workdps(40):
        reference = (mpmath.sqrt(samples) - 1) * mpmath.mpf(baseline)
        assert side == near(float(reference), rel=5e-16)


def test_one_sample_has_no_aperture():
    assert aperture(1, 2.8) == 0.0
    assert math.isnan(baseline_for_aperture(0.0, 1))


# --- Inverse of Eq. 4 ----------------------------------------------------------------------


@st.composite
def decimals(draw):
    """A decimal below 1 as text, with its digits and its denominator as whole numbers."""
    places = draw(st.integers(1, 30))
    digits = draw(
        st.one_of(
            st.integers(0, 10**places - 1),
            st.integers(1, min(1000, 10**places)).map(lambda n: 10**places - n),
        )
    )
    return f"0.{digits:0{places}d}", digits, 10**places


@given(written=decimals())
def test_required_samples_is_exact_for_decimals_and_fractions(written):
    text, digits, whole = written
    # This is ⌈1/(1 - digits/whole)⌉, computed with whole numbers.
    fewest = -(-whole // (whole - digits))
    assert required_samples(text) == fewest
    assert required_samples(Decimal(text)) == fewest
    assert required_samples(Fraction(digits, whole)) == fewest
    assert required_samples(f" {text}e2% ") == fewest


@given(target=st.fractions(0, 1).filter(lambda share: share < 1))
def test_required_samples_is_the_fewest_of_eq_4(target):
    samples = required_samples(target)
    assert 1 - Fraction(1, samples) >= target
    assert samples == 1 or 1 - Fraction(1, samples - 1) < target


@given(samples=st.integers(1, 10**30))
def test_required_samples_inverts_eq_4_for_fractions(samples):
    assert required_samples(1 - Fraction(1, samples)) == samples


@pytest.mark.parametrize(
    "samples",
    [
        pytest.param((*range(1, 20_001), *range(20_001, 10**6, 97)), id="some"),
        pytest.param(range(1, 10**6 + 1, 5), id="many", marks=pytest.mark.slow),
    ],
)
def test_required_samples_inverts_eq_4_for_the_floats_to_a_million(samples):
    wrong = [k for k in samples if required_samples(1.0 - 1.0 / k) != k]
    assert wrong == []


@given(target=st.floats(0.0, 1.0 - 1e-6))
def test_only_floats_within_1_ulp_are_rounded_to_a_whole_sample_count(target):
    samples = required_samples(target)
    unit = Fraction(math.ulp(target))
    assert 1 - Fraction(1, samples) >= Fraction(target) - unit
    assert samples == 1 or 1 - Fraction(1, samples - 1) < Fraction(target)


@pytest.mark.parametrize("samples", [2, 3, 10, 50, 100, 1000, 12_345])
def test_a_float_more_than_1_ulp_above_needs_one_more_sample(samples):
    target = 1.0 - 1.0 / samples
    for _ in range(3):
        target = math.nextafter(target, 1.0)
    assert required_samples(target) == samples + 1


@pytest.mark.parametrize(
    ("target", "samples"),
    [
        (0, 1),
        (0.0, 1),
        ("0", 1),
        ("1e-400", 2),
        ("0.5", 2),
        (0.5, 2),
        ("0.8", 5),
        (0.8, 5),
        ("0.9", 10),
        (0.9, 10),
        ("0.98", 50),
        ("98%", 50),
        ("98 %", 50),
        (" .98 ", 50),
        ("9.8e-1", 50),
        (0.98, 50),
        (Decimal("0.98"), 50),
        (Fraction(49, 50), 50),
        ("0.980000000000000001", 51),
        ("0.99", 100),
        (0.99, 100),
        (0.999, 1000),
        ("0.999999", 10**6),
        (0.999999, 10**6),
        ("0." + "9" * 50, 10**50),
    ],
)
def test_required_samples_has_known_values(target, samples):
    assert required_samples(target) == samples


@pytest.mark.parametrize(
    "target",
    [
        1,
        1.0,
        "1",
        "100%",
        1.5,
        98,
        "98",
        "150%",
        -0.1,
        "-1%",
        NAN,
        math.inf,
        "nan",
        "inf",
        "1e999999999",
        "",
        " ",
        "%",
        "abc",
        "0.9.8",
        "9" * 500,
        None,
        [],
        1j,
        Decimal("NaN"),
    ],
    ids=repr,
)
def test_targets_that_are_not_shares_below_1_are_refused_with_a_hint(target):
    with pytest.raises(RequestError) as caught:
        required_samples(target)
    assert "V̂" in caught.value.message
    assert "\n" not in caught.value.message
    assert len(caught.value.message) < 100
    assert caught.value.hint


def test_a_percentage_without_its_sign_gets_a_hint_with_the_sign():
    for target in (98, "98", 98.0, Decimal(98)):
        with pytest.raises(RequestError) as caught:
            required_samples(target)
        assert required_samples(caught.value.hint.removeprefix("write ")) == 50


def test_the_hint_for_more_than_100_percent_can_be_followed():
    with pytest.raises(RequestError) as caught:
        required_samples("150%")
    assert "%%" not in caught.value.hint


# --- Inverse of Eq. 3 ----------------------------------------------------------------------


@given(target=st.floats(0.0, 1.0), density=st.floats(0.0, 1.0))
def test_required_samples_for_visibility_is_the_fewest_of_eq_3(target, density):
    samples = required_samples_for_visibility(target, density)
    p, wanted = Fraction(density), Fraction(target)

    def reached(n):
        return 1 - p**2 - p * (1 - p) / n

    if samples is None:
        assert wanted >= 1 - p**2
    else:
        assert reached(samples) >= wanted
        assert samples == 1 or reached(samples - 1) < wanted


def test_visibility_of_one_sample_needs_one_and_beyond_the_limit_gives_none():
    assert required_samples_for_visibility(0.5, 0.5) == 1
    assert required_samples_for_visibility(0.0, 1.0) == 1
    assert required_samples_for_visibility(1.0, 0.0) == 1
    assert required_samples_for_visibility(0.75, 0.5) is None
    assert required_samples_for_visibility(math.nextafter(0.75, 0.0), 0.5) is not None
    assert required_samples_for_visibility(0.1, 1.0) is None


def test_required_samples_for_visibility_at_round_targets():
    assert required_samples_for_visibility(0.625, 0.5) == 2
    assert required_samples_for_visibility(0.6875, 0.5) == 4
    assert required_samples_for_visibility(0.6735, 0.567) == 49
    assert required_samples_for_visibility(0.678, 0.567) == 481
