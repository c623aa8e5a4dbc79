"""Which configurations a stress test looks at: at random, near the joint limits, and towards each singularity found."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import itertools
import warnings
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from hqp_rp.compare.contestants import Contestant
from hqp_rp.compare.stress.subject import Subject
from hqp_rp.control._sampling import Sampler
from hqp_rp.control.catalogue import ApproachPath, approach_path, tasks_only
from hqp_rp.control.joint_limit import JointLimit
from hqp_rp.control.limit import Limit
from hqp_rp.control.singularities import SingularConfiguration
from hqp_rp.control.stack import Stack
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray, Problem
from hqp_rp.robot.robot import Robot

RANDOM, LIMITS, APPROACH = "random", "limits", "approach"
KINDS = (RANDOM, LIMITS, APPROACH)
"""What a sample is: anywhere, near the joint limits, on the way to a singularity."""

FAR, NEAR, PER_DECADE = 1e-1, 1e-12, 4
STEPS = 11 * PER_DECADE + 1
"""A path has this many samples: sigma from `FAR` to `NEAR`, `PER_DECADE` a decade."""

LITTLE = 0.1
"""Of a joint's own speed limit, or of 1 rad/s or m/s where that is less: what a robot must be allowed to reach from rest."""

_CHUNK = 1024
_ATTEMPTS = 6
_ASIDE = 0.5


@dataclasses.dataclass(frozen=True, slots=True)
class Chunk:
    """Samples of one kind, one after the other: what one worker does at a time.

    first: number of the first sample in the whole run; start: its number among those of its kind (for `APPROACH`, of the
    first path); count: samples.
    """

    index: int
    kind: str
    first: int
    start: int
    count: int


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """The configurations of one chunk and their problems.

    Attributes:
        kind: one of `KINDS`. number: (C,) number of each sample in the run.
        q: (C, nq). problems: one for each. tasks: the same without limits.
        place, path, step: (C,) index into the atlas, number of the path, place along it; -1 where there is none.
        sigma: (C,) on a path, the vanishing singular value over ||A_k||_2; nan elsewhere.
    """

    kind: str
    number: Any
    q: FloatArray
    problems: tuple[Problem, ...]
    tasks: tuple[Problem, ...]
    place: Any
    path: Any
    step: Any
    sigma: FloatArray


@dataclasses.dataclass(frozen=True, eq=False)
class Plan:
    """A whole stress test: a worker that has it and a chunk's index makes that chunk's rows, and nothing else decides them.

    Attributes:
        subject: the robot and its stack.
        contestants: who solves. samples: how many in all. seed: of every draw.
        places: the atlas: singular configurations that can be approached.
    """

    subject: Subject
    contestants: tuple[Contestant, ...]
    samples: int
    seed: int
    places: tuple[SingularConfiguration, ...]
    limited: bool = True

    @property
    def paths(self) -> int:
        """How many paths: as many as a third of the samples makes, one at least where there is room for one."""
        if not self.places or self.samples < STEPS:
            return 0
        return max(1, round(self.samples / 3 / STEPS))

    @property
    def counts(self) -> dict[str, int]:
        """Samples of each kind."""
        others = self.samples - self.paths * STEPS
        limits = others // 2 if self.limited else 0
        return {RANDOM: others - limits, LIMITS: limits, APPROACH: self.paths * STEPS}

    @functools.cached_property
    def chunks(self) -> tuple[Chunk, ...]:
        """The chunks, in the order of their samples."""
        size = min(max(self.samples // 64, 2 * STEPS), _CHUNK)
        found: list[Chunk] = []
        first = 0
        for kind, count in self.counts.items():
            unit = STEPS if kind == APPROACH else 1
            step = size // unit * unit
            for start in range(0, count, step):
                own = min(step, count - start)
                found.append(Chunk(len(found), kind, first, start // unit, own))
                first += own
        return tuple(found)

    @functools.cached_property
    def order(self) -> tuple[int, ...]:
        """Indices of the places in the order in which paths take them: each level and kind in turn."""
        groups: dict[tuple[int, str], list[int]] = {}
        for i, place in enumerate(self.places):
            groups.setdefault((place.level, place.kind.name), []).append(i)
        turns = itertools.zip_longest(*groups.values())
        return tuple(i for turn in turns for i in turn if i is not None)

    @property
    def model(self) -> str:
        """What reports call the robot."""
        return self.subject.model

    @property
    def stack(self) -> Subject:
        """What reports say of the stack: its `origin` and its `text`."""
        return self.subject

    def scene(self) -> Scene:
        """The robot and its stack, built once in each process."""
        with quiet():
            return scene_of(self.subject)

    def samples_of(self, chunk: Chunk) -> Samples:
        """The samples of a chunk; they depend on the plan and the chunk's index only."""
        with quiet():
            return self._samples_of(chunk)

    def _samples_of(self, chunk: Chunk) -> Samples:
        scene = self.scene()
        none = np.full(chunk.count, -1)
        if chunk.kind == APPROACH:
            paths = list(self._paths(scene, chunk))
            numbers = np.repeat(np.arange(chunk.start, chunk.start + len(paths)), STEPS)
            q = np.concatenate([path.q for path in paths])
            place = np.array([self.order[number % len(self.order)] for number in numbers])
            step = np.tile(np.arange(STEPS), len(paths))
            return scene.samples(chunk, q, place, numbers, step, np.concatenate([path.sigma for path in paths]))
        sampler = Sampler(scene.robot)
        draw = sampler.uniform if chunk.kind == RANDOM else sampler.near_limits
        kind = KINDS.index(chunk.kind)
        drawn = [draw(np.random.default_rng((self.seed, kind, chunk.start + i))) for i in range(chunk.count)]
        return scene.samples(chunk, np.array(drawn), none, none, none, np.full(chunk.count, np.nan))

    def _paths(self, scene: Scene, chunk: Chunk) -> Iterator[ApproachPath]:
        for number in range(chunk.start, chunk.start + chunk.count // STEPS):
            place = self.places[self.order[number % len(self.order)]]
            rng = np.random.default_rng((self.seed, KINDS.index(APPROACH), number))
            yield scene.path(place, number // len(self.order), rng)


class Scene:
    """A robot, its stack, and the stack's tasks alone. plain: the stack has no limits."""

    def __init__(self, robot: Robot, stack: Stack, dt: float | None) -> None:
        self.robot, self.stack, self.dt = robot, stack, dt
        self.tasks, self._index = tasks_only(stack)
        self.plain = not stack.limits and not any(isinstance(item, Limit) for items in stack.levels for item in items)
        self._rest = np.zeros(robot.nv)

    def held_at_rest(self) -> str:
        """A sentence where limits on accelerations or jerks leave a robot at rest next to no speed in one dt; "" where not."""
        items = [*self.stack.limits, *itertools.chain(*self.stack.levels)]
        for limit in items:
            if not isinstance(limit, JointLimit) or self.dt is None:
                continue
            speed = limit.speed_from_rest(self.robot, self.dt)
            held = speed < LITTLE * np.minimum(self.robot.velocity_limit, 1.0)
            if held.any():
                return (
                    f"Every sample is at rest, and {limit.name!r} lets joints come to {float(speed[held].max()):g} rad/s or "
                    f"m/s at most within dt = {self.dt:g} s: most answers are at these bounds, and say little of the solvers. "
                    "Give a greater dt, or leave acceleration and jerk out of the stack for this test."
                )
        return ""

    def problem(self, q: FloatArray) -> Problem:
        """The problem at q (nq,), for a robot that was at rest."""
        self.robot.update(q)
        return self.stack.problem(self.robot, self.dt, self._rest, self._rest)

    def _equalities(self, stack: Stack, q: FloatArray) -> list[Problem]:
        """The problems of a stack without limits at q (C, nq), their rows made in one call."""
        A, b, _, offsets = stack.batch(self.robot, q, self.dt, self._rest, threads=1)
        names = stack.names
        return [
            Problem.from_stacked(own, rate, rate, offsets, names=names, check=False)
            for own, rate in zip(A, b, strict=True)
        ]

    def samples(self, chunk: Chunk, q: FloatArray, place: Any, path: Any, step: Any, sigma: FloatArray) -> Samples:
        """The samples at the configurations q (C, nq)."""
        tasks = self._equalities(self.tasks, q)
        problems = tasks if self.plain else [self.problem(configuration) for configuration in q]
        number = chunk.first + np.arange(chunk.count)
        return Samples(chunk.kind, number, q, tuple(problems), tuple(tasks), place, path, step, sigma)

    def path(self, place: SingularConfiguration, variant: int, rng: np.random.Generator) -> ApproachPath:
        """A path of `STEPS` samples: variant 0 along the steepest direction, 1 against it, the others drawn around both.

        Where `FAR` is out of reach along the line, the path begins at the largest sigma that is not.
        """
        inner = dataclasses.replace(place, level=self._index.index(place.level))
        for attempt in range(_ATTEMPTS):
            sign = 1.0 if variant % 2 == 0 else -1.0
            direction = sign * place.approach
            if variant >= 2 and attempt < _ATTEMPTS - 1:
                aside = rng.standard_normal(self.robot.nv)
                direction = direction + _ASIDE * aside / np.linalg.norm(aside)
            found = self._path(inner, direction)
            if found is not None:
                return found
        raise SettingError(f"the singularity of {place.name!r} at {place.q.tolist()} cannot be approached.")

    def approachable(self, place: SingularConfiguration) -> bool:
        """Whether a path leads to `place` at every sigma that a stress test asks for."""
        inner = dataclasses.replace(place, level=self._index.index(place.level))
        return all(self._path(inner, sign * place.approach) is not None for sign in (1.0, -1.0))

    def _path(self, place: SingularConfiguration, direction: FloatArray) -> ApproachPath | None:
        top = FAR
        for _ in range(_ATTEMPTS):
            wanted = np.geomspace(top, NEAR, STEPS)
            try:
                path = approach_path(self.robot, self.tasks, place, wanted, direction=direction, dt=self.dt)
            except SettingError:
                return None
            if len(path) == STEPS:
                return path
            if not len(path) or path.sigma[0] < 1e3 * NEAR:
                return None
            top = min(0.9 * top, float(path.sigma[0]))
        return None


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Nothing is said again: what a model and its stack warn of was said where the test was started."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        yield


@functools.lru_cache(maxsize=2)
def scene_of(subject: Subject) -> Scene:
    """The robot and its stack, built once in each process. Errors and warnings as `Subject.build`."""
    return Scene(*subject.build(), subject.dt)


def approachable(scene: Scene, places: Sequence[SingularConfiguration]) -> tuple[SingularConfiguration, ...]:
    """Those of `places` that a path leads to."""
    return tuple(place for place in places if scene.approachable(place))
