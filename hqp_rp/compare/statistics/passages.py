"""Paths through algorithmic singularities: which configurations, which lines through them, which velocities are asked for."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Iterator

import numpy as np

from hqp_rp.compare.statistics.arms import arm_named, scene_of
from hqp_rp.control.singularities import SingularConfiguration, search_singularities
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray, IntArray

LEVEL = 1
"""Index of the level whose singularities are crossed: the second."""
NEAREST, FARTHEST = 1e-5, 10**-1.5
"""rad: by how much a path passes a singular configuration by, drawn with an even logarithm."""
_ASIDE = 0.5
_ROUNDS = 4


@dataclasses.dataclass(frozen=True, kw_only=True)
class Design:
    """How many passages, and what they are like.

    Args:
        configurations: singular ones, for each arm. paths: through each. samples: of a path, odd.
        reach: rad, half the length of a path. speed: ||b_k||, m/s or rad/s, of each of the first two levels;
            posture_speed: rad/s, of the third. seed: of every draw.
    """

    configurations: int = 20
    paths: int = 20
    samples: int = 81
    reach: float = 0.4
    speed: float = 0.1
    posture_speed: float = 0.1
    seed: int = 0

    def __post_init__(self) -> None:
        for name, least in (("configurations", 1), ("paths", 1), ("samples", 3), ("seed", 0)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < least:
                raise SettingError(f"{name} is {value!r}; it must be an integer of at least {least}.")
        if not self.samples % 2:
            raise SettingError(f"samples is {self.samples}; it must be odd, so that one lies in the middle of a path.")
        for name in ("reach", "speed", "posture_speed"):
            value = getattr(self, name)
            number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
            if not number or value <= 0.0:
                raise SettingError(f"{name} is {value!r}; it must be a finite number > 0.")


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Passage:
    """One path as problems: A (N, M, n), b (N, M), offsets (p + 1,), and of each sample its distance from the singularity.

    sigma: (N,) smallest singular value of A_2 Z_1 over ||A_2||_2. q: (N, n) rad.
    """

    q: FloatArray
    A: FloatArray
    b: FloatArray
    offsets: IntArray
    sigma: FloatArray


@functools.lru_cache(maxsize=16)
def places(arm: str, count: int, seed: int) -> tuple[SingularConfiguration, ...]:
    """`count` algorithmic singularities of the arm's second level; `SettingError` when a long search finds fewer."""
    robot, stack = scene_of(arm)
    starts, found = 4 * count, []
    for _ in range(_ROUNDS):
        found = [
            place
            for place in search_singularities(robot, stack, level=LEVEL, starts=starts, seed=seed)
            if place.approach_rate > 0.0
        ]
        if len(found) >= count:
            return tuple(found[:count])
        starts *= 2
    raise SettingError(
        f"configurations is {count}, but only {len(found)} singular configurations of {arm_named(arm).title} were found; ask "
        f"for {len(found)} at most."
    )


def passages(design: Design, arm: str, place: SingularConfiguration, index: int) -> Iterator[Passage]:
    """The paths past one singular configuration, the `index`-th of its arm: straight lines in joint space,

        q(s) = q_c + o + s d,  s = -reach ... reach,    ||o|| between `NEAREST` and `FARTHEST`,  ||d|| = 1

    d drawn around the direction of steepest approach. Along a path every level asks for one and the same velocity, of a
    direction that is drawn: so what it asks for has, in general, a share along the direction that is lost.
    """
    robot, stack = scene_of(arm)
    s = np.linspace(-design.reach, design.reach, design.samples)
    for path in range(design.paths):
        rng = np.random.default_rng((design.seed, *arm.encode(), index, path))
        aside = rng.standard_normal(robot.nv)
        d = place.approach + _ASIDE * aside / np.linalg.norm(aside)
        o = rng.standard_normal(robot.nv)
        o *= math.exp(rng.uniform(math.log(NEAREST), math.log(FARTHEST))) / np.linalg.norm(o)
        q = place.q + o + s[:, None] * d / np.linalg.norm(d)
        A, _, _, offsets = stack.batch(robot, q, threads=1)
        b = np.empty(A.shape[1])
        for k in range(len(offsets) - 1):
            own = rng.standard_normal(offsets[k + 1] - offsets[k])
            speed = design.speed if k <= LEVEL else design.posture_speed
            b[offsets[k] : offsets[k + 1]] = speed * own / np.linalg.norm(own)
        yield Passage(q, A, np.tile(b, (len(A), 1)), offsets, distance(A, offsets))


def distance(A: FloatArray, offsets: IntArray) -> FloatArray:
    """(N,) smallest singular value of A_2 Z_1 over ||A_2||_2, with Z_1 an orthonormal basis of the null space of A_1."""
    first, second = (A[:, offsets[k] : offsets[k + 1]] for k in (0, 1))
    Z = np.swapaxes(np.linalg.svd(first)[2][:, first.shape[1] :], 1, 2)
    left: FloatArray = np.linalg.svd(second @ Z, compute_uv=False).min(axis=1)
    size: FloatArray = np.linalg.svd(second, compute_uv=False).max(axis=1)
    return left / size
