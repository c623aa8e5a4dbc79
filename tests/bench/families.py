"""The problems that solvers are timed on, made anew from a seed."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Sequence

import numpy as np

from hqp_rp.core.errors import unknown_name
from hqp_rp.core.problem import FloatArray, Level, Problem

Rng = np.random.Generator


@dataclasses.dataclass(frozen=True, slots=True)
class Family:
    """Problems of one shape.

    Attributes:
        name: what `--family` calls it. title: for tables. words: how it is made.
        problems: the instances; `path` says that they are neighbours along a closed path, so that a warm start pays.
    """

    name: str
    title: str
    words: str
    problems: tuple[Problem, ...]
    path: bool = False

    @property
    def joints(self) -> int:
        """Number of unknowns."""
        return self.problems[0].n


_NORMAL = "A and b normal"


def random_problem(rng: Rng, n: int, rows: Sequence[int]) -> Problem:
    """Equality levels of these many rows, entries and targets standard normal."""
    return Problem([Level.equality(rng.standard_normal((m, n)), rng.standard_normal(m)) for m in rows])


def _random(n: int, rows: Sequence[int]) -> Callable[[Rng, int], list[Problem]]:
    return lambda rng, count: [random_problem(rng, n, rows) for _ in range(count)]


def _sawyer(path: bool = False, limits: bool = False) -> Callable[[Rng, int], list[Problem]]:
    """Tool position, tool orientation and posture of the Sawyer; rates that need about the joints' own speed."""

    def make(rng: Rng, count: int) -> list[Problem]:
        from hqp_rp.robot.arms import sawyer

        arm = sawyer()
        middle = rng.uniform(-1.0, 1.0, 7)
        phase, wave = rng.uniform(0.0, 2.0 * np.pi, 7), rng.uniform(0.0, 2.0 * np.pi, 13)
        problems = []
        for i in range(count):
            turn = 2.0 * np.pi * i / count
            q = middle + 0.5 * np.sin(turn + phase) if path else rng.uniform(-1.5, 1.5, 7)
            rates = np.sin(2.0 * turn + wave) if path else rng.uniform(-1.0, 1.0, 13)
            J = arm.jacobian(q)
            levels = [
                Level.equality(J[:3], rates[:3] * (1.5 if limits else 0.5), name="tool position"),
                Level.equality(J[3:], rates[3:6] * (1.5 if limits else 0.5), name="tool orientation"),
                Level.equality(np.eye(7), rates[6:] * 0.5, name="posture"),
            ]
            speed = np.array(arm.velocity_limit)
            problems.append(Problem(levels, hard=Level(np.eye(7), -speed, speed, "velocity") if limits else None))
        return problems

    return make


def _humanoid(rows: int, path: bool = False) -> Callable[[Rng, int], list[Problem]]:
    """38 unknowns, `rows` two-sided hard rows around 0, then 12 + 3 + 6 + 38 equalities."""

    def make(rng: Rng, count: int) -> list[Problem]:
        def draw() -> tuple[FloatArray, FloatArray]:
            return rng.standard_normal((rows + 59, 38)) / np.sqrt(38.0), rng.standard_normal(59)

        (A, b), (dA, db) = draw(), draw()
        half = rng.uniform(0.2, 1.0, rows)
        problems = []
        for i in range(count):
            if path:
                wave = 0.3 * np.sin(2.0 * np.pi * i / count)
                matrix, target = A + wave * dA, b + wave * db
            else:
                matrix, target = draw()
                half = rng.uniform(0.2, 1.0, rows)
            ends = rows + np.cumsum((0, 12, 3, 6, 38))
            levels = [
                Level.equality(matrix[start:end], target[start - rows : end - rows])
                for start, end in itertools.pairwise(ends)
            ]
            problems.append(Problem(levels, hard=Level(matrix[:rows], -half, half, "two-sided")))
        return problems

    return make


_MADE: dict[str, tuple[str, str, Callable[[Rng, int], list[Problem]], int, bool]] = {
    "7_3-3": ("7 joints, 3+3", _NORMAL, _random(7, (3, 3)), 64, False),
    "7_1-5": ("7 joints, 1+5", _NORMAL, _random(7, (1, 5)), 64, False),
    "7_6-1-7": ("7 joints, 6+1+7", _NORMAL, _random(7, (6, 1, 7)), 64, False),
    "7_3-3-7": ("7 joints, 3+3+7", "Sawyer: tool position, orientation, posture; q uniform", _sawyer(), 64, False),
    "7_limits": ("7 joints, 3+3+7, hard velocity limits", "the same, faster, with the joints' velocity limits as hard rows",
                 _sawyer(limits=True), 64, False),
    "7_limits_path": ("7 joints, limits, along a path", "the same along a closed path of 400 neighbours",
                      _sawyer(path=True, limits=True), 400, True),
    "30": ("30 joints, 6+6+3+12+30", _NORMAL, _random(30, (6, 6, 3, 12, 30)), 24, False),
    "humanoid_20": ("humanoid, 20 hard two-sided rows", f"{_NORMAL}; n = 38, levels 12+3+6+38", _humanoid(20), 16, False),
    "humanoid_40": ("humanoid, 40 hard two-sided rows", f"{_NORMAL}; n = 38, levels 12+3+6+38", _humanoid(40), 16, False),
    "humanoid_60": ("humanoid, 60 hard two-sided rows", f"{_NORMAL}; n = 38, levels 12+3+6+38", _humanoid(60), 16, False),
    "humanoid_40_path": ("humanoid, 40 rows, along a path", "the same along a closed path of 400 neighbours",
                         _humanoid(40, path=True), 400, True),
    "100": ("100 unknowns, 6 levels of 15", _NORMAL, _random(100, (15,) * 6), 8, False),
}  # fmt: skip

FAMILIES = tuple(_MADE)
"""Names of the families, small ones first."""


def family(name: str, *, seed: int = 0, quick: bool = False) -> Family:
    """The family of that name; `quick` makes fewer instances. Raises `UnknownNameError`."""
    if name not in _MADE:
        raise unknown_name("family of the benchmark", name, _MADE)
    title, words, make, count, path = _MADE[name]
    rng = np.random.default_rng([seed, FAMILIES.index(name)])
    count = count if not quick or path else max(count // 4, 4)
    return Family(name, title, words, tuple(make(rng, count)), path)
