"""A stress test: a robot, a stack, its singularities, every solver, as many samples as one likes."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import os
import tempfile
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from hqp_rp.compare.contestants import Contestant, choose_contestants, default_contestants
from hqp_rp.compare.machine import versions
from hqp_rp.compare.report.report import Report
from hqp_rp.compare.report.write import FILES, write_report
from hqp_rp.compare.run_folder import RunFolder
from hqp_rp.compare.stress.atlas import NAME as ATLAS
from hqp_rp.compare.stress.atlas import load_atlas, save_atlas
from hqp_rp.compare.stress.findings import answer
from hqp_rp.compare.stress.infeasible import infeasibility
from hqp_rp.compare.stress.plan import Plan, Scene, approachable, quiet, scene_of
from hqp_rp.compare.stress.record import StressResult
from hqp_rp.compare.stress.report import stress_report
from hqp_rp.compare.stress.rows import is_batched
from hqp_rp.compare.stress.run import dask_client, key, run_chunks, run_starts
from hqp_rp.compare.stress.subject import RobotLike, StackLike, Subject, subject_of
from hqp_rp.compare.stress.summary import summarize
from hqp_rp.compare.stress.worst import save_worst
from hqp_rp.control._sampling import Sampler
from hqp_rp.control.catalogue import find_singularities
from hqp_rp.core.errors import SettingError
from hqp_rp.core.solver import Solver
from hqp_rp.core.warned import warn

if TYPE_CHECKING:
    from hqp_rp.control.singularities import SingularConfiguration

SAMPLES = 10_000
STARTS = 64
CLOSED_FORMS = "closed_forms"
"""As a solver's name: every contestant of the default line-up that takes many problems in one compiled call.

Without limits in the stack, those that are then the same as others are left out."""

WORST_FOLDER = "worst"


class Stress(StressResult):
    """What a stress test found, and what it says: see `StressResult` for its attributes."""

    @property
    def answer(self) -> tuple[str, ...]:
        """The findings in a few sentences."""
        return answer(self)

    def report(self) -> Report:
        """The report as data."""
        return stress_report(self)


def stress(
    robot: RobotLike | None,
    stack: StackLike,
    *,
    dt: float | None = None,
    samples: int = SAMPLES,
    solvers: Sequence[str | Solver | Contestant] | None = None,
    output: str | os.PathLike[str] | None = None,
    seed: int = 0,
    starts: int = STARTS,
    overwrite: bool = False,
    workers: int | None = None,
    dask: str | None = None,
    progress: bool = False,
) -> Stress:
    """Sample configurations at random, near the joint limits and towards every singularity found, solve each with every
    solver, judge every answer, and write the report.

    The same seed gives the same rows, whatever the number of workers; a test that was stopped, however rudely, goes on
    where it stopped when it is started again with the same output folder.

    Args:
        robot: a `Robot`; an MJCF or URDF file, or a `RobotSource`, which says how to load one; "sawyer", "panda_like",
            "planar4", "dual_sawyer" or "humanoid"; None for the robot that the stack file says. A given `Robot` is not moved.
        stack: a `Stack`; a stack file, the name of one of the library's own, or a `StackFile`.
        dt: s, for how long an answer is held; needed by a `Stack` with limits, and None takes what the stack file says.
        samples: how many configurations, >= 1: about a third at random, near the limits, and on paths to singularities.
        solvers: as in `compare`, and "closed_forms" for all that take many problems at once; None means all. A stack
            without limits has neither with the solvers that are then the same as others, unless they are named.
        output: folder for report.html, report.md, figures, worst cases and Parquet parts; None keeps nothing.
        seed: >= 0. starts: of the search for singularities, for each level, >= 1.
        overwrite: replace the report of another run in `output`.
        workers: processes; None means one for each usable core.
        dask: address of a dask scheduler that takes the chunks instead.
        progress: show a progress bar on standard error.

    Raises:
        SettingError, UnknownNameError, RobotError, FileError: a wrong input, before any work starts. A robot and a stack
            that do not fit each other, a stack of limits alone, with limits and without dt, or one that cannot be pickled.
        MissingExtraError: dask is asked for and not installed.

    Warns:
        UserWarning: limits on accelerations or jerks that leave a robot at rest next to no speed within dt.
    """
    _integer("samples", samples, 1)
    _integer("seed", seed, 0)
    _integer("starts", starts, 1)
    if workers is not None:
        _integer("workers", workers, 1)
    subject = subject_of(robot, stack, dt)
    scene = scene_of(subject)
    if held := scene.held_at_rest():
        warn(held)
    chosen = _contestants(solvers, limits=not scene.plain)
    kept, left_out = _willing(chosen, scene)
    client = None if dask is None else dask_client(dask)
    run = _description(subject, samples, kept, seed, starts)
    try:
        with contextlib.ExitStack() as opened:
            if output is None:
                place = opened.enter_context(tempfile.TemporaryDirectory(prefix="hqp_rp-"))
                folder = RunFolder(place, run)
            else:
                folder = RunFolder(output, run, files=(*FILES, ATLAS, WORST_FOLDER), overwrite=overwrite)
            with quiet():
                places = _atlas(subject, folder, seed, starts, workers, progress)
                paths = approachable(scene, places)
            plan = Plan(subject, kept, samples, seed, paths, Sampler(scene.robot).limited)
            run_chunks(plan, folder, workers=workers, client=client, progress=progress)
            parts = (folder.load([key(chunk.index)]) for chunk in plan.chunks)
            levels = scene.stack.names
            summary = summarize(plan, levels, parts)
            why = infeasibility(plan, summary.infeasible, summary.some_infeasible)
            found = Stress(plan, levels, places, left_out, summary, why, held)
    finally:
        if client is not None:
            client.close()
    if output is None:
        return found
    found = dataclasses.replace(found, folder=folder.path)
    save_worst(found, folder.path / WORST_FOLDER)
    write_report(found.report(), folder.path)
    return found


def _atlas(
    subject: Subject, folder: RunFolder, seed: int, starts: int, workers: int | None, progress: bool
) -> tuple[SingularConfiguration, ...]:
    """The singular configurations, from the folder where a run that was stopped has found them."""
    path = folder.path / ATLAS
    if not path.exists():
        scene = scene_of(subject)
        refined = functools.partial(run_starts, subject, seed, workers=workers, progress=progress)
        found = find_singularities(scene.robot, scene.stack, starts=starts, seed=seed, dt=scene.dt, refined=refined)
        save_atlas(found.places, path)
    return load_atlas(path)


def _contestants(solvers: Sequence[str | Solver | Contestant] | None, *, limits: bool) -> tuple[Contestant, ...]:
    """Those asked for; of the default line-up and of the closed forms, without `limits`, none that only limits set apart."""
    if solvers is None:
        return default_contestants(limits=limits, transitions=False)
    if isinstance(solvers, str) or CLOSED_FORMS not in solvers:
        return choose_contestants(solvers)
    closed = [
        contestant
        for contestant in default_contestants(limits=limits, transitions=False)
        if is_batched(contestant.solver)
    ]
    rest = [item for item in solvers if not (isinstance(item, str) and item == CLOSED_FORMS)]
    return choose_contestants([*closed, *rest])


def _willing(
    contestants: tuple[Contestant, ...], scene: Scene
) -> tuple[tuple[Contestant, ...], tuple[tuple[str, str], ...]]:
    """Those that take such problems, and the others with what they say."""
    problem = scene.problem(scene.robot.neutral)
    told = [(contestant, contestant.solver.refuses(problem)) for contestant in contestants]
    kept = tuple(contestant for contestant, sentence in told if sentence is None)
    refused = tuple((contestant.label, sentence) for contestant, sentence in told if sentence is not None)
    if not kept:
        raise SettingError(f"No solver takes this stack: {refused[0][1]}")
    return kept, refused


def _description(
    subject: Subject, samples: int, contestants: Sequence[Contestant], seed: int, starts: int
) -> dict[str, Any]:
    return {
        "kind": "stress",
        **subject.description(),
        "samples": samples,
        "contestants": {contestant.label: repr(contestant.solver) for contestant in contestants},
        "seed": seed,
        "starts": starts,
        "versions": versions(),
    }


def _integer(name: str, value: object, least: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise SettingError(f"{name} is {value!r}; it must be an integer of at least {least}.")
