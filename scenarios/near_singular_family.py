"""How accurate is each solver as the second level's rows approach the span of the first's?"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import Level, Problem
from hqp_rp.core.solver import Solver
from hqp_rp.scenarios.scenario import Scenario, Step, timed_solve


@dataclasses.dataclass(frozen=True, kw_only=True)
class NearSingularFamily(Scenario):
    """Random stacks with A_2 = C A_1 + eps R, eps from 1 down to 1e-14: eps is the distance to an algorithmic singularity.

    A_1 (3, n), C (3, 3), R (3, n), every b and the third level's n rows have independent standard normal entries, drawn
    once for a seed and kept for every eps. "two levels" is [A_1; A_2]; "three levels" adds a full-rank level below them,
    as a posture task would, so that nothing remains free. A_1 alone and A_2 alone keep full rank at every eps > 0.

    Args:
        n: number of unknowns, at least 7.
        smallest: the smallest eps, in (0, 1].
        per_decade: how many eps a decade.
    """

    n: int = 7
    smallest: float = 1e-14
    per_decade: int = 4

    name: ClassVar[str] = "near_singular_family"
    question: ClassVar[str] = (
        "How accurate is each solver, level by level, as an algorithmic singularity is approached?"
    )
    cannot_tell: ClassVar[tuple[str, ...]] = (
        "The matrices are random, not a robot's: their levels have no units and one typical scale.",
        "Every right-hand side is drawn without regard to the lost direction, so the exact answer grows like 1/eps: "
        "a controller that is asked for motions it can make would see less.",
        "Each problem stands alone: nothing is said about jumps between control steps.",
        "Below the rank tolerance (1e-12 of the level's norm) the library's own rule cuts the lost direction and the "
        "exact rule does not; steps where the two differ are marked ambiguous.",
    )
    abscissa: ClassVar[str] = "distance to the algorithmic singularity, eps"
    log_abscissa: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if not isinstance(self.n, int) or self.n < 7:
            raise SettingError(
                f"n is {self.n!r}; it must be an integer of at least 7 (3 + 3 rows and freedom besides)."
            )
        if not 0.0 < self.smallest <= 1.0:
            raise SettingError(f"smallest is {self.smallest!r}; it must be in (0, 1].")
        if not isinstance(self.per_decade, int) or self.per_decade < 1:
            raise SettingError(f"per_decade is {self.per_decade!r}; it must be an integer of at least 1.")

    def distances(self) -> list[float]:
        """The values of eps, falling from 1 to about `smallest`."""
        count = round(-math.log10(self.smallest) * self.per_decade)
        return [10.0 ** (-i / self.per_decade) for i in range(count + 1)]

    def problems(self, seed: int) -> Iterator[tuple[str, float, Problem]]:
        """(case, eps, problem) in the order in which they are solved."""
        return iter(_problems(self.n, tuple(self.distances()), seed))

    def steps(self, solver: Solver, seed: int) -> Iterator[Step]:
        for case, eps, problem in self.problems(seed):
            solver.reset()
            solution, seconds = timed_solve(solver, problem)
            yield Step(case, eps, problem, solution, seconds)

    def length(self) -> int:
        return 2 * len(self.distances())

    def quick(self) -> NearSingularFamily:
        return dataclasses.replace(self, per_decade=1)


@functools.lru_cache(maxsize=8)
def _problems(n: int, distances: tuple[float, ...], seed: int) -> tuple[tuple[str, float, Problem], ...]:
    rng = np.random.default_rng([seed, n])
    A1, C, R = rng.standard_normal((3, n)), rng.standard_normal((3, 3)), rng.standard_normal((3, n))
    posture = rng.standard_normal((n, n))
    b1, b2, b3 = rng.standard_normal(3), rng.standard_normal(3), rng.standard_normal(n)
    found = []
    for case, extra in (("two levels", []), ("three levels", [Level.equality(posture, b3, name="third")])):
        for eps in distances:
            levels = [Level.equality(A1, b1, name="first"), Level.equality(C @ A1 + eps * R, b2, name="second")]
            found.append((case, eps, Problem([*levels, *extra])))
    return tuple(found)
