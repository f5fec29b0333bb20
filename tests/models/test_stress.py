"""At extreme arguments, the error of every model is at most a few units in the last place.

`reference.stress` has these arguments with exact values.  The table in
`benchmarks/results/numerical_stress.md` is computed from the same checks.
"""

import math
from fractions import Fraction

import pytest
from reference import exact, stress

from aosplan.camera.disparity import Slab, coverage_baseline
from aosplan.models import equations
from aosplan.models.layered import LayeredModel
from aosplan.models.layered_pairs import Slices
from aosplan.scenes.scene import Layer

BOUND_ULPS = 4.0


@pytest.mark.parametrize("part", stress.PARTS, ids=lambda part: part.__name__)
def test_every_corner_is_within_a_few_ulps(part):
    found = stress.worst(part())
    assert sum(row.cases for row in found.values()) >= 30
    for key, row in found.items():
        assert row.ulps <= BOUND_ULPS, (key, row)


def test_the_stress_test_reaches_the_named_corners():
    corners = [
        check.corner for part in (stress.eq1, stress.eq2, stress.uniform) for check in part()
    ]
    assert any("1000000 x 1000000" in corner for corner in corners)  # N = 10^12
    assert any("spiral of 40" in corner for corner in corners)
    for named in ("b = 1e-09", "b = 1e+09", "p = 1e-16", "p = 0.9999999999999999", "T = 1e-16"):
        assert any(named in corner for corner in corners), named
    dhats = set(stress.breakpoints(50))
    for middle in (1.0, 1 / 7, 1 / 49):
        assert {math.nextafter(middle, 0.0), middle, math.nextafter(middle, 2.0)} <= dhats


def test_an_error_of_ten_ulps_would_be_found(monkeypatch):
    true = equations.visibility_shortfall
    monkeypatch.setattr(
        "aosplan.visibility_shortfall", lambda *a: true(*a) * (1 + 1e-14), raising=False
    )
    row = stress.worst(stress.eq2())["equations", "1 - V̂ (Eq. 2)"]
    assert row.ulps > 40


def test_layers_that_hide_nearly_all_keep_their_digits():
    # For T = 10^-247, ln T is -569. A change of ln T by one unit in its last place changes T by 256
    # units.
    walls = stress.STANDS["a wall of walls"]
    clear = math.prod((1 - Fraction(density) for _, _, density, _ in walls), start=Fraction(1))
    model = LayeredModel([Layer(*wall) for wall in walls], 50.0)
    assert exact.ulps(model.transparency, clear) < 4
    logarithm = Slices([Layer(*wall) for wall in walls], 50.0).log_transparency
    # The product of transparencies is used instead.
    assert exact.ulps(math.exp(logarithm), clear) > 20


def test_full_coverage_is_determined_by_the_bottom_of_the_volume():
    found = coverage_baseline([Slab(1e-6, 20.0, 0.2, 1.0)], 40.0, 750.0, 1.0)
    assert found.height_m == 1e-6
