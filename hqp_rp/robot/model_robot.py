"""What robots computed by a model library share: names, limits, the reference configuration, the table of frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hqp_rp.core.errors import RobotError
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.core.warned import warn
from hqp_rp.robot.coupling import Coupling
from hqp_rp.robot.frames import FrameTable

_MANY_TURNS = 4.0 * np.pi  # rad: few joints turn more than twice either way
_NARROW = np.pi * np.pi / 90.0  # rad: what 2 pi is when it is taken for degrees
_NEAR = 1e-9  # rad or m: how far outside its limits a configuration may be by rounding


class ModelRobot:
    """The part of `Robot` that does not depend on the configuration, filled in by the adapter's constructor."""

    _name: str
    _nq: int
    _nv: int
    _joint_names: tuple[str, ...]
    _joint_widths: tuple[int, ...]
    _couplings: tuple[Coupling, ...] = ()
    _loops: tuple[str, ...] = ()
    _limited_balls: tuple[str, ...] = ()
    _hinges: IntArray
    _table: FrameTable
    _lower: FloatArray
    _upper: FloatArray
    _velocity_limit: FloatArray
    _neutral: FloatArray
    _q: FloatArray

    @property
    def nq(self) -> int:
        return self._nq

    @property
    def nv(self) -> int:
        return self._nv

    @property
    def joint_names(self) -> tuple[str, ...]:
        return self._joint_names

    @property
    def joint_widths(self) -> tuple[int, ...]:
        """How many velocities each joint has, as in `joint_names`: 1 for a hinge or slide, 3 for a ball, 6 for a free one."""
        return self._joint_widths

    @property
    def couplings(self) -> tuple[Coupling, ...]:
        """Joints that the model says follow others; `hqp_rp.control.JointCoupling` holds them."""
        return self._couplings

    @property
    def loops(self) -> tuple[str, ...]:
        """Names of the model's other equality constraints (connect, weld ...), which no limit here holds."""
        return self._loops

    @property
    def limited_balls(self) -> tuple[str, ...]:
        """Names of ball joints with a range, which `lower` and `upper` cannot say."""
        return self._limited_balls

    @property
    def hinges(self) -> IntArray:
        """Velocity indices of the joints whose coordinate is an angle."""
        return self._hinges

    @property
    def frame_names(self) -> tuple[str, ...]:
        return self._table.names

    @property
    def lower(self) -> FloatArray:
        return self._lower

    @property
    def upper(self) -> FloatArray:
        return self._upper

    @property
    def velocity_limit(self) -> FloatArray:
        return self._velocity_limit

    @property
    def neutral(self) -> FloatArray:
        return self._neutral

    @property
    def q(self) -> FloatArray:
        return self._q

    def _warn_of_neutral(self, q: FloatArray, index: IntArray) -> None:
        """A neutral configuration outside the limits is said; index (nv,) into q, -1 for none."""
        own = index >= 0
        value = np.where(own, q[np.maximum(index, 0)], 0.0)
        outside = np.flatnonzero(own & ((value < self._lower - _NEAR) | (value > self._upper + _NEAR)))
        if outside.size:
            i = int(outside[0])
            names = np.repeat(np.array(self._joint_names, dtype=object), self._joint_widths)
            warn(
                f"The neutral configuration of {self._name} has joint {names[i]!r} at {value[i]:g}, outside its limits "
                f"[{self._lower[i]:g}, {self._upper[i]:g}]{_and_more(outside)}; give another with neutral=."
            )

    def _warn_of_ranges(self, hinges: IntArray) -> None:
        """Ranges that look like degrees, or like radians read as degrees, are said; hinges: velocity indices, kept."""
        self._hinges = hinges
        names = np.repeat(np.array(self._joint_names, dtype=object), self._joint_widths)
        bounds = np.stack((self._lower[hinges], self._upper[hinges]), axis=1)
        largest = np.where(np.isfinite(bounds), np.abs(bounds), 0.0).max(axis=1, initial=0.0)
        limited = np.isfinite(bounds).all(axis=1) & (bounds[:, 0] < bounds[:, 1])
        wide = hinges[largest > _MANY_TURNS]
        if wide.size:
            i = int(wide[0])
            warn(
                f"Joint {names[i]!r} of {self._name} has the range [{self._lower[i]:g}, {self._upper[i]:g}] rad, "
                f"{(self._upper[i] - self._lower[i]) / (2.0 * np.pi):.1f} turns{_and_more(wide)}: are these degrees? Limits of "
                "a URDF are in radians; an MJCF says which by <compiler angle>."
            )
        elif limited.sum() >= 3 and largest[limited].max() < _NARROW:
            i = int(hinges[limited][0])
            warn(
                f"Every limited hinge of {self._name} stays within {largest[limited].max():.3g} rad, joint {names[i]!r} within "
                f"[{self._lower[i]:.3g}, {self._upper[i]:.3g}]: were radians read as degrees? An MJCF means degrees unless it "
                'says <compiler angle="radian"/>, an MjSpec unless spec.compiler.degree is False.'
            )

    def _require_moving(self, carrier: int, frame: str) -> None:
        """Raises `RobotError` for a frame carried by 0, the world."""
        if carrier == 0:
            raise RobotError(f"The frame {frame!r} of {self._name} is fixed to the world; name one that moves.")

    def _require_part_mass(self, mass: float, bodies: Sequence[str]) -> None:
        if mass <= 0.0:
            raise RobotError(
                f"The parts {', '.join(bodies) or 'none'} of {self._name} have no mass, hence no centre of mass."
            )

    def _frame(self, frame: object) -> int:
        """The index of a frame. Raises `RobotError` for a name that the model does not have."""
        try:
            return self._table.index[frame]  # type: ignore[index]
        except (KeyError, TypeError):
            raise self._table.error(frame, self._name) from None


def _and_more(found: IntArray) -> str:
    """How many others are meant beside the one that is named."""
    return "" if found.size == 1 else f", as do {found.size - 1} more"
