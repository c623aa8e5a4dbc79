"""Inertias that no rigid body can have are replaced by the nearest that one can."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hqp_rp import RobotError
from hqp_rp.robot import load_robot
from hqp_rp.robot.inertia import SMALLEST, nearest_principal_inertia
from tests.robot.models import URDF

values = st.floats(-1.0, 10.0)


@given(st.tuples(values, values, values))
def test_the_result_is_possible_and_a_possible_one_is_kept(principal):
    a, b, c = nearest_principal_inertia(np.array(principal))
    assert SMALLEST <= a <= b <= c < a + b
    low, middle, high = sorted(principal)
    if low >= SMALLEST and high <= low + middle:
        assert [a, b, c] == [low, middle, high]


@given(st.tuples(values, values, values), st.integers(0, 2**32 - 1))
def test_no_possible_inertia_is_nearer(principal, seed):
    """Among inertias with the clipped spectrum's ordering; the clip itself is the nearest point of A > 0."""
    clipped = np.maximum(np.sort(principal), SMALLEST)
    distance = np.linalg.norm(nearest_principal_inertia(np.array(principal)) - clipped)
    other = np.sort(np.random.default_rng(seed).uniform(SMALLEST, 10.0, 3))
    if other[2] <= other[0] + other[1]:
        assert np.linalg.norm(other - clipped) >= distance - 1e-7


def test_a_file_with_impossible_inertias_loads_when_asked_to(tmp_path):
    path = tmp_path / "model.urdf"
    possible = '<inertia ixx=".1" iyy=".2" izz=".15" ixy=".01" ixz="0" iyz=".02"/>'
    excess = '<inertia ixx=".1" iyy=".4" izz=".15" ixy="0" ixz="0" iyz="0"/>'
    path.write_text(URDF.replace(possible, excess))
    with pytest.raises(RobotError, match=r"repair_inertias=True makes the least change that MuJoCo accepts."):
        load_robot(path)
    repaired = load_robot(path, repair_inertias=True)
    model = repaired.model
    np.testing.assert_allclose(np.sort(model.body("fore").inertia), [0.15, 0.2, 0.35], atol=1e-6)
    # The same numbers, stated in the file, give the same robot: the axes were kept.
    path.write_text(URDF.replace(possible, '<inertia ixx=".15" iyy=".35" izz=".2" ixy="0" ixz="0" iyz="0"/>'))
    stated = load_robot(path, "pinocchio")
    for q, other in (([0.3, 0.0], [0.3, 1.0, 0.0]), ([-0.5, np.pi / 2], [-0.5, 0.0, 1.0])):
        repaired.update(np.array(q))
        stated.update(np.array(other))
        np.testing.assert_allclose(repaired.mass_matrix(), stated.mass_matrix(), atol=1e-6)


def test_a_repair_leaves_possible_inertias_alone(tmp_path):
    path = tmp_path / "model.urdf"
    path.write_text(URDF)
    plain, repaired = load_robot(path), load_robot(path, repair_inertias=True)
    np.testing.assert_allclose(plain.mass_matrix(), repaired.mass_matrix(), atol=1e-11)


def test_massless_links_between_joints_load_when_asked_to(tmp_path):
    path = tmp_path / "model.urdf"
    turning = URDF.replace('name="tool" type="fixed"', 'name="tool" type="continuous"')
    path.write_text(turning.replace('<link name="tool"/>', "").replace("</robot>", VIRTUAL + "</robot>"))
    with pytest.raises(RobotError, match="mass and inertia of moving bodies must be larger"):
        load_robot(path)
    first, second = load_robot(path, repair_inertias=True), load_robot(path, "pinocchio")
    np.testing.assert_allclose(first.mass_matrix(), second.mass_matrix(), atol=1e-10)


VIRTUAL = """
<link name="tool"/><link name="hand"><inertial><mass value="1"/>
<inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="wrist" type="revolute"><parent link="tool"/><child link="hand"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
"""
