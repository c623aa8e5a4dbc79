"""What robots computed by a model library share: names, limits, the reference configuration, the table of frames."""

from __future__ import annotations

from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.frames import FrameTable


class ModelRobot:
    """The part of `Robot` that does not depend on the configuration, filled in by the adapter's constructor."""

    _name: str
    _nq: int
    _nv: int
    _joint_names: tuple[str, ...]
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

    def _frame(self, frame: object) -> int:
        """The index of a frame. Raises `RobotError` for a name that the model does not have."""
        try:
            return self._table.index[frame]  # type: ignore[index]
        except (KeyError, TypeError):
            raise self._table.error(frame, self._name) from None
