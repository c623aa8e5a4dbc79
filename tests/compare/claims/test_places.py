"""Postures are regular where they should be, and singular where the second level loses a direction."""

from __future__ import annotations

import numpy as np
import pytest

from hqp_rp.compare.claims.places import LEAST_SIGMA, ROOM, regular_places, singular_places
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.arms import sawyer
from hqp_rp.scenarios._interaction import LOWER_AXES
from hqp_rp.scenarios.sawyer_priority_conflict import SawyerPriorityConflict

AXES = ("x", "y", "z", "rx", "ry", "rz")


def least(q: FloatArray, first: tuple[str, ...], lower: tuple[str, ...]) -> float:
    """Least singular value of the lower level in the null space of the first."""
    J = sawyer().jacobian(q, "tool")
    above, below = (J[[AXES.index(axis) for axis in axes]] for axes in (first, lower))
    null_space = np.linalg.svd(above)[2][len(above) :].T
    return float(np.linalg.svd(below @ null_space, compute_uv=False)[len(below) - 1])


def test_regular_postures_are_regular_and_begin_with_the_neutral_one() -> None:
    arm = sawyer()
    found = regular_places(8)
    np.testing.assert_array_equal(found[0].q, arm.neutral)
    for place in found:
        assert np.linalg.svd(arm.jacobian(place.q, "tool"), compute_uv=False)[-1] >= LEAST_SIGMA
        assert place.direction is not None
        assert np.linalg.norm(place.direction) == pytest.approx(1.0)
    for place in found[1:]:
        assert (np.abs(place.q) <= np.pi - ROOM).all()
    again = regular_places(8)
    assert all(np.array_equal(a.q, b.q) for a, b in zip(found, again, strict=True))
    assert not all(np.array_equal(a.q, b.q) for a, b in zip(found[1:], regular_places(8, seed=1)[1:], strict=True))


@pytest.mark.parametrize(
    ("first", "lower", "distance"),
    [(("x",), LOWER_AXES, 0.1), (("x",), ("y", "z"), 0.4), (("x", "y", "z"), ("rx", "ry", "rz"), 0.0)],
)
def test_singular_places_are_singular_and_their_starts_are_not(
    first: tuple[str, ...], lower: tuple[str, ...], distance: float
) -> None:
    found = singular_places((first, lower), 4, distance, edges=distance == 0.0)
    assert len({tuple(place.q.round(6)) for place in found}) == 4
    for place in found:
        assert least(place.q, first, lower) < 1e-6
        if distance:
            assert least(place.start(), first, lower) > 1e-4


def test_the_target_of_the_conflict_leads_towards_the_singularity_and_on() -> None:
    scenario, arm = SawyerPriorityConflict(), sawyer()
    for place in singular_places((("x",), ("y", "z")), 4, 0.4):
        case = scenario.case_at("well damped", place)
        assert case.axis is not None
        ahead = arm.pose(place.q, "tool")[1] - arm.pose(case.q, "tool")[1]
        assert case.axis @ ahead > 0.0
        assert case.axis[0] == 0.0


def test_too_few_singularities_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hqp_rp.compare.claims.places._STARTS", (4,))
    with pytest.raises(SettingError, match=r"The search finds \d+ singularities beside \('x',\); 1000 are asked for"):
        singular_places((("x",), LOWER_AXES), 1000, 0.1)
