"""Projected torques: what each projection and each consistency keeps, as theorems on random mechanisms."""

import numpy as np
import pytest

from hqp_rp import Level, Problem, SettingError, Status, UnknownNameError, solve
from hqp_rp.solvers.null_space_torque import NullSpaceTorque
from tests.solvers.test_operational_space import mechanism, problem_of

K = np.arange(1.0, 8.0)


def settings(consistency):
    return {"consistency": consistency, **({"stiffness": K} if consistency == "stiffness" else {})}


def of_one_level(J, b, M):
    return np.linalg.solve(M, J.T @ np.linalg.solve(J @ np.linalg.solve(M, J.T), b))


@pytest.mark.parametrize("consistency", ["dynamic", "static", "stiffness"])
@pytest.mark.parametrize("projection", ["augmented", "successive"])
@pytest.mark.parametrize("seed", range(3))
def test_the_torque_is_that_of_the_formula(seed, projection, consistency):
    J, b, M = mechanism(seed, rows=(2, 2, 2))
    W = {"dynamic": M, "static": np.eye(7), "stiffness": np.diag(K)}[consistency]

    def projector(A):
        inverse = np.linalg.solve(W, A.T) @ np.linalg.inv(A @ np.linalg.solve(W, A.T))
        return np.eye(7) - A.T @ inverse.T

    N2 = projector(J[0])
    N3 = projector(np.vstack(J[:2])) if projection == "augmented" else projector(J[0]) @ projector(J[1])
    tau = M @ of_one_level(J[0], b[0], M) + N2 @ M @ of_one_level(J[1], b[1], M) + N3 @ M @ of_one_level(J[2], b[2], M)
    found = solve(problem_of(J, b, M), "null_space_torque", projection=projection, **settings(consistency))
    np.testing.assert_allclose(found.x, np.linalg.solve(M, tau), atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_dynamic_consistency_alone_keeps_the_first_level(seed):
    J, b, M = mechanism(seed)
    problem = problem_of(J, b, M)
    for projection in ("augmented", "successive"):
        x = solve(problem, "null_space_torque", projection=projection).x
        np.testing.assert_allclose(J[0] @ x, b[0], atol=1e-9)
        for other in ("static", "stiffness"):
            x = solve(problem, "null_space_torque", projection=projection, **settings(other)).x
            assert np.linalg.norm(J[0] @ x - b[0]) > 1e-3


@pytest.mark.parametrize("seed", range(5))
def test_only_the_augmented_projection_keeps_the_third_level_from_the_second(seed):
    J, b, M = mechanism(seed)
    without, everything = problem_of(J[:2], b[:2], M), problem_of(J, b, M)
    moved = {}
    for projection in ("augmented", "successive"):
        before, after = (solve(p, "null_space_torque", projection=projection).x for p in (without, everything))
        moved[projection] = np.linalg.norm(J[1] @ (after - before))
    assert moved["augmented"] < 1e-9 < 1e-3 < moved["successive"]


def test_static_consistency_puts_no_static_force_on_the_first_task():
    """The force that holds task 1 at rest, F = (J_1^+)^T tau, does not feel the projected torque."""
    J, b, M = mechanism(0, rows=(3, 2))
    M1 = M @ of_one_level(J[0], b[0], M)
    tau = M @ solve(problem_of(J, b, M), "null_space_torque", consistency="static").x
    np.testing.assert_allclose(np.linalg.pinv(J[0]).T @ (tau - M1), 0.0, atol=1e-9)


def test_it_corrects_nothing_that_operational_space_corrects():
    J, b, M = mechanism(1, rows=(3, 3))
    problem = problem_of(J, b, M)
    np.testing.assert_allclose(J[1] @ solve(problem, "operational_space").x, b[1], atol=1e-9)
    assert np.linalg.norm(J[1] @ solve(problem, "null_space_torque").x - b[1]) > 1e-3


def test_singular_levels_stay_finite():
    J, b, M = mechanism(0)
    problem = problem_of([np.vstack((J[0], J[0][:1])), J[1]], [np.append(b[0], 5.0), b[1]], M)
    for projection in ("augmented", "successive"):
        found = solve(problem, "null_space_torque", projection=projection)
        assert found.status is Status.SOLVED
        assert np.linalg.norm(found.x) < 1e3


def test_settings_are_checked():
    with pytest.raises(UnknownNameError, match="projection"):
        NullSpaceTorque(projection="other")
    with pytest.raises(UnknownNameError, match="consistency"):
        NullSpaceTorque(consistency="other")
    for bad in ({"consistency": "stiffness"}, {"stiffness": K}):
        with pytest.raises(SettingError, match="only with it"):
            NullSpaceTorque(**bad)
    J, b, M = mechanism(0)
    refused = solve(problem_of(J, b, M), "null_space_torque", consistency="stiffness", stiffness=np.ones(3))
    assert refused.status is Status.REFUSED
    hard = Problem([Level.equality(J[0], b[0])], Level(np.eye(7), -1.0, 1.0), metric=M)
    assert solve(hard, "null_space_torque").status is Status.REFUSED
