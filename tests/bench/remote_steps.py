"""Control steps of peers in environments of their own: who is found, what it is asked, how it is judged."""

from __future__ import annotations

import functools
import pathlib
import sys
from collections.abc import Sequence
from typing import Any

from hqp_rp.compare.report.sentences import Sentences
from tests.bench.entrants import not_installed
from tests.bench.remote import REMOTE_PEERS, RemoteRunner, arm_urdf
from tests.bench.steps import COSTS, DT, GAIN, StepFamily, Stepper

say = Sentences(__file__)


def remote_steppers(
    made: StepFamily, chosen: Sequence[Stepper], peers: Sequence[str], peer_python: Sequence[str]
) -> tuple[list[tuple[Stepper, RemoteRunner]], list[str], dict[str, str]]:
    """The peers in environments of their own, a sentence for each that takes no part, and the versions of those that do."""
    wanted = [peer for peer in peers if peer in REMOTE_PEERS]
    pythons = [pathlib.Path(path) for path in peer_python] or [pathlib.Path(sys.executable)]
    found, missing, found_versions = [], [], {}
    for peer in wanted:
        sentences = []
        for python in pythons:
            runner = RemoteRunner(peer, peer, python, _task_words(made))
            if runner.error:
                sentences.append(runner.error)
                continue
            # pink's tasks are mink's, the logarithm of SE(3); those of placo and roboplan are ours.
            theirs = [stepper for stepper in chosen if stepper.peer] if peer == "pink" else []
            problems = (theirs or chosen)[0].problems
            calls = tuple(functools.partial(runner.answer, i) for i in range(len(made.configurations)))
            settings = say("own_process", peer=peer, version=runner.version, costs=COSTS[:3])
            found.append((Stepper(peer, True, settings, calls, lambda v: v, problems), runner))
            found_versions[peer] = runner.version
            break
        else:
            here = not peer_python and "ModuleNotFoundError" in sentences[0]
            missing.append(not_installed(peer) if here else sentences[0])
    return found, missing, found_versions


def _task_words(made: StepFamily) -> dict[str, Any]:
    from hqp_rp.robot.arms import sawyer

    robot = made.robot
    robot.update(robot.neutral)
    rotation, position = robot.pose("tool")
    return {
        "urdf": arm_urdf(sawyer()),
        "configurations": made.configurations.tolist(),
        "neutral": robot.neutral.tolist(),
        "rotation": rotation.tolist(),
        "position": position.tolist(),
        "costs": COSTS[:3],
        "gain": GAIN,
        "dt": DT,
        "solver": "daqp",
    }
