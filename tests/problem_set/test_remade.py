"""The set is remade bit for bit from its seeds, and the robots' numbers from their models."""

from __future__ import annotations

import numpy as np
import pytest

from hqp_rp import problems
from hqp_rp.problems import make as make_module
from hqp_rp.problems import robots as robots_module
from hqp_rp.problems.known_problem import to_arrays
from hqp_rp.problems.make import differences, make, read_arrays, recipes
from hqp_rp.problems.recipe import Draw
from hqp_rp.problems.robots import (
    SHOULDER,
    SIGMAS,
    TORQUE_STATES,
    dual_arm_arrays,
    inertia_array,
    load_snapshot,
    sawyer_arrays,
    torque_arrays,
    torque_states,
)
from hqp_rp.robot import sawyer

RECIPES = {recipe.name: recipe for recipe in recipes()}
PROBLEM_ARRAYS = (
    *("matrix", "lower", "upper", "offsets", "names", "hard_A", "hard_lower", "hard_upper", "hard_name"),
    *("metric", "damping_kind", "damping_parameters"),
)


def test_the_draw_is_the_same_everywhere() -> None:
    # Pinned: another value would change every random problem of the set.
    draw = Draw(1000)
    assert draw.integers(-9, 9, 6).tolist() == [-3, 9, -5, -9, 0, 7]
    assert (draw.grid(3) * 2**20).tolist() == [827084.0, 466262.0, -286222.0]
    values = Draw(1).grid(20_000, 2.0, 3)
    assert set(values.tolist()) == {k / 4 for k in range(-8, 9)}
    assert abs(values.mean()) < 0.05


def test_every_problem_is_remade_bit_for_bit() -> None:
    assert set(RECIPES) == set(problems.names())
    for name, recipe in RECIPES.items():
        kept, problem = read_arrays(problems.path(name)), recipe.problem()
        made = {key: getattr(problem, key) for key in ("matrix", "lower", "upper", "offsets")}
        made["names"] = np.array(problem.names)
        if problem.hard is not None:
            made |= {f"hard_{key}": getattr(problem.hard, key) for key in ("A", "lower", "upper")}
            made["hard_name"] = np.array(problem.hard.name)
        if problem.metric is not None:
            made["metric"] = problem.metric
        if problem.damping is not None:
            factors = [0.0 if policy is None else policy.factor for policy in problem.damping]
            made["damping_kind"] = np.array([int(factor > 0.0) for factor in factors])
            made["damping_parameters"] = np.array([(factor, 0.0) for factor in factors])
        assert not differences(made, {key: kept[key] for key in PROBLEM_ARRAYS if key in kept}), name


SAMPLE = [problems.names(family)[i] for family in problems.families() for i in (0, -1)]


@pytest.mark.parametrize("name", [*SAMPLE, "sawyer/3-3-7_limits_q1"])
def test_a_sample_is_remade_with_its_answers(name: str) -> None:
    assert not differences(to_arrays(make(RECIPES[name])), read_arrays(problems.path(name)))


def test_a_changed_bit_is_found(tmp_path, monkeypatch, capsys) -> None:
    name = "independent/n7_4_s0"
    arrays = read_arrays(problems.path(name))
    arrays["x"] = np.nextafter(arrays["x"], np.inf)
    (tmp_path / "independent").mkdir()
    np.savez(tmp_path / f"{name}.npz", **arrays)
    np.savez(tmp_path / "independent" / "stray.npz", **arrays)
    monkeypatch.setattr(problems, "DATA", tmp_path)
    monkeypatch.setattr(make_module, "PAGES", ())
    monkeypatch.setattr(make_module, "recipes", lambda: [RECIPES[name]])
    assert make_module.main(["--check"]) == 2
    assert "independent/n7_4_s0: x\nstray.npz: no recipe makes it" in capsys.readouterr().out
    assert make_module.main([]) == 2
    assert make_module.main(["--check"]) == 0
    assert not (tmp_path / "independent" / "stray.npz").exists()


def test_snapshot_of_the_arms_is_that_of_their_models() -> None:
    kept = load_snapshot()
    for name in kept:
        robot, where, what = (*name.split("/"), "")[:3]
        if what != "q" or robot in ("humanoid", "torque"):
            continue
        remade = (sawyer_arrays if robot == "sawyer" else dual_arm_arrays)(kept[name])
        for key, array in remade.items():
            np.testing.assert_allclose(kept[f"{robot}/{where}/{key}"], array, atol=1e-14, err_msg=f"{name} {key}")


def test_inertia_and_torques_in_the_snapshot_are_those_of_the_model() -> None:
    kept = load_snapshot()
    for i in range(3):
        M = kept[f"sawyer/{i}/inertia"]
        np.testing.assert_allclose(M, inertia_array(kept[f"sawyer/{i}/q"]), atol=1e-14)
        assert np.array_equal(M, M.T)
        assert np.linalg.eigvalsh(M)[0] > 0.0
    assert len(list(torque_states())) == TORQUE_STATES
    for i, (q, v, aims) in enumerate(torque_states()):
        for name, array in torque_arrays(q, v, aims).items():
            np.testing.assert_allclose(kept[f"torque/{i}/{name}"], array, rtol=1e-9, atol=1e-9, err_msg=f"{i} {name}")


def test_adding_to_the_snapshot_leaves_what_is_there(tmp_path, monkeypatch, capsys) -> None:
    kept = load_snapshot()
    file = tmp_path / "robots.npz"
    np.savez(
        file,
        **{**{name: kept[name] for name in kept if name != "torque/1/target"}, "sawyer/0/q": kept["sawyer/0/q"] + 1.0},
    )
    monkeypatch.setattr(robots_module, "SNAPSHOT", file)
    monkeypatch.setattr(robots_module, "arms", lambda: {name: kept[name] for name in ("sawyer/0/q", "torque/1/target")})
    robots_module.main([])
    with np.load(file) as now:
        assert np.array_equal(now["torque/1/target"], kept["torque/1/target"])
        assert np.array_equal(now["sawyer/0/q"], kept["sawyer/0/q"] + 1.0)
        assert len(now.files) == len(kept)
    robots_module.main(["--anew"])
    with np.load(file) as now:
        assert np.array_equal(now["sawyer/0/q"], kept["sawyer/0/q"])
    assert "largest difference 1.0e+00" in capsys.readouterr().out


def test_relative_jacobian_of_the_dual_arm_against_finite_differences() -> None:
    arm, shift = sawyer(), np.array([0.0, 2.0 * SHOULDER, 0.0])

    def relative(q):
        (R, p), (S, r) = arm.pose(q[:7]), arm.pose(q[7:])
        return R.T @ S, R.T @ (r - p - shift)

    kept = load_snapshot()
    q, J, h = kept["dual_arm/1/q"], kept["dual_arm/1/relative"], 1e-6
    R, _ = relative(q)
    for j, step in enumerate(h * np.eye(14)):
        (R_up, p_up), (R_down, p_down) = relative(q + step), relative(q - step)
        spin = (R_up - R_down) @ R.T / (2 * h)
        np.testing.assert_allclose(J[:3, j], (p_up - p_down) / (2 * h), atol=1e-8)
        np.testing.assert_allclose(J[3:, j], [spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-8)


@pytest.mark.parametrize("sigma", SIGMAS)
def test_the_sawyer_is_at_the_stated_distance(sigma: float) -> None:
    first, second = problems.load(f"sawyer/3-3-7_sigma{sigma:.0e}").problem.levels[:2]
    Z = np.linalg.svd(first.A)[2][3:].T
    smallest = np.linalg.svd(second.A @ Z, compute_uv=False)[-1] / np.linalg.norm(second.A, 2)
    assert smallest == pytest.approx(sigma, rel=0.3 if sigma > 0.05 else 0.03)
    assert np.linalg.svd(second.A, compute_uv=False)[-1] > 0.1  # algorithmic: the task itself keeps full rank


def test_humanoid_jacobians_are_those_of_hinges_on_a_floating_base() -> None:
    kept = load_snapshot()
    for name, J in kept.items():
        if not name.startswith("humanoid/") or len(J) != 6:
            continue
        np.testing.assert_allclose(J[:3, :3], np.eye(3), atol=1e-12)
        np.testing.assert_allclose(J[3:, :3], 0.0, atol=1e-12)
        axes = np.linalg.norm(J[3:, 6:], axis=0)
        assert np.all((np.abs(axes - 1.0) < 1e-9) | (axes < 1e-12)), name
        assert 3 <= (axes > 0.5).sum() <= 12  # the joints between base and frame
        # A hinge moves every point across its axis.
        np.testing.assert_allclose((J[:3, 6:] * J[3:, 6:]).sum(axis=0), 0.0, atol=1e-12)
    for i in range(4):
        np.testing.assert_allclose(kept[f"humanoid/{i}/com"][:, :3], np.eye(3), atol=1e-9)
