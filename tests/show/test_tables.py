"""Tables on a terminal: tests of sums and shares."""

import pytest

from aosplan.show.text.tables import density_profile


def shares(bands):
    """Density [%] by band, from the lowest to the highest."""
    return [float(band.plain.split()[2]) for band in reversed(bands)]


def layer(bottom_m, top_m, density):
    return {"bottom_m": bottom_m, "top_m": top_m, "density": density, "occluder_size_m": 0.3}


def test_a_profile_shares_layers_among_the_bands_that_they_cross():
    # Bands are 25 / 20 m high, and layers are 1 m high. Some bands contain the middle of one layer,
    # and some contain the middles of two layers.
    even = [layer(float(bottom), bottom + 1.0, 0.4) for bottom in range(25)]
    assert shares(density_profile(even)) == [40.0] * 20
    assert shares(density_profile([layer(0.0, 40.0, 0.1)])) == [10.0] * 20
    assert shares(density_profile([layer(0.5, 2.25, 0.2), layer(2.25, 2.5, 0.8)])) == [
        10.0,
        20.0,
        25.0,
    ]


@pytest.mark.parametrize("top_m", [0.3, 1.0, 19.7, 20.0, 25.3, 99.9])
def test_a_profile_ends_with_the_canopy(top_m):
    bands = density_profile([layer(0.0, top_m, 0.5)])
    assert len(bands) <= 20
    assert all(share == 50.0 for share in shares(bands)[:-1])
    assert 0.0 < shares(bands)[-1] <= 50.0
