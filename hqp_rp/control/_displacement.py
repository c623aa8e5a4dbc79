"""Tasks and limits of libraries that solve for the displacement dq = v dt, as rows on the velocity.

mink and pink weigh their tasks against each other: one with error e(q), Jacobian de/dq = A, gain alpha and cost w
contributes w (A dq + alpha e). Here the same rows read `w A v = -w alpha e / dt`, and the level says what comes first. A
limit `G dq <= h` reads `G v <= h / dt`. What differs between the libraries is in `mink_adapter` and `pink_adapter`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np

from hqp_rp.control._row_names import velocity_names
from hqp_rp.core.errors import HqpError, SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot

_LIMITS = ("mink.limits.", "pink.limits.", "pink.barriers.")
_ALL = ("mink.tasks.", "pink.tasks.", *_LIMITS)


def library_of(item: object) -> str | None:
    """The library, "mink" or "pink", whose task, limit or barrier this is; None for anything else. It imports neither."""
    for kind in type(item).__mro__:
        if kind.__module__.startswith(_ALL):
            return kind.__module__.partition(".")[0]
    return None


def is_limit(item: object) -> bool:
    """Whether it is a limit, or a barrier, of mink or pink."""
    return any(kind.__module__.startswith(_LIMITS) for kind in type(item).__mro__)


class Configurations(ABC):
    """The library's configuration of the robot that a stack works on, brought up to date once per problem.

    Its state is its own: nothing that a task computes there disturbs the robot.
    """

    __slots__ = ("_configuration", "_fresh", "_robot")

    def __init__(self) -> None:
        self._robot: Robot | None = None
        self._configuration: Any = None
        self._fresh = False

    def expire(self) -> None:
        """Say that the robot may have moved."""
        self._fresh = False

    def at(self, robot: Robot) -> Any:
        """The configuration at `robot.q`. Raises `RobotError` for a robot that another library computes."""
        if robot is not self._robot:
            self._configuration = self._made_for(robot)
            self._robot, self._fresh = robot, False
        if not self._fresh:
            self._move(self._configuration, robot)
            self._fresh = True
        return self._configuration

    @abstractmethod
    def _made_for(self, robot: Robot) -> Any:
        """A configuration of the robot's model, anywhere. Raises `RobotError` for a robot without such a model."""

    @abstractmethod
    def _move(self, configuration: Any, robot: Robot) -> None:
        """Bring it to `robot.q`."""

    def __reduce__(self) -> tuple[Any, ...]:
        # It belongs to one robot: whoever is copied makes another when it needs one.
        return type(self), ()


class _Adapter:
    """What adapters of tasks and of limits share: the item, its library, and how its errors are told.

    Attributes:
        library: the name of the library. errors: what it raises where an item is not set up as it should be.
    """

    __slots__ = ("_configurations", "_item")
    library: ClassVar[str]
    errors: ClassVar[tuple[type[Exception], ...]]

    def __init__(self, item: Any, configurations: Configurations) -> None:
        self._item = item
        self._configurations = configurations

    @property
    def name(self) -> str:
        """The library, the class and the frame, where it has one, of the item."""
        frame = getattr(self._item, "frame_name", None) or getattr(self._item, "frame", None)
        return f"{self.library} {type(self._item).__name__}" + ("" if frame is None else f" {frame}")

    def _refused(self, problem: Exception) -> SettingError:
        # Pinocchio puts file and function before its message.
        words = " ".join(str(problem).split()).rpartition(" message: ")[2] or type(problem).__name__
        return SettingError(f"{self.name}: {words.rstrip('.')}. Set it up as {self.library} asks for.")


class DisplacementTask(_Adapter):
    """Rows of a task: `cost * A v = -cost * gain * error / dt`; rows of zero cost are dropped.

    Cost, gain and target of the task may be changed at any time; the next step sees them.

    Its `lm_damping` is that of the level it stands in, mu = lm_damping |w alpha e|^2, unless `Stack(damping=...)` gives that
    level another.
    """

    __slots__ = ()
    rates: ClassVar[tuple[type, ...]] = ()
    """Tasks of the library whose error is a velocity that is wanted, or nothing, and not what a configuration lacks."""

    @property
    def lm_damping(self) -> float:
        """The Levenberg-Marquardt damping of this task."""
        return float(self._item.lm_damping)

    @property
    def feedback_gain(self) -> float:
        """The share of its error in a step; 0 of a task that feeds back none."""
        return 0.0 if isinstance(self._item, self.rates) else float(np.max(self._item.gain))

    def evaluate(self, robot: Robot, dt: float) -> tuple[FloatArray, FloatArray]:
        """Jacobian (m, nv) and rate (m,), scaled by the cost; m is the number of rows of nonzero cost.

        Raises `SettingError` where the library raises, or where Jacobian, error and cost do not fit together.
        """
        task, configuration = self._item, self._configurations.at(robot)
        try:
            A = np.asarray(task.compute_jacobian(configuration), dtype=np.float64)
            error = np.asarray(task.compute_error(configuration), dtype=np.float64)
        except self.errors as problem:
            raise self._refused(problem) from problem
        if A.ndim == 1:  # of one row, or of a robot with one velocity
            A = A.reshape(-1, robot.nv)
        # Read after the error: some tasks set their cost while they compute it.
        cost = np.asarray(1.0 if task.cost is None else task.cost, dtype=np.float64)
        if error.ndim != 1 or len(A) != len(error) or cost.shape not in ((), (1,), error.shape):
            raise SettingError(
                f"{self.name}: its Jacobian has shape {A.shape}, its error {error.shape} and its cost {cost.shape}, which "
                f"do not fit together. Set it up as {self.library} asks for."
            )
        rate = error * (-task.gain / dt)
        cost = np.broadcast_to(cost, error.shape)
        if (cost == 1.0).all():
            return A, rate
        kept = cost != 0.0
        if not kept.all():
            A, rate, cost = A[kept], rate[kept], cost[kept]
        return cost[:, None] * A, cost * rate


class DisplacementLimit(_Adapter, ABC):
    """Rows of a limit: `G v <= h / dt`, without a lower bound."""

    __slots__ = ()

    def rows(self, robot: Robot, dt: float, v: FloatArray | None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """G (m, nv), lower (m,) all -inf, upper (m,); no rows where the limit limits nothing."""
        try:
            found = self._inequalities(self._configurations.at(robot), dt)
        except HqpError:
            raise
        except self.errors as problem:
            raise self._refused(problem) from problem
        if found is None:
            return np.empty((0, robot.nv)), np.empty(0), np.empty(0)
        h = np.asarray(found[1], dtype=np.float64)
        # Some give a single row as a vector.
        G = np.asarray(found[0], dtype=np.float64)
        return G.reshape(-1, robot.nv) if G.ndim == 1 else G, np.full(len(h), -np.inf), h / dt

    def row_names(self, robot: Robot) -> list[str]:
        """The joint of each row, "-" before it where the row limits the joint from below; none where no joint is named."""
        indices = getattr(self._item, "indices", ())
        names = velocity_names(robot)
        names = [names[i] for i in indices if i < len(names)]
        return [*names, *(f"-{name}" for name in names)]

    def bounded_speeds(self, robot: Robot) -> list[str]:
        """The joints whose velocity, or its change in a step, it bounds wherever they are: a limit on positions does not."""
        kinds = [kind.__name__ for kind in type(self._item).__mro__ if kind.__module__.startswith(_LIMITS)]
        if not {"VelocityLimit", "AccelerationLimit"} & set(kinds):
            return []
        return [name for name in self.row_names(robot) if not name.startswith("-")]

    @abstractmethod
    def _inequalities(self, configuration: Any, dt: float) -> tuple[Any, Any] | None:
        """G and h of `G dq <= h`, or None."""
