"""Paths through singularities: reproducible, past the configurations that were found, and refused where they cannot be."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from hqp_rp import SettingError
from hqp_rp.compare.statistics.passages import FARTHEST, NEAREST, Design, distance, passages, places

DESIGN = Design(configurations=2, paths=4, samples=41)


@pytest.mark.parametrize("arm", ["sawyer", "panda_like", "planar4"])
def test_paths_go_past_a_singularity_of_level_two(arm: str) -> None:
    found = places(arm, 2, 0)
    assert len(found) == 2
    for index, place in enumerate(found):
        assert place.level == 1
        for passage in passages(DESIGN, arm, place, index):
            apart = np.linalg.norm(passage.q - place.q, axis=1)
            assert NEAREST * 0.99 <= apart.min() <= FARTHEST * 1.01
            assert passage.sigma.argmin() in range(12, 29)
            assert passage.sigma.min() < 0.2 * passage.sigma.max()
            np.testing.assert_allclose(np.linalg.norm(passage.q[-1] - passage.q[0]), 2.0 * DESIGN.reach, rtol=1e-12)
            sizes = [np.linalg.norm(passage.b[0, a:b]) for a, b in itertools.pairwise(passage.offsets)]
            np.testing.assert_allclose(sizes, [DESIGN.speed, DESIGN.speed, DESIGN.posture_speed], rtol=1e-12)
            assert (passage.b == passage.b[0]).all()


def test_the_same_seed_draws_the_same_paths_and_another_one_others() -> None:
    place = places("planar4", 2, 0)[0]
    again = [next(passages(design, "planar4", place, 0)) for design in (DESIGN, DESIGN, Design(samples=41, seed=1))]
    np.testing.assert_array_equal(again[0].A, again[1].A)
    np.testing.assert_array_equal(again[0].b, again[1].b)
    assert not np.allclose(again[0].b, again[2].b)


def test_distance_is_that_of_the_second_level_in_the_null_space_of_the_first() -> None:
    A = np.array([[[1.0, 0.0, 0.0], [3.0, 0.0, 0.4]]])
    np.testing.assert_allclose(distance(A, np.array([0, 1, 2])), [0.4 / np.hypot(3.0, 0.4)], rtol=1e-12)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"configurations": 0}, "configurations is 0"),
        ({"paths": 1.5}, "paths is 1.5"),
        ({"samples": 40}, "must be odd"),
        ({"samples": 1}, "at least 3"),
        ({"reach": -0.1}, "reach is -0.1"),
        ({"speed": float("nan")}, "speed is nan"),
        ({"seed": True}, "seed is True"),
    ],
)
def test_wrong_designs_are_refused(given: dict[str, object], words: str) -> None:
    with pytest.raises(SettingError, match=words):
        Design(**given)
