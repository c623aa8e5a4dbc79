"""Singular configurations of a stack on a robot, found from many starts by Newton steps within the joint limits."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from typing import TypeAlias

import numpy as np

from hqp_rp.control._bounded_step import levenberg_marquardt_step, room
from hqp_rp.control._coordinates import coordinate_index
from hqp_rp.control._sampling import Sampler, random_configurations, within_limits
from hqp_rp.control.stack import Stack
from hqp_rp.core.diagnostics import Singularity, remaining, spectra, two_norm
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.core.solver import RANK_TOLERANCE
from hqp_rp.robot.robot import Robot

_DIFFERENCE = 1e-5  # rad, of central differences: error of order h^2 against rounding of order eps / h
_HALVINGS = 6
_LONGEST_STEP = 0.3  # rad or m, per joint and step
# Its square over sigma: far less would let the rounding of the differences choose among solutions.
_LEAST_DAMPING = 1e-3
_RELAX, _TIGHTEN = 3.0, 4.0
_KEPT = 0.1  # a step is taken where it keeps this share of the fall that it promised
_LEAST_FALL = 1e-3  # share of sigma^2
_ATTEMPTS = 9
_SAMPLES_FOR_RANK = 8

Start: TypeAlias = tuple[int, int]
"""Index of a level, and number of a start."""


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class SingularConfiguration:
    """Where a level loses rank beside the levels before it. A_k (m, nv) are its rows, Z the null space of those before.

    Attributes:
        q: (nq,) the configuration.
        level: index of the level, from 0. name: its name.
        kind: `ALGORITHMIC` when A_k alone keeps full rank (equation (12)), else `KINEMATIC` or `BOTH`.
        sigma: the singular value of A_k Z that vanishes, over ||A_k||_2.
        own_sigma: the smallest singular value of A_k, over ||A_k||_2: distance to a kinematic singularity of this level.
        earlier_sigma: the least such value of the levels before, alone and beside one another; inf for the first level.
        task_direction: (m,) unit vector u: with the levels before it at rest, the level cannot move along u.
        joint_direction: (nv,) unit vector in range(Z): the joint motion that moved the level along u and no longer does.
        curvature: (c,) eigenvalues, in the unit of the rows per rad^2, of the second-order motion along u over the joint
            motions of range(Z) that move nothing to first order; c = d - r + 1 for a level of rank r in d free
            directions. All of one sign: u points to an edge, beyond which the level cannot be brought while those before
            it rest. Both signs: a saddle, which can be passed. u is chosen so that their sum is <= 0. Empty where more
            than one task direction is without motion (a level of more rows than it has freedom).
        approach: (nv,) unit vector: the joint motion along which sigma grows fastest, alike to both sides.
        approach_rate: 1/rad, how fast: sigma = approach_rate |s| at q + s approach, to first order; 0 where it does not.
    """

    q: FloatArray
    level: int
    name: str
    kind: Singularity
    sigma: float
    own_sigma: float
    earlier_sigma: float
    task_direction: FloatArray
    joint_direction: FloatArray
    curvature: FloatArray
    approach: FloatArray
    approach_rate: float

    @property
    def is_edge(self) -> bool:
        """Whether the curvature says that the level can be brought no further along `task_direction`."""
        return bool(self.curvature.size) and bool((self.curvature < 0.0).all())


def search_singularities(
    robot: Robot,
    stack: Stack,
    *,
    level: int | None = None,
    kinds: Collection[Singularity] = (Singularity.ALGORITHMIC,),
    starts: int = 64,
    seed: int = 0,
    tolerance: float = 1e-13,
    clearance: float = 0.02,
    separation: float = 0.05,
    thorough: bool = False,
    dt: float | None = None,
    refined: Callable[[Sequence[Start]], Iterable[SingularConfiguration | None]] | None = None,
) -> list[SingularConfiguration]:
    """Singular configurations of `stack` within the joint limits of `robot`, in the order in which they are found.

    Every start is drawn uniformly within the limits (within pi of neutral where there is none) and refined by
    `refine_singularity`. Singular configurations come in families, of codimension d - r + 1 where a level of rank r has d
    free directions: what is returned are points of them, `separation` apart, and no proof that there are no others. The
    start number s depends on (seed, s) only.

    Args:
        robot: any `Robot`; it is moved about, and put back where it was.
        stack: equality tasks only. level: index of one level, from 0; None searches every level.
        kinds: what to return.
        starts: starts per level, >= 1. seed: >= 0.
        tolerance: sigma / ||A_k|| below which a level counts as singular, > 0.
        clearance: least `earlier_sigma`, and for algorithmic singularities least `own_sigma`, of what is returned.
        separation: rad or m, least distance between two that are returned, in the largest difference of a joint.
        thorough: where Newton's steps fail, go on with damped steps within the limits; see `refine_singularity`.
        dt: s, for stacks that need it.
        refined: what refines the starts, each (level, number), in this order, such as `refine_starts` over processes.

    Raises:
        SettingError: a level that the stack does not have, a setting out of its range, or a stack with limits, whose
            rows bind only where they are reached.
    """
    check(isinstance(starts, int) and starts >= 1, "starts", starts, "an integer of at least 1")
    check(isinstance(seed, int) and seed >= 0, "seed", seed, "an integer of at least 0")
    for name, value in (("clearance", clearance), ("separation", separation)):
        check(isinstance(value, int | float) and value >= 0.0, name, value, "a number >= 0")
    kinds = tuple(kinds)
    proper = all(isinstance(kind, Singularity) and kind is not Singularity.NONE for kind in kinds)
    check(bool(kinds) and proper, "kinds", kinds, "Singularity members other than NONE, at least one")
    if level is not None:
        check_level(stack, level)
    before = robot.q
    found: list[SingularConfiguration] = []
    jobs: list[Start] = []
    try:
        for k in range(len(stack.names)) if level is None else (level,):
            if k == 0 and not {Singularity.KINEMATIC, Singularity.BOTH} & set(kinds):
                continue  # nothing comes before the first level
            jobs += [(k, s) for s in range(starts)]
        if refined is None:
            refined = functools.partial(
                refine_starts, robot, stack, seed=seed, tolerance=tolerance, thorough=thorough, dt=dt
            )
        for (k, _), candidate in zip(jobs, refined(jobs), strict=True):
            if (
                candidate is None
                or candidate.kind not in kinds
                or candidate.earlier_sigma < clearance
                or (candidate.kind is Singularity.ALGORITHMIC and candidate.own_sigma < clearance)
            ):
                continue
            if all(other.level != k or _apart(robot, other.q, candidate.q) >= separation for other in found):
                found.append(candidate)
    finally:
        robot.update(before)
    return found


def refine_starts(
    robot: Robot,
    stack: Stack,
    jobs: Iterable[Start],
    *,
    seed: int,
    tolerance: float = 1e-13,
    thorough: bool = False,
    dt: float | None = None,
) -> Iterator[SingularConfiguration | None]:
    """What `refine_singularity` makes of each start (level, number), one after the other; the robot is moved about."""
    sampler = Sampler(robot)
    for k, s in jobs:
        start = sampler.uniform(np.random.default_rng((seed, s)))
        yield refine_singularity(robot, stack, start, k, tolerance=tolerance, thorough=thorough, dt=dt)


def refine_singularity(
    robot: Robot,
    stack: Stack,
    q: FloatArray,
    level: int,
    *,
    tolerance: float = 1e-13,
    iterations: int = 40,
    thorough: bool = False,
    dt: float | None = None,
) -> SingularConfiguration | None:
    """The singular configuration that damped steps reach from q (nq,), or None; within the joint limits.

    Let r be the rank that A_k has beside the earlier rows A_e at most configurations, U and V what the singular vectors
    of A_k Z from the r-th on span. Moving joint i changes U^T A_k Z V, to first order, by

        [-U^T A_k A_e^+, U^T] (d[A_e; A_k]/dq_i) Z V

    (Z turns with A_e: dZ = -A_e^+ dA_e Z up to a rotation within Z). First by the least step that makes the r-th singular
    value vanish, cut to 0.3 rad (m) per joint and to the limits and halved until that value falls. Where that ends nowhere
    and the search is `thorough`, from q again by the least-squares step over the motions within the limits and 0.3 rad (m)
    per joint, damped by mu sigma, mu raised where a step keeps too little of the fall that it promised: Newton's in the
    end. Limits are part of these steps because many singular configurations lie on them: a knee or an elbow that cannot be
    bent backwards is straight at its limit. q need not be near: from far off it is a search that may fail. iterations: most
    steps, >= 0; the other arguments and the errors as `search_singularities`. The robot is left at the last configuration
    tried.

    Source: the derivative of singular subspaces, Stewart and Sun, Matrix Perturbation Theory, 1990, chapter V; the steps,
    Kanzow, Yamashita and Fukushima 2004, Levenberg-Marquardt methods for equations with convex constraints.
    """
    check_level(stack, level)
    check(isinstance(tolerance, float) and 0.0 < tolerance < 1.0, "tolerance", tolerance, "a number in (0, 1)")
    check(isinstance(iterations, int) and iterations >= 0, "iterations", iterations, "an integer of at least 0")
    walk = Walk(robot, stack, level, dt)
    if walk.rank == 0:
        return None  # no freedom is left to this level anywhere: it has nothing to lose
    first = walk.within_limits(np.array(q, dtype=np.float64))
    for search in (_newton, _levenberg_marquardt) if thorough else (_newton,):
        q, here = search(robot, walk, first, tolerance, iterations)
        if here is not None and here.sigma <= tolerance:
            return walk.judge(q, here, tolerance)
    return None


def _newton(
    robot: Robot, walk: Walk, q: FloatArray, tolerance: float, iterations: int
) -> tuple[FloatArray, _Split | None]:
    """Least steps, cut to the limits afterwards and halved until the singular value falls: quick, where it succeeds."""
    here = walk.split(q)
    for _ in range(iterations):
        if here is None or here.sigma <= tolerance:
            break
        change = walk.derivative(q, here)
        wanted = np.zeros(change.shape[0])
        wanted[0] = -here.sigma
        step = np.asarray(np.linalg.lstsq(change, wanted, rcond=1e-9)[0], dtype=np.float64)
        longest = float(np.abs(step).max())
        if longest > _LONGEST_STEP:
            step *= _LONGEST_STEP / longest
        for halving in range(_HALVINGS):
            moved = walk.within_limits(robot.integrate(q, step, 0.5**halving))
            there = walk.split(moved)
            if there is not None and there.sigma < (1.0 - 0.1 * 0.5**halving) * here.sigma:
                q, here = moved, there
                break
        else:
            break
    return q, here


def _levenberg_marquardt(
    robot: Robot, walk: Walk, q: FloatArray, tolerance: float, iterations: int
) -> tuple[FloatArray, _Split | None]:
    """Damped steps within the limits: also where a singular configuration lies on them."""
    here = walk.split(q)
    damping = _LEAST_DAMPING
    for _ in range(iterations):
        if here is None or here.sigma <= tolerance:
            break
        change = walk.derivative(q, here)
        residual = np.zeros(len(change))
        residual[0] = here.sigma
        lower, upper = walk.room(q, _LONGEST_STEP)
        for _ in range(_ATTEMPTS):
            step = levenberg_marquardt_step(change, residual, math.sqrt(damping * here.sigma), lower, upper)
            promised = here.sigma**2 - float(np.square(change @ step + residual).sum())
            if promised < _LEAST_FALL * here.sigma**2:
                return q, here  # the singular value is least here, among its neighbours within the limits
            moved = walk.within_limits(robot.integrate(q, step, 1.0))
            there = walk.split(moved)
            if there is not None and there.sigma**2 < here.sigma**2 - _KEPT * promised:
                q, here = moved, there
                damping = max(damping / _RELAX, _LEAST_DAMPING)
                break
            damping *= _TIGHTEN
        else:
            break
    return q, here


@dataclasses.dataclass(frozen=True, slots=True)
class _Split:
    """The level at one configuration, by its r-th singular value beside the earlier rows.

    sigma: over ||A_k||. norm: ||A_k||. left: (m, m - r + 1), right: (nv, d - r + 1), the singular vectors from the r-th
    on. rows: (M, nv), the earlier levels and this one; own: (m, nv), this one.
    """

    sigma: float
    norm: float
    left: FloatArray
    right: FloatArray
    rows: FloatArray
    own: FloatArray


class Walk:
    """One level of a stack on a robot that moves from configuration to configuration."""

    def __init__(self, robot: Robot, stack: Stack, level: int, dt: float | None) -> None:
        self._robot, self._stack, self._level, self._dt = robot, stack, level, dt
        self._index = coordinate_index(robot, "the search for singularities")
        self.rank = max(self._rank_at(q) for q in random_configurations(robot, _SAMPLES_FOR_RANK, 0))

    def _rank_at(self, q: FloatArray) -> int:
        self._robot.update(q)
        problem = self._stack.problem(self._robot, self._dt)
        if not problem.is_equality:
            raise SettingError(
                f"{self._stack!r} holds limits, whose rows bind only where they are reached; give the tasks alone."
            )
        return spectra(problem)[self._level].rank

    def within_limits(self, q: FloatArray) -> FloatArray:
        return within_limits(self._robot, q, self._index)

    def room(self, q: FloatArray, longest: float) -> tuple[FloatArray, FloatArray]:
        """Least and largest motion (nv,) of each joint within the limits, from q (nq,) within them."""
        return room(self._robot, q, self._index, longest)

    def _rows(self, q: FloatArray) -> tuple[FloatArray, IntArray]:
        self._robot.update(q)
        problem = self._stack.problem(self._robot, self._dt)
        offsets = problem.offsets[: self._level + 2]
        return problem.matrix[: offsets[-1]], offsets

    def split(self, q: FloatArray) -> _Split | None:
        """None where fewer rows, or fewer free directions, are left than a level of this rank needs."""
        rows, offsets = self._rows(q)
        Z: FloatArray | None = None
        for first, last in itertools.pairwise(offsets[:-1].tolist()):
            Z = remaining(rows[first:last], Z, RANK_TOLERANCE)[1]
        own = rows[offsets[-2] :]
        norm = two_norm(own)
        if Z is None:
            Z = np.eye(rows.shape[1])
        if min(len(own), Z.shape[1]) < self.rank:
            return None
        if norm == 0.0:
            return _Split(0.0, norm, np.eye(len(own)), Z, rows, own)
        left, sigma, right = np.linalg.svd(own @ Z)
        r = self.rank - 1
        return _Split(float(sigma[r]) / norm, norm, left[:, r:], Z @ right[r:].T, rows, own)

    def derivative(self, q: FloatArray, at: _Split) -> FloatArray:
        """(c, nv) change of U^T A_k Z V / ||A_k||, row by row, per velocity; its first entry is the singular value's."""
        earlier = at.rows[: len(at.rows) - len(at.own)]
        weights = at.left.T
        if len(earlier):
            on_earlier = np.linalg.lstsq(earlier.T, at.own.T @ at.left, rcond=RANK_TOLERANCE)[0].T
            weights = np.hstack([-on_earlier, weights])
        columns = []
        for axis in np.eye(self._robot.nv):
            ahead = self._rows(self._robot.integrate(q, axis, _DIFFERENCE))[0]
            behind = self._rows(self._robot.integrate(q, axis, -_DIFFERENCE))[0]
            columns.append((weights @ (ahead - behind) @ at.right).ravel() / (2.0 * _DIFFERENCE * at.norm))
        return np.stack(columns, axis=1)

    def judge(self, q: FloatArray, at: _Split, tolerance: float) -> SingularConfiguration:
        sign = 1.0
        curvature: FloatArray = np.empty(0)
        change = self.derivative(q, at) if at.norm > 0.0 else np.zeros((1, self._robot.nv))
        _, growth, directions = np.linalg.svd(change)
        if at.left.shape[1] == 1 and at.norm > 0.0:
            # Along the joint motion v that moves nothing, the level moves by v^T H v / 2 along u.
            H = at.norm * change @ at.right
            curvature = np.asarray(np.linalg.eigvalsh(0.5 * (H + H.T)), dtype=np.float64)
            if curvature.sum() > 0.0:
                curvature, sign = -curvature[::-1], -1.0
        self._robot.update(q)
        problem = self._stack.problem(self._robot, self._dt)
        judged = spectra(problem, max(RANK_TOLERANCE, 10.0 * tolerance))
        own_sigma, earlier_sigma = 0.0, math.inf
        for k, A in enumerate(level.A for level in problem.levels[: self._level + 1]):
            norm = two_norm(A)
            alone = float(np.linalg.svd(A, compute_uv=False)[-1]) / norm if norm else 0.0
            if k == self._level:
                own_sigma = alone
            else:
                earlier_sigma = min(earlier_sigma, alone, judged[k].sigma_min / norm if norm else 0.0)
        return SingularConfiguration(
            q=q,
            level=self._level,
            name=problem.names[self._level],
            kind=judged[self._level].singularity,
            sigma=at.sigma,
            own_sigma=own_sigma,
            earlier_sigma=earlier_sigma,
            task_direction=sign * at.left[:, 0],
            joint_direction=at.right[:, 0],
            curvature=curvature,
            approach=directions[0],
            approach_rate=float(growth[0]),
        )


def _apart(robot: Robot, first: FloatArray, second: FloatArray) -> float:
    return float(np.abs(robot.difference(first, second)).max())


def check_level(stack: Stack, level: int) -> None:
    last = len(stack.names) - 1
    check(isinstance(level, int) and 0 <= level <= last, "level", level, f"an index of the stack's levels, 0 to {last}")


def check(allowed: bool, name: str, value: object, sign: str) -> None:
    if not allowed:
        raise SettingError(f"{name} is {value!r}; it must be {sign}.")
