"""Where the time of a whole control step goes: kinematics, tasks and limits as a problem, solve."""

from __future__ import annotations

import dataclasses
import gc
import time

import numpy as np

from hqp_rp.core.solver import get_solver
from tests.bench.steps import DT, step_family

PARTS_OF_A_STEP = ("kinematics", "tasks", "solve")
"""`robot.update(q)`; `stack.problem(robot)`, which asks the robot for poses and Jacobians; `null_space`."""


@dataclasses.dataclass(frozen=True, slots=True)
class StepParts:
    """One robot with its stack: median seconds of each of `PARTS_OF_A_STEP`, and of the three together."""

    name: str
    title: str
    seconds: tuple[float, float, float]
    whole: float


def step_parts(name: str, *, quick: bool = False, rounds: int = 4) -> StepParts:
    """Walk the family's path `rounds` times and time every part of every step; one round before is not counted.

    What solves is null_space, or with limits the active set, warm.

    Args:
        name: of `steps.STEP_FAMILIES`.
    """
    made = step_family(name, quick=quick)
    robot, stack, clock = made.robot, made.stack, time.perf_counter_ns
    solve = get_solver("hierarchical_active_set" if made.limited else "null_space").solve
    dt = DT if made.limited else None
    count = len(made.configurations)
    moments = np.empty(((rounds + 1) * count, len(PARTS_OF_A_STEP) + 1), dtype=np.int64)
    enabled = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        for i in range(len(moments)):
            q = made.configurations[i % count]
            start = clock()
            robot.update(q)
            updated = clock()
            problem = stack.problem(robot, dt)
            built = clock()
            solve(problem)
            moments[i] = (start, updated, built, clock())
    finally:
        if enabled:
            gc.enable()
    kept = moments[count:]
    parts = np.median(np.diff(kept, axis=1), axis=0) * 1e-9
    whole = float(np.median(kept[:, -1] - kept[:, 0])) * 1e-9
    return StepParts(name, made.title, (float(parts[0]), float(parts[1]), float(parts[2])), whole)
