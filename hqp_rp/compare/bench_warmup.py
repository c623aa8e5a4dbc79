"""Compile every kernel ahead of time, for the types that a problem passes, and say what each one took."""

from __future__ import annotations

import dataclasses
import importlib
import json
import os
import pkgutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from hqp_rp.compare.contestants import default_contestants
from hqp_rp.core.problem import Level, Problem
from hqp_rp.core.solver import all_solvers, get_solver


@dataclasses.dataclass(frozen=True, slots=True)
class Compiled:
    """One kernel: its name with its module, and the seconds that its own compilation took, callees not counted."""

    name: str
    seconds: float


@dataclasses.dataclass(frozen=True, slots=True)
class Warmup:
    """What a warm-up did.

    Attributes:
        compiled: every kernel that was compiled, the slowest first; empty when all of them came from the cache.
        cached: how many kernels that Python calls came from the cache on disk.
        seconds: of the whole, with imports.
        cold: kernels that Python calls and that nothing has called: empty, unless a kernel has no caller.
    """

    compiled: tuple[Compiled, ...]
    cached: int
    seconds: float
    cold: tuple[str, ...]


def warm_up_all(report: Callable[[str, int, int], None] | None = None) -> Warmup:
    """Compile, or load from the cache, every kernel that solvers, batches, verification, tasks and arms call.

    Args:
        report: told what is at work, how many pieces of work are done, and how many there are.
    """
    begin = time.perf_counter()
    from numba.core import event

    recorder = event.RecordingListener()  # type: ignore[no-untyped-call]
    work = list(_work())
    with event.install_listener("numba:compile", recorder):
        for i, (name, call) in enumerate(work):
            if report is not None:
                report(name, i, len(work))
            call()
    if report is not None:
        report("done", len(work), len(work))
    entries = list(_dispatchers())
    loaded = sum(sum(kernel.stats.cache_hits.values()) for _, kernel in entries)
    compiled = _own_seconds(recorder.buffer)
    cold = tuple(name for name, kernel in entries if not kernel.signatures and name in _entry_points(entries))
    return Warmup(compiled, loaded, time.perf_counter() - begin, cold)


def compile_from_nothing() -> Warmup:
    """`warm_up_all` in a fresh process on an empty cache: what the first use after an installation costs, a minute or two."""
    with tempfile.TemporaryDirectory() as cache:
        done = subprocess.run(
            [sys.executable, "-m", __name__],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "NUMBA_CACHE_DIR": cache},
        )
    found = json.loads(done.stdout.splitlines()[-1])
    compiled = tuple(Compiled(**kernel) for kernel in found.pop("compiled"))
    return Warmup(compiled, found["cached"], found["seconds"], tuple(found["cold"]))


def _problems() -> dict[str, Problem]:
    rng = np.random.default_rng(0)
    two = [Level.equality(rng.standard_normal((2, 7)), rng.standard_normal(2)) for _ in range(2)]
    band = Level(rng.standard_normal((2, 7)), -0.1, 0.1)
    box = Level(np.eye(7), -2.0, 2.0)
    return {
        "two levels": Problem(two),
        "three levels": Problem([*two, Level.equality(np.eye(7), np.zeros(7))]),
        "two-sided rows": Problem([band, *two]),
        "hard rows": Problem([*two, band], hard=box),
        "hard box": Problem(two, hard=box),
    }


def _work() -> Iterator[tuple[str, Callable[[], object]]]:
    """Every call that compiles a kernel: each solver and variant on the problems that it takes, batches, verification."""
    from hqp_rp.core.batch import solve_batch
    from hqp_rp.core.verify import fault_of

    problems = _problems()
    for contestant in default_contestants():
        solver = contestant.solver
        for problem in problems.values():
            if solver.refuses(problem) is None:

                def call(solver: Any = solver, problem: Problem = problem) -> None:
                    fresh = dataclasses.replace(solver)
                    fresh.solve(problem)
                    fresh.solve(problem, np.zeros(7))

                yield contestant.label, call
    problem = problems["three levels"]
    A, b = np.array(problem.matrix)[None], np.array(problem.lower)[None]
    settings: list[tuple[str, dict[str, Any]]] = [(name, {}) for name in all_solvers()]
    settings += [("null_space", {"variant": "projector"}), ("reverse_priority", {"form": "projector"})]
    for name, chosen in settings:
        solver = get_solver(name, **chosen)

        def batch(solver: Any = solver) -> None:
            solve_batch(A, b, None, problem.offsets, solver=solver)
            solver.solve(problem)

        yield f"{name}, batch", batch
    yield "task rows and kinematics", _step_rows
    for kind, one in problems.items():
        yield f"verification, {kind}", lambda one=one: fault_of(one, np.zeros(7), None, 1e-6)  # type: ignore[misc]


def _step_rows() -> None:
    """The rows of a stack, one configuration and many, and what the references use."""
    from hqp_rp.control._rotations import rotation_log
    from hqp_rp.control.posture_task import PostureTask
    from hqp_rp.control.stack import Stack
    from hqp_rp.robot.arms import planar_arm
    from hqp_rp.robot.mujoco_robot import MujocoRobot

    robot = MujocoRobot.from_arm(planar_arm(3))
    stack = Stack([PostureTask(robot.neutral)])
    stack.problem(robot)
    stack.batch(robot, robot.neutral[None])
    planar_arm(3).jacobian(robot.neutral)
    rotation_log(np.eye(3))


def _dispatchers() -> Iterator[tuple[str, Any]]:
    """Every kernel of the library, by module and name."""
    from numba.core.registry import CPUDispatcher

    package = importlib.import_module("hqp_rp.core.kernels")
    for info in pkgutil.iter_modules(package.__path__):
        module = importlib.import_module(f"{package.__name__}.{info.name}")
        for name, item in vars(module).items():
            if isinstance(item, CPUDispatcher) and item.py_func.__module__ == module.__name__:
                yield f"{info.name}.{name}", item


def _entry_points(entries: list[tuple[str, Any]]) -> set[str]:
    """Kernels that no other kernel names: the ones that Python calls."""
    called = {word for _, kernel in entries for word in kernel.py_func.__code__.co_names}
    return {name for name, _ in entries if name.partition(".")[2] not in called}


def _own_seconds(buffer: list[tuple[float, Any]]) -> tuple[Compiled, ...]:
    """Seconds of each kernel from nested start and end events.

    A kernel within another one counts for itself; what numba compiles of its own library counts for the kernel that needs it.
    """
    total: dict[str, float] = {}
    open_: list[list[Any]] = []
    for moment, found in buffer:
        if found.is_start:
            open_.append([_name(found.data["dispatcher"]), moment, 0.0])
        elif open_:
            name, start, inner = open_.pop()
            whole = moment - start
            if name:
                total[name] = total.get(name, 0.0) + whole - inner
            if open_:
                open_[-1][2] += whole if name else inner
    return tuple(Compiled(name, seconds) for name, seconds in sorted(total.items(), key=lambda pair: -pair[1]))


def _name(dispatcher: Any) -> str:
    """Module and name of a kernel of the library; "" for what numba brings along."""
    function = dispatcher.py_func
    if not function.__module__.startswith("hqp_rp."):
        return ""
    return f"{function.__module__.rpartition('.')[2]}.{function.__name__}"


if __name__ == "__main__":
    print(json.dumps(dataclasses.asdict(warm_up_all())))
