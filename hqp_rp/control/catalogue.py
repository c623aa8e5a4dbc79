"""The atlas of a robot's own singularities: where the levels of its stack lose rank, and paths that lead there."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, overload

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import finite_vector
from hqp_rp.control._displacement import is_limit
from hqp_rp.control.limit import Limit
from hqp_rp.control.singularities import SingularConfiguration, Start, Walk, check, search_singularities
from hqp_rp.control.stack import Stack
from hqp_rp.core.diagnostics import Singularity
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KINDS = (Singularity.ALGORITHMIC, Singularity.KINEMATIC, Singularity.BOTH)

_STEPS = 12
_PROBE = 1e-6  # rad, where the rate along a direction is measured
_FARTHEST = 3.0  # rad


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ApproachPath:
    """Configurations that approach a singular one along a straight line in joint space.

    Attributes:
        q: (S, nq), from the farthest to the nearest.
        sigma: (S,) the vanishing singular value over ||A_k||_2, measured at each q.
        reach: (S,) rad or m, signed length of the line from the singular configuration: q = q* + reach * direction.
        direction: (nv,) unit vector of the line.
    """

    q: FloatArray
    sigma: FloatArray
    reach: FloatArray
    direction: FloatArray

    def __len__(self) -> int:
        return len(self.q)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Catalogue(Sequence[SingularConfiguration]):
    """Singular configurations of a stack on a robot, each apart from the others; a sequence of `SingularConfiguration`.

    Attributes:
        robot: the robot. stack: its tasks, limits left out.
        places: what was found, ordered by level, then kind, then as found. A place's `level` counts the levels of the
            stack that was searched, those that held limits only included.
    """

    robot: Robot
    stack: Stack
    places: tuple[SingularConfiguration, ...]
    _index: tuple[int, ...] = ()
    _dt: float | None = None

    def __len__(self) -> int:
        return len(self.places)

    @overload
    def __getitem__(self, index: int) -> SingularConfiguration: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[SingularConfiguration, ...]: ...
    def __getitem__(self, index: int | slice) -> SingularConfiguration | tuple[SingularConfiguration, ...]:
        return self.places[index]

    def __iter__(self) -> Iterator[SingularConfiguration]:
        return iter(self.places)

    def of(self, level: int | None = None, kind: Singularity | None = None) -> tuple[SingularConfiguration, ...]:
        """Those of one level (from 0), of one kind, or both."""
        return tuple(
            place
            for place in self.places
            if (level is None or place.level == level) and (kind is None or place.kind is kind)
        )

    def approach(
        self, place: SingularConfiguration, sigmas: ArrayLike, *, direction: ArrayLike | None = None
    ) -> ApproachPath:
        """A path that approaches `place` at these sigma. See `approach_path`."""
        inner = dataclasses.replace(place, level=self._index.index(place.level))
        return approach_path(self.robot, self.stack, inner, sigmas, direction=direction, dt=self._dt)

    def plot(self) -> Figure:
        """A matplotlib figure: for each level and kind a line for each place, over the joints, between their limits.

        What lines have in common is what makes them singular; what differs is the family. Raises `MissingExtraError` without
        matplotlib.
        """
        from hqp_rp.control._atlas_figure import atlas_figure

        return atlas_figure(self)

    def __repr__(self) -> str:
        counts: dict[tuple[str, str], int] = {}
        for place in self.places:
            key = (place.name, place.kind.name.lower())
            counts[key] = counts.get(key, 0) + 1
        found = ", ".join(f"{name}: {count} {kind}" for (name, kind), count in counts.items())
        return f"Catalogue({found or 'empty'})"


def find_singularities(
    robot: Robot,
    stack: Stack,
    *,
    level: int | None = None,
    kinds: Collection[Singularity] = KINDS,
    starts: int = 64,
    seed: int = 0,
    tolerance: float = 1e-13,
    clearance: float = 0.02,
    separation: float = 0.05,
    dt: float | None = None,
    refined: Callable[[Sequence[Start]], Iterable[SingularConfiguration | None]] | None = None,
) -> Catalogue:
    """Search for the configurations where levels of `stack` lose rank, within the joint limits of `robot`.

    Many starts, each refined by steps within the joint limits to where a singular value vanishes (`refine_singularity`):
    many singular configurations lie on a limit, such as a straight knee. A level's loss is `ALGORITHMIC` where its own
    Jacobian keeps full rank, `KINEMATIC` where that loses rank as well, `BOTH` where it loses more beside the levels before
    it than alone. Singular configurations come in families: the catalogue holds points
    of them, `separation` apart, and is no proof that there are no others. ::

        catalogue = hqp_rp.find_singularities(robot, stack)
        for place in catalogue.of(kind=Singularity.ALGORITHMIC):
            print(place.name, place.q, place.joint_direction, place.task_direction)
            path = catalogue.approach(place, [1e-1, 1e-4, 1e-8])

    Args:
        robot: any `Robot`; it is moved about, and put back where it was.
        stack: tasks in levels. Limits are left out: their rows bind only where they are reached.
        level: index of one level, from 0; None searches every level. kinds: what to return.
        starts, seed, tolerance, clearance, separation: as in `search_singularities`.
        dt: s, for stacks that need it (tasks of mink and pink).
        refined: what refines the starts, as in `search_singularities`; of `tasks_only(stack)`, thoroughly.

    Raises:
        SettingError: a level that the stack does not have, a setting out of its range, or a stack without tasks.
        RobotError: a frame or joint that the robot does not have.

    Source: the definition by equation (12) of the paper; the search is ours.
    """
    tasks, index = tasks_only(stack)
    if level is not None:
        last = len(stack.names) - 1
        check(
            isinstance(level, int) and 0 <= level <= last,
            "level",
            level,
            f"an index of the stack's levels, 0 to {last}",
        )
        if level not in index:
            raise SettingError(f"level {level} ({stack.names[level]!r}) holds limits only; give a level with a task.")
    found = search_singularities(
        robot,
        tasks,
        level=None if level is None else index.index(level),
        kinds=kinds,
        starts=starts,
        seed=seed,
        tolerance=tolerance,
        clearance=clearance,
        separation=separation,
        thorough=True,
        dt=dt,
        refined=refined,
    )
    found = [dataclasses.replace(place, level=index[place.level]) for place in found]
    order = {kind: i for i, kind in enumerate(KINDS)}
    places = sorted(found, key=lambda place: (place.level, order[place.kind]))
    return Catalogue(robot, tasks, tuple(places), tuple(index), dt)


def approach_path(
    robot: Robot,
    stack: Stack,
    place: SingularConfiguration,
    sigmas: ArrayLike,
    *,
    direction: ArrayLike | None = None,
    accuracy: float = 0.01,
    dt: float | None = None,
) -> ApproachPath:
    """Configurations on the straight line from `place` along `direction` where sigma has these values.

    The line starts out along +direction, or along -direction where the joint limits leave more room there; joints at a
    limit that they would leave stay where they are. From the smallest
    sigma on, each next point is found by the secant rule s <- s sigma_wanted / sigma(s), which is exact where sigma grows
    linearly. Where the line leaves the joint limits, or sigma grows no further along it, the path begins there: larger
    sigma are left out.

    Args:
        robot: any `Robot`; it is put back where it was.
        stack: the tasks that `place` was found with.
        sigmas: (S,) wanted values of the vanishing singular value over ||A_k||_2, in (0, 1).
        direction: (nv,) any length; default `place.approach`, along which sigma grows fastest.
        accuracy: relative, of the sigma reached, > 0.
        dt: s, for stacks that need it.

    Raises:
        SettingError: a sigma outside (0, 1), a direction of the wrong size or zero, or one along which sigma does not grow.
    """
    wanted = np.sort(np.atleast_1d(np.asarray(sigmas, dtype=np.float64)))
    if wanted.ndim != 1 or not wanted.size or not ((wanted > 0.0) & (wanted < 1.0)).all():
        raise SettingError(f"sigmas is {np.asarray(sigmas).tolist()}; give at least one number, each in (0, 1).")
    check(isinstance(accuracy, float) and accuracy > 0.0, "accuracy", accuracy, "a number > 0")
    along = finite_vector(place.approach if direction is None else direction, robot.nv, "direction", "any unit")
    length = float(np.linalg.norm(along))
    if length == 0.0:
        raise SettingError("direction is zero; it must point somewhere.")
    before = robot.q
    try:
        line = _Line(Walk(robot, stack, place.level, dt), robot, place.q, along / length)
        return line.path(wanted, accuracy)
    finally:
        robot.update(before)


class _Line:
    """sigma along one straight line in joint space, in the sense in which the limits leave room."""

    def __init__(self, walk: Walk, robot: Robot, q: FloatArray, direction: FloatArray) -> None:
        self._walk, self._robot, self._q = walk, robot, q
        # Joints that stand at a limit do not move beyond it.
        ways = [self._freed(direction), -self._freed(-direction)]
        self._direction, self._sign = ways[0], 1.0
        lost = [float(np.linalg.norm(direction - way)) for way in ways]
        if lost[1] < lost[0]:
            self._direction, self._sign = ways[1], -1.0
        length = float(np.linalg.norm(self._direction))
        if length > 0.0:
            self._direction = self._direction / length

    def _freed(self, direction: FloatArray) -> FloatArray:
        q = self._robot.integrate(self._q, direction, _PROBE)
        out = np.abs(self._robot.difference(q, self._walk.within_limits(q))) > 1e-12
        return np.where(out, 0.0, direction)

    def path(self, wanted: FloatArray, accuracy: float) -> ApproachPath:
        """Points for `wanted` (S,), rising."""
        rate = (self.sigma(_PROBE) or 0.0) / _PROBE
        if rate < 1e-6:
            raise SettingError(
                f"along direction {self._direction.tolist()} the singular value grows by {rate:.1e} per rad only; take "
                "another direction, such as the singular configuration's own `approach`."
            )
        found: list[tuple[float, float]] = []
        for target in wanted.tolist():
            s = found[-1][0] * target / found[-1][1] if found else target / rate
            point = self._reach(s, target, accuracy)
            if point is None or (found and point[0] <= found[-1][0]):
                break
            found.append(point)
        reach = self._sign * np.array([s for s, _ in reversed(found)])
        q = [self._robot.integrate(self._q, self._direction, float(s)) for s in reach]
        return ApproachPath(
            q=np.array(q).reshape(len(found), len(self._q)),
            sigma=np.array([sigma for _, sigma in reversed(found)]),
            reach=reach,
            direction=self._direction,
        )

    def sigma(self, s: float) -> float | None:
        """sigma at s >= 0 on the way out; None outside the limits or where the level has no such singular value."""
        if not (s <= _FARTHEST and self._inside(s)):
            return None
        split = self._walk.split(self._at(s))
        return None if split is None else split.sigma

    def _at(self, s: float) -> FloatArray:
        return self._robot.integrate(self._q, self._direction, self._sign * s)

    def _inside(self, s: float) -> bool:
        q = self._at(s)
        return bool(np.abs(self._walk.within_limits(q) - q).max() <= 1e-12)

    def _reach(self, s: float, target: float, accuracy: float) -> tuple[float, float] | None:
        """(s, sigma) with sigma within `accuracy` of the target, or None."""
        for _ in range(_STEPS):
            sigma = self.sigma(s)
            if sigma is None or sigma == 0.0 or not math.isfinite(sigma):
                return None
            if abs(sigma / target - 1.0) <= accuracy:
                return s, sigma
            s *= min(max(target / sigma, 0.25), 4.0)
        return None


def tasks_only(stack: Stack) -> tuple[Stack, list[int]]:
    """The stack without its limits, and which of the given levels each of its levels is."""
    levels, names, index = [], [], []
    for k, items in enumerate(stack.levels):
        tasks = [item for item in items if not isinstance(item, Limit) and not is_limit(item)]
        if tasks:
            levels.append(tasks)
            names.append(stack.names[k])
            index.append(k)
    if not levels:
        raise SettingError(f"{stack!r} holds no task; singularities are those of tasks.")
    return Stack(levels, names=names), index
