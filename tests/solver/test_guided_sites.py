"""Chosen sites, compared with all sets of sites on small scenes."""

from itertools import combinations

import numpy as np
import pytest

from aosplan.models.place import joint_density
from aosplan.solver.guided_sites import most_visible, visibility


def scene(seed, sites=12, targets=60):
    """Mask of the targets that are hidden from each site. The masks of neighbouring sites are
    similar.
    """
    rng = np.random.default_rng(seed)
    field = rng.standard_normal((sites + 3, targets))
    smooth = field[:-3] + field[1:-2] + field[2:-1] + field[3:]
    return smooth > rng.uniform(-1.5, 1.5)


def best_of_all(joint, count):
    return max(
        visibility(joint, np.array(sites)) for sites in combinations(range(len(joint)), count)
    )


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_chosen_sites_are_nearly_the_best_of_all(count):
    losses = []
    for seed in range(40):
        joint = joint_density(scene(seed))
        chosen = most_visible(joint, count)
        assert len(set(chosen.tolist())) == count
        losses.append(best_of_all(joint, count) - visibility(joint, chosen))
    assert min(losses) >= -1e-12
    # The exchange of single sites does not always find the optimum. In one of these scenes, the
    # visibility is 0.0125 below the optimum. At least 36 of the 40 results are optimal.
    assert max(losses) <= 0.0126
    assert sum(loss < 1e-12 for loss in losses) >= 36


def test_visibility_is_that_of_the_joint_occlusion():
    hidden = scene(3)
    sites = np.array([0, 4, 7])
    expected = 1.0 - float((hidden[sites].mean(axis=0) ** 2).mean())
    assert visibility(joint_density(hidden), sites) == pytest.approx(expected, abs=1e-15)


def test_a_site_with_a_fine_single_view_is_not_chosen_twice_for_the_same_targets():
    # Two sites see the same half of the targets. The third site sees a third of the other half.
    hidden = np.array([[0] * 6 + [1] * 6, [0] * 6 + [1] * 6, [1] * 6 + [0] * 4 + [1] * 2], bool)
    assert most_visible(joint_density(hidden), 2).tolist() in ([0, 2], [1, 2])
