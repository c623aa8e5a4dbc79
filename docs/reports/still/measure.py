"""Which damping keeps an arm still at a target out of reach, at every step and gain?

    export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
    python docs/reports/still/measure.py          # half an hour on two cores: report.md, figure.png and runs.csv here
    python docs/reports/still/measure.py --draw   # the arms' runs from runs.csv; the short runs anew, some minutes

Position above orientation above posture, hard joint limits, an ideal robot that does what it is told.
"""

from __future__ import annotations

import argparse
import csv
import dataclasses
import functools
import itertools
import multiprocessing
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import hqp_rp
from hqp_rp import ErrorDamping, JointLimit, OrientationTask, PositionTask, PostureTask, Stack, VariableDamping
from hqp_rp.robot import MujocoRobot, panda_like, sawyer

HERE = Path(__file__).parent
SOLVER = "hierarchical_active_set"
ARMS = {"Sawyer": 1.0, "Panda-like arm": 0.86}
"""Reach, m, from the shoulder to the tool."""
STEPS = (0.001, 0.002, 0.01)
GAINS = (1.0, 5.0, 20.0)
ACCELERATIONS = (None, 20.0)
"""rad/s^2, in both directions; None: positions and velocities alone."""
STILL = 1.0
"""rad/s^2: an arm is still if no joint accelerated harder in the last `QUIET` seconds."""
QUIET = 0.5
"""s."""
FIRST, SECOND = 0.05, 1.0
"""The rule: factors reach * max(FIRST / gain, dt) and SECOND / gain, of levels 1 and 2."""
SWEEP = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
SWEPT = ((0.001, 1.0), (0.001, 5.0), (0.001, 20.0), (0.01, 5.0))
"""Step, s, and gain, 1/s."""
DIRECTIONS = ((1, 0, 0.3), (1, 0.5, 0.2), (0.3, 1, 0.1), (0.2, -0.3, 1), (1, -0.4, -0.4), (-0.3, -1, 0.5))
BEYOND = (0.1, 0.5, 0.3, 0.2, 0.003, -0.01)
"""m, of the target along each direction from where position alone comes to rest: four far, one just out, one stretched."""
Factors = Callable[[float, float, float], tuple[float, float]]
RULES: dict[str, Factors] = {
    "not damped": lambda reach, dt, gain: (0.0, 0.0),
    "reach dt, 10 reach dt": lambda reach, dt, gain: (reach * dt, 10.0 * reach * dt),
    "reach dt, 100 reach dt": lambda reach, dt, gain: (reach * dt, 100.0 * reach * dt),
    "0.05 reach/gain, 1/gain": lambda reach, dt, gain: (reach * max(FIRST / gain, dt), SECOND / gain),
    "0.05 reach/gain, 5/gain": lambda reach, dt, gain: (reach * max(FIRST / gain, dt), 5.0 / gain),
}
RULE, STRICT = "0.05 reach/gain, 1/gain", "0.05 reach/gain, 5/gain"


@dataclasses.dataclass(frozen=True)
class Case:
    """One run. first, second: factors of `ErrorDamping(..., power=1)` of levels 1 and 2, 0 for none."""

    part: str
    rule: str
    arm: str
    target: int
    dt: float
    gain: float
    acceleration: float | None
    first: float
    second: float
    posture: float = 0.1


@dataclasses.dataclass(frozen=True)
class Result:
    """hardest: rad/s^2, the largest acceleration in the last `QUIET` seconds. settled: s, until none was above `STILL` again.
    position: m, orientation: rad, errors at the end."""

    hardest: float
    settled: float
    position: float
    orientation: float


def factor(c: float) -> ErrorDamping | None:
    return ErrorDamping(c, power=1) if c else None


@functools.cache
def robot_of(arm: str) -> MujocoRobot:
    return MujocoRobot.from_arm({"Sawyer": sawyer, "Panda-like arm": panda_like}[arm]())


def drive(
    robot: Any, stack: Stack, dt: float, seconds: float, watch: Callable[[], Any] = lambda: None
) -> tuple[np.ndarray, list[Any]]:
    """The largest acceleration of a joint at each step, rad/s^2, and what `watch` saw; ends when quiet for `QUIET` s."""
    solver = hqp_rp.get_solver(SOLVER)
    v, hardest, seen, quiet = np.zeros(robot.nv), [], [], 0
    for _ in range(round(seconds / dt)):
        answer = solver.solve(stack.problem(robot, dt, v)).x
        before, v = v, v if answer is None else answer  # a step without an answer repeats the one before
        robot.update(robot.integrate(robot.q, v, dt))
        hardest.append(float(np.abs(v - before).max()) / dt)
        seen.append(watch())
        quiet = quiet + 1 if hardest[-1] < 0.1 * STILL and np.abs(v).max() < 0.01 else 0
        if quiet * dt >= QUIET:
            break
    return np.array(hardest), seen


@functools.cache
def targets(arm: str) -> tuple[np.ndarray, ...]:
    """Places of the targets, and the distance that the position alone leaves over at each."""
    robot, found = robot_of(arm), []
    shoulder = np.array([0.0, 0.0, 0.32])
    for direction, beyond in zip(DIRECTIONS, BEYOND, strict=True):
        out = np.array(direction, dtype=float) / np.linalg.norm(direction)
        far = shoulder + 1.6 * out
        tip = alone(robot, far)
        found.append(tip + beyond * (far - tip) / np.linalg.norm(far - tip))
    return tuple(found)


def alone(robot: Any, target: np.ndarray) -> np.ndarray:
    """(3,) m: where the tool comes to rest if nothing but its position is asked for."""
    robot.update(robot.neutral)
    stack = Stack([PositionTask("tool", target, gain=5.0)], [JointLimit()], damping=[ErrorDamping(0.002, power=1)])
    drive(robot, stack, 0.002, 6.0)
    return robot.pose("tool")[1]


@functools.cache
def least(arm: str) -> tuple[float, ...]:
    return tuple(float(np.linalg.norm(alone(robot_of(arm), target) - target)) for target in targets(arm))


def levels_of(robot: Any, target: np.ndarray, gain: float, posture: float) -> list[Any]:
    robot.update(robot.neutral)
    rotation = robot.pose("tool")[0]
    return [
        PositionTask("tool", target, gain=gain),
        OrientationTask("tool", rotation, gain=gain),
        PostureTask(robot.neutral, gain=posture * gain),
    ]


def measure(case: Case) -> Result:
    robot = robot_of(case.arm)
    levels = levels_of(robot, targets(case.arm)[case.target], case.gain, case.posture)
    damping = [factor(case.first), factor(case.second), None]
    if case.rule.startswith("variable"):
        delta = float(case.rule.split()[1])
        damping = [VariableDamping(delta, delta), VariableDamping(delta, delta), None]
    stack = Stack(levels, [JointLimit(acceleration=case.acceleration)], damping=damping)
    hardest, _ = drive(robot, stack, case.dt, {1.0: 10.0, 5.0: 6.0}.get(case.gain, 5.0))
    moving = np.flatnonzero(hardest > STILL)
    return Result(
        float(hardest[-round(QUIET / case.dt) :].max()),
        float((moving[-1] + 1) * case.dt) if len(moving) else 0.0,
        float(np.linalg.norm(levels[0].error(robot))),
        float(np.linalg.norm(levels[1].error(robot))),
    )


def cases() -> list[Case]:
    found = []
    for (arm, reach), target in itertools.product(ARMS.items(), range(len(DIRECTIONS))):
        for rule, dt, gain, acceleration in itertools.product(RULES, STEPS, GAINS, ACCELERATIONS):
            if rule != "not damped" or gain == 5.0:
                factors = RULES[rule](reach, dt, gain)
                found.append(Case("matrix", rule, arm, target, dt, gain, acceleration, *factors))
        for (dt, gain), second in itertools.product(SWEPT, SWEEP):
            first = reach * max(FIRST / gain, dt)
            found.append(Case("sweep", f"{second:g}/gain", arm, target, dt, gain, None, first, second / gain))
        for rule in ("variable 0.03", "variable 0.1"):
            found.append(Case("other", rule, arm, target, 0.001, 5.0, 20.0, 0.0, 0.0))
        factors = RULES[RULE](reach, 0.001, 5.0)
        found.append(Case("other", "posture gain as the tool's", arm, target, 0.001, 5.0, 20.0, *factors, 1.0))
    return found


def as_row(case: Case, result: Result) -> list[str]:
    row = [*dataclasses.astuple(case), *dataclasses.astuple(result)]
    return [f"{item:.5g}" if isinstance(item, float) else "" if item is None else str(item) for item in row]


def from_row(row: Sequence[str]) -> tuple[Case, Result]:
    part, rule, arm, target, dt, gain, acceleration, *rest = row
    numbers = [float(item) for item in rest]
    limit = float(acceleration) if acceleration else None
    return Case(part, rule, arm, int(target), float(dt), float(gain), limit, *numbers[:3]), Result(*numbers[3:])


def main() -> None:
    from written import draw, report

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draw", action="store_true", help="take the arms' runs from runs.csv")
    path = HERE / "runs.csv"
    if not parser.parse_args().draw:
        for arm in ARMS:
            targets(arm)  # once, before the workers are forked
        with multiprocessing.Pool() as pool, path.open("w", encoding="utf-8", newline="") as file:
            table = csv.writer(file, lineterminator="\n")
            table.writerow(field.name for kind in (Case, Result) for field in dataclasses.fields(kind))
            for case, result in zip(cases(), pool.imap(measure, cases(), chunksize=4), strict=True):
                table.writerow(as_row(case, result))
    with path.open(encoding="utf-8", newline="") as file:
        found = [from_row(row) for row in itertools.islice(csv.reader(file), 1, None)]
    draw(found)
    report(found)


if __name__ == "__main__":
    main()
