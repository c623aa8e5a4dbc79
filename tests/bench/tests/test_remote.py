"""Peers in environments of their own: the arm that they are given, and one that is not there."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from hqp_rp.robot.arms import sawyer
from hqp_rp.robot.model_file import load_robot
from tests.bench.remote import RemoteRunner, arm_urdf


def test_the_arm_as_urdf_is_the_arm(tmp_path: Path) -> None:
    arm = sawyer()
    path = tmp_path / "sawyer.urdf"
    path.write_text(arm_urdf(arm))
    robot = load_robot(path)
    q = np.linspace(-0.7, 0.9, 7)
    robot.update(q)
    assert robot.pose("tool")[1] == pytest.approx(arm.pose(q)[1], abs=1e-9)
    assert robot.pose("tool")[0] == pytest.approx(arm.pose(q)[0], abs=1e-9)


@pytest.mark.parametrize(("peer", "words"), [("no_such_peer", "KeyError"), ("roboplan", "ModuleNotFoundError")])
def test_a_peer_that_its_interpreter_lacks_is_a_sentence(peer: str, words: str) -> None:
    runner = RemoteRunner(peer, "x", Path(sys.executable), {})
    assert runner.version == ""
    assert f"{peer} takes no part" in runner.error
    assert words in runner.error


@pytest.mark.skipif(shutil.which("true") is None, reason="there is no program that ends without a word")
def test_a_process_that_ends_without_a_word_is_a_sentence() -> None:
    program = shutil.which("true")
    runner = RemoteRunner("placo", "x", Path(str(program)), {})
    assert runner.error == f"placo takes no part: under {program} it says nothing and ended with code 0."
