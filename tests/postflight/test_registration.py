"""The offset between a plan and its photos is found, even if photos are missing or belong to no
site.
"""

import numpy as np
import pytest

from aosplan.grid.patterns import local_sites, pattern_for
from aosplan.postflight.registration import MOST_PAIRS, registered

PITCH_M = 3.0
OFFSET_M = np.array([17.3, -211.9])


def sites_of(samples, kind="trimmed"):
    return np.column_stack(local_sites(pattern_for(kind, samples), PITCH_M, 33.0))


@pytest.mark.parametrize("seed", range(20))
def test_missing_noisy_and_stray_photos_do_not_change_the_registration(seed):
    source = np.random.default_rng(seed)
    sites = sites_of(int(source.integers(30, 90)))
    flown = source.random(len(sites)) < 0.7
    noise_m = 0.4
    photos = sites[flown] + OFFSET_M + noise_m * source.standard_normal((flown.sum(), 2))
    strays = OFFSET_M + source.uniform(-60, 60, (12, 2))
    photos = source.permutation(np.vstack([photos, strays]))
    found = registered(sites, photos, 0.5 * PITCH_M)
    # The standard error of the median of normally distributed errors.
    error = 1.2533 * noise_m / np.sqrt(flown.sum())
    assert np.abs(found.offset_m - OFFSET_M).max() < 4.5 * error
    assert found.alike == 1


def test_matching_by_the_middle_of_the_photos_would_be_wrong():
    sites = sites_of(48)
    east = sites[:, 0]
    photos = sites[east < np.quantile(east, 0.6)] + OFFSET_M
    middle = 0.5 * (photos.min(axis=0) + photos.max(axis=0))
    assert np.abs(middle - OFFSET_M).max() > 0.5 * PITCH_M
    found = registered(sites, photos, 0.5 * PITCH_M)
    assert found.offset_m == pytest.approx(OFFSET_M, abs=1e-9)


@pytest.mark.parametrize("kind", ["rectangle", "line", "lanes"])
def test_an_interrupted_flight_is_matched_to_the_first_sites(kind):
    sites = sites_of(40, kind)
    flown = len(sites) // 2
    found = registered(sites, sites[:flown] + OFFSET_M, 0.5 * PITCH_M)
    assert found.offset_m == pytest.approx(OFFSET_M, abs=1e-9)
    # Only the order of the flight distinguishes this offset from one with the same sites farther
    # along the line.
    assert found.alike > 1


def test_of_whole_lines_all_shifts_are_compared_with_enumeration():
    """Enumeration tries all shifts that move a site to a photo, and counts the photos that each
    shift matches with a site.
    """
    source = np.random.default_rng(5)
    for _ in range(30):
        sites = sites_of(int(source.integers(2, 25)))
        photos = sites[source.random(len(sites)) < 0.6]
        photos = np.vstack([photos, source.uniform(-9, 9, (3, 2))])
        matches = [
            (np.hypot(*(photos[:, None] - sites - shift).T) < 1e-6).any(axis=1).sum()
            for shift in (photos[:, None] - sites).reshape(-1, 2)
        ]
        offset = registered(sites, photos, 0.5 * PITCH_M).offset_m
        off = np.hypot(*(photos[:, None] - sites - offset).T)
        assert (off < 0.5 * PITCH_M).any(axis=1).sum() >= max(matches)


def test_one_photo_is_matched_to_the_first_site():
    sites = sites_of(9)
    found = registered(sites, OFFSET_M[np.newaxis], 0.5 * PITCH_M)
    assert found.offset_m + sites[0] == pytest.approx(OFFSET_M)
    assert found.alike == 9


def test_a_single_site_is_matched_to_the_place_with_most_photos():
    photos = np.array([[0.0, 0.0], [50.0, 0.0], [50.2, 0.1], [50.1, -0.1]])
    found = registered(np.zeros((1, 2)), photos, 1.0)
    assert np.abs(found.offset_m - (50.1, 0.0)).max() < 0.2


def test_too_many_pairs_give_no_registration():
    many = np.zeros((MOST_PAIRS // 1000 + 1, 2))
    assert registered(many, np.zeros((1000, 2)), 1.0) is None
