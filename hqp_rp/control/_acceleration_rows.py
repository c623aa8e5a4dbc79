"""The rows of many tasks and limits on accelerations: the inner part of `AccelerationStack.problem`."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from hqp_rp.control._native_rows import NativeRows, NativeTask
from hqp_rp.control._stack_rows import LIMIT, StackRows, Where
from hqp_rp.control.task import FeedbackTask
from hqp_rp.core.errors import ProblemError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot import Robot

_DISTANCE = 1e-5  # rad or m, that the quickest joint is moved to either side for a central difference


class AccelerationRows(StackRows):
    """As `StackRows`, for the unknown v-dot.

    Args:
        kd: 1/s, of tasks that state a velocity alone.
    """

    __slots__ = (
        "_biases",
        "_fill_acceleration",
        "_gains",
        "_gains_given",
        "_kd",
        "_native_motion",
        "_native_rows_of",
        "_number_rates",
        "_seconds",
        "_velocity",
    )

    def __init__(
        self, items: Sequence[tuple[int, Any]], robot: Robot, two_sided: bool, where: Where, *, kd: float
    ) -> None:
        super().__init__(items, robot, two_sided, where)
        self._kd = kd
        self._biases = np.zeros((len(self._frames.names), 6))
        rows = [layout.rows for layout, _ in self._packs]
        ends = np.cumsum([0, *rows]).tolist()
        self._native_rows_of = [slice(a, b) for a, b in itertools.pairwise(ends)]
        self._gains = np.zeros((2, ends[-1]))
        self._number_rates = np.zeros(len(self._numbers))
        self._seconds: list[Any] = [None] * len(self._packed)
        self._gains_given = [-1] * len(self._packed)
        self._velocity = np.zeros(robot.nv)
        self._fill_acceleration = self._native.fill_acceleration
        self._native_motion = self._frames.kinematics is not None

    def _own_velocity(self, v: FloatArray | None) -> FloatArray:
        """v (nv,), with what the robot knows of the joints that it does not drive."""
        assert v is not None
        velocity = v
        if self._unactuated is not None and self._unactuated.size:
            velocity = v.copy()
            velocity[self._unactuated] = self.robot.unactuated_velocity  # type: ignore[attr-defined]
        self._velocity = velocity
        return velocity

    def _call_native(
        self, matrix: FloatArray, lower: FloatArray, upper: FloatArray | None, dt: float, plain: bool
    ) -> bool:
        if not self._packed:
            return super()._call_native(matrix, lower, upper, dt, plain)
        if not self._native_motion:
            self._frames.fill_biases(self._velocity, self._biases)
        return self._fill_acceleration(
            matrix, lower, upper, dt, self._velocity, self._number_rates, self._gains, self._biases
        )

    def _pack_one(self, i: int, task: NativeRows) -> None:
        """As the base class; gains and rates only when more was set than a target that moves."""
        super()._pack_one(i, task)
        if task._made is not self._seconds[i]:
            self._pack_second(i, task)
            self._seconds[i] = task._made

    def _pack_second(self, i: int, task: Any) -> None:
        """Gains and rates of the numbers of a task, when something of it was set."""
        layout, span = self._packs[i]
        if isinstance(task, NativeTask):
            if task._gains_given != self._gains_given[i]:
                rows = self._native_rows_of[i]
                self._gains[0, rows], self._gains[1, rows] = task._second_order(layout.rows)
                self._gains_given[i] = task._gains_given
            self._number_rates[span] = task._number_rates(layout)

    def _take_out(self, matrix: FloatArray, lower: FloatArray, upper: FloatArray) -> None:
        """What the robot does not drive moves on at its velocity: it has no acceleration of its own."""
        others = self._unactuated
        alone = np.any(matrix[:, others] != 0.0, axis=1)
        matrix[:, others] = 0.0
        alone &= ~np.any(matrix != 0.0, axis=1)
        for (kind, _), rows in zip(self._items, self._rows_of, strict=True):
            if kind == LIMIT and alone[rows].any():
                lower[rows][alone[rows]] = -np.inf
                upper[rows][alone[rows]] = np.inf

    def _given(self, dt: float | None, v: FloatArray | None) -> list[tuple[int, Any, Any, Any]]:
        """As the base class, each item's rows on velocities made rows on v-dot."""
        found = super()._given(dt, v)
        velocity = self._velocity
        unstated = []
        made = []
        for k, A, lower, upper in found:
            kind, item = self._items[k]
            if kind == LIMIT:
                assert dt is not None
                along = A @ velocity
                if getattr(item, "bounds_accelerations", False):
                    made.append((k, A * dt, lower - along, upper - along))
                else:
                    made.append((k, A, (lower - along) / dt, (upper - along) / dt))
                continue
            bias = self._stated_bias(item, len(lower))
            rate = self._wanted(item, A @ velocity, lower)
            if bias is None:
                unstated.append(len(made))
            else:
                rate = rate - bias
            made.append((k, A, rate, rate))
        if unstated:
            biases = self._by_difference([made[i][0] for i in unstated], dt)
            for i, bias in zip(unstated, biases, strict=True):
                k, A, rate, _ = made[i]
                if bias.shape != rate.shape:
                    raise ProblemError(
                        f"{self._where(self._items[k][1])}: the number of its rows changes nearby, so that Jdot v "
                        "is not known; give it a method bias_acceleration(robot, v)."
                    )
                made[i] = k, A, rate - bias, rate - bias
        return made

    def _stated_bias(self, item: Any, rows: int) -> FloatArray | None:
        """Jdot v (m,) as the item's own method says it; None where it has none, or does not know."""
        own = getattr(item, "bias_acceleration", None)
        stated = None if own is None else own(self.robot, self._velocity)
        if stated is None:
            return None
        bias = np.asarray(stated, dtype=np.float64)
        if bias.shape != (rows,):
            raise ProblemError(
                f"{self._where(item)}: bias_acceleration gives {bias.shape}; it must have one number for each of the "
                f"{rows} rows."
            )
        return bias

    def _wanted(self, item: Any, along: FloatArray, rate: FloatArray) -> FloatArray:
        """d/dt(J v) of a task that is not native: `rate` is what it wants of J v."""
        if isinstance(item, FeedbackTask):
            kp, kd = item._second_order(len(rate))
            weight: FloatArray = np.broadcast_to(np.asarray(item.weight, dtype=np.float64), rate.shape)
            error = item.error(self.robot)
            forward = rate / weight - item.gain * error
            ahead = np.zeros(len(rate)) if item.feedforward_acceleration is None else item._ahead(len(rate))
            wanted: FloatArray = weight * (ahead + kd * (forward - along / weight) + kp * error)
            return wanted
        own = getattr(item, "kd", None)
        damping: FloatArray = np.asarray(self._kd if own is None else own, dtype=np.float64)
        if damping.shape not in ((), rate.shape) or not (np.isfinite(damping) & (damping >= 0.0)).all():
            raise ProblemError(
                f"{self._where(item)}: kd is {own!r}; it must be finite and >= 0, one number or one for each of the "
                f"{len(rate)} rows."
            )
        return damping * (rate - along)

    def _by_difference(self, numbers: list[int], dt: float | None) -> list[FloatArray]:
        """Jdot v of these items by a central difference of J v along v; the robot is put back."""
        robot, v = self.robot, self._velocity
        fastest = float(np.abs(v).max(initial=0.0))
        if fastest == 0.0:
            return [np.zeros(self.counts[k]) for k in numbers]
        h = _DISTANCE / fastest
        q = robot.q
        sides = []
        try:
            for step in (h, -h):
                robot.update(robot.integrate(q, v, step))
                self._expire()
                sides.append([self._one(k, dt) @ v for k in numbers])
        finally:
            robot.update(q)
            self._expire()
        return [
            (ahead - behind) / (2.0 * h) if ahead.shape == behind.shape else np.zeros(0)
            for ahead, behind in zip(*sides, strict=True)
        ]

    def _one(self, k: int, dt: float | None) -> FloatArray:
        kind, item = self._items[k]
        matrix = item.evaluate(self.robot)[0] if kind == 0 else item.evaluate(self.robot, dt)[0]
        return np.asarray(matrix, dtype=np.float64)

    def _expire(self) -> None:
        """Say to what adapts items of other libraries that the robot has moved."""
        for _, item in self._items:
            configurations = getattr(item, "_configurations", None)
            if configurations is not None:
                configurations.expire()
