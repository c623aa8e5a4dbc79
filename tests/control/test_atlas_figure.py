"""The atlas of singularities as a figure: a line for each configuration, joint by joint."""

from __future__ import annotations

import numpy as np
import pytest

from hqp_rp import find_singularities
from hqp_rp.control.stack_file import load_stack
from hqp_rp.core.diagnostics import Singularity
from hqp_rp.robot.named import named_robot


def test_every_place_is_a_line_over_the_joints_between_their_limits() -> None:
    robot = named_robot("planar4")
    catalogue = find_singularities(robot, load_stack("planar4").stack(robot), starts=6)
    figure = catalogue.plot()
    groups = [catalogue.of(0, Singularity.KINEMATIC), catalogue.of(1, Singularity.ALGORITHMIC)]
    assert [len(axis.lines) for axis in figure.axes] == [len(places) for places in groups]
    for axis, places in zip(figure.axes, groups, strict=True):
        for line, place in zip(axis.lines, places, strict=True):
            share = np.asarray(line.get_ydata(), dtype=float)
            np.testing.assert_allclose(robot.lower + share * (robot.upper - robot.lower), place.q, atol=1e-12)
    assert figure.axes[0].get_title(loc="left") == f"1 tool position: {len(groups[0])} kinematic"
    assert [label.get_text() for label in figure.axes[-1].get_xticklabels()] == list(robot.joint_names)


def test_an_empty_atlas_says_so() -> None:
    robot = named_robot("planar4")
    catalogue = find_singularities(robot, load_stack("planar4").stack(robot), starts=1, level=2)
    assert not len(catalogue)
    (axis,) = catalogue.plot().axes
    assert axis.get_title(loc="left") == "No singularity was found."


@pytest.mark.parametrize("name", ["humanoid"])
def test_a_floating_base_is_drawn_by_its_velocities(name: str) -> None:
    robot = named_robot(name)
    catalogue = find_singularities(robot, load_stack(name).stack(robot), starts=1, level=2)
    labels = [label.get_text() for label in catalogue.plot().axes[-1].get_xticklabels()]
    assert labels == [str(i) for i in range(robot.nv)]
