"""Imperial units in tables."""

import os
import re
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.command_line import process

from aosplan.cli.app import run
from aosplan.show.text.imperial import imperial


@pytest.mark.parametrize(
    ("metric", "converted"),
    [
        ("b = 2.80 m", "b = 9.19 ft"),
        ("a = 17.0 m (grid 19.6 x 16.8 m)", "a = 55.8 ft (grid 64.3 x 55.1 ft)"),
        ("2.51 to 20 m", "8.23 to 65.6 ft"),
        ("5.27 cm per pixel", "2.07 in per pixel"),
        ("5,044 m, 20 min 1 s", "16,550 ft, 20 min 1 s"),
        ("at 4.5 m/s, after a run-in of 5.06 m", "at 10.1 mph, after a run-in of 16.6 ft"),
        ("4.007 ha, 100 % of it", "9.902 acres, 100 % of it"),
        ("1012 (24 per m²)", "1012 (24 per m²)"),
        ("0.000 m", "0.00 ft"),
        ("12.5 min, N = 50, V = 67.4 %, 3 mm", "12.5 min, N = 50, V = 67.4 %, 3 mm"),
        ("stand-30m.laz, 30 m", "stand-30m.laz, 98.4 ft"),
    ],
)
def test_quantities_are_converted_and_nothing_else(metric, converted):
    assert imperial(metric) == converted


@given(st.decimals(min_value="0.01", max_value=99999, places=2))
def test_converted_lengths_are_exact_to_their_digits(metres):
    feet = imperial(f"{metres:,} m").removesuffix(" ft").replace(",", "")
    exact = Fraction(metres) / Fraction("0.3048")
    assert abs(Fraction(feet) - exact) <= exact * Fraction(1, 199)  # three digits


def test_tables_are_imperial_if_the_environment_says_so(monkeypatch):
    monkeypatch.setenv("AOSPLAN_UNITS", "imperial")
    shown = process("plan", "--altitude", "130ft", "--vhat", "0.9")
    rows = re.findall(r"^(Altitude|Baseline) +(.*)$", shown.stdout.decode(), re.MULTILINE)
    assert rows[0][1].startswith("130.0 ft above")
    assert rows[1][1] == "b = 9.09 ft"  # 2.77 m
    monkeypatch.setenv("AOSPLAN_UNITS", "furlongs")
    assert (
        "error: AOSPLAN_UNITS 'furlongs' is neither metric nor imperial"
        in process("plan", "--altitude", "40").stderr.decode()
    )


@pytest.mark.parametrize(
    "words",
    [
        ["plan", "--units", "imperial", "--altitude", "40"],
        ["scene", "paper-forest", "--units=imperial"],
    ],
)
def test_the_option_for_units_of_tables_is_for_any_command(words, capsys, monkeypatch):
    monkeypatch.setenv("AOSPLAN_UNITS", "metric")
    assert run(words) == 0
    assert " ft" in capsys.readouterr().out
    assert os.environ["AOSPLAN_UNITS"] == "metric"
    assert (
        run([word for word in words if word not in ("--units", "imperial", "--units=imperial")])
        == 0
    )
    assert " ft" not in capsys.readouterr().out


def test_units_of_tables_and_of_a_cloud_are_separate(capsys):
    words = ["plan", "--altitude", "40", "--units", "imperial"]
    assert run([*words, "--units", "cubit"]) == 2
    assert "--units 'cubit' is not a known unit of length" in capsys.readouterr().err
