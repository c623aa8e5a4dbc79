"""What a MuJoCo model holds beside the robot: mocap bodies, and bodies that no actuator moves."""

from __future__ import annotations

import abc
from collections.abc import Iterable
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.core.errors import RobotError, unknown_name
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.robot.frames import checked_vector, frozen
from hqp_rp.robot.model_robot import ModelRobot

_LEAST_SQUARE = float(mujoco.mjMINVAL) ** 2


class MujocoSurroundings(ModelRobot, abc.ABC):
    """The part of `MujocoRobot` about what the robot does not move itself."""

    _model: Any
    _data: Any
    _unactuated: IntArray
    _unactuated_velocity: FloatArray
    _mocap_velocity: FloatArray
    _given: FloatArray | None
    _is_complete: bool

    @property
    def unactuated(self) -> IntArray:
        """Velocity indices (k,) of what the robot does not drive, ascending; a stack gives these no velocity.

        The joints of kinematic trees without a single actuator, where the model has actuators: a ball on the floor, a door.
        """
        return self._unactuated

    @property
    def unactuated_velocity(self) -> FloatArray:
        """(k,) how fast these move by themselves, rad/s or m/s, 0 until set; tasks and limits take it into account."""
        return self._unactuated_velocity

    @unactuated_velocity.setter
    def unactuated_velocity(self, value: ArrayLike) -> None:
        velocity = np.array(checked_vector(value, len(self._unactuated), "unactuated_velocity"))
        self._unactuated_velocity = frozen(velocity)

    def set_mocap(
        self,
        body: str,
        position: ArrayLike | None = None,
        quaternion: ArrayLike | None = None,
        *,
        velocity: ArrayLike | None = None,
    ) -> None:
        """Say where a mocap body is, and how fast it moves.

        Args:
            body: its name.
            position: (3,) in the world, m; None leaves it where it is.
            quaternion: (4,) (w, x, y, z) to the world, of any length but 0; None leaves it.
            velocity: (6,) of its origin, m/s, over its angular velocity, rad/s, in world axes; None means at rest. Limits on
                distances take it into account.

        Raises:
            RobotError: no such mocap body, a wrong size, a NaN, or a zero quaternion.
        """
        model, data = self._model, self._data
        names = [model.body(i).name for i in range(model.nbody) if model.body_mocapid[i] >= 0]
        if body not in names:
            raise RobotError(f"{self._name}: {unknown_name('mocap body', body, names)}")
        i = int(model.body_mocapid[model.body(body).id])
        what = f"of the mocap body {body!r}"
        place = None if position is None else checked_vector(position, 3, f"the position {what}")
        turn = None if quaternion is None else checked_vector(quaternion, 4, f"the quaternion {what}")
        if turn is not None and not turn @ turn > _LEAST_SQUARE:
            raise RobotError(f"the quaternion {what} is zero; it must have a direction.")
        speed = np.zeros(6) if velocity is None else checked_vector(velocity, 6, f"the velocity {what}")
        if place is not None:
            data.mocap_pos[i] = place
        if turn is not None:
            data.mocap_quat[i] = turn
        self._mocap_velocity[i] = speed
        self._moved()

    @property
    def mocap_poses(self) -> tuple[FloatArray, FloatArray]:
        """Positions (k, 3) in m and quaternions (k, 4), (w, x, y, z), of the mocap bodies, as they are in an MjData."""
        return self._data.mocap_pos.copy(), self._data.mocap_quat.copy()

    def mocap_twist(self, geom: int) -> FloatArray | None:
        """(6,) velocity at the world's origin over angular velocity of the mocap body that carries a geom, None for others."""
        model = self._model
        root = int(model.body_rootid[model.geom_bodyid[geom]])
        i = int(model.body_mocapid[root])
        if i < 0 or not self._mocap_velocity[i].any():
            return None
        linear, angular = self._mocap_velocity[i, :3], self._mocap_velocity[i, 3:]
        twist: FloatArray = np.empty(6)
        twist[:3], twist[3:] = linear - np.cross(angular, self._data.mocap_pos[i]), angular
        return twist

    def follow(self, data: Any) -> None:
        """Take the configuration, the mocap bodies' poses and the velocities of what is not driven from an MjData.

        Args:
            data: a state of this robot's model, such as the simulation's; it is read, not changed. The velocity of mocap
                bodies is not in it and counts as 0.

        Raises `RobotError` for a state of another model, or a configuration that `update` refuses.
        """
        sizes = [getattr(data, name, np.empty(0)).shape for name in ("qpos", "qvel", "mocap_pos")]
        if not isinstance(data, mujoco.MjData) or sizes != [
            (self._nq,),
            (self._nv,),
            (int(self._model.nmocap), 3),
        ]:
            raise RobotError(f"data is no state of {self._name}; give an mujoco.MjData of robot.model.")
        self._data.mocap_pos[:], self._data.mocap_quat[:] = data.mocap_pos, data.mocap_quat
        self._mocap_velocity[:] = 0.0
        self.unactuated_velocity = data.qvel[self._unactuated]
        self.update(np.array(data.qpos))

    @abc.abstractmethod
    def update(self, q: FloatArray) -> None:
        """Set the configuration and compute the kinematics."""

    def _moved(self) -> None:
        """Something else than q has changed."""
        mujoco.mj_kinematics(self._model, self._data)
        self._is_complete = False

    def _begin_with(self, unactuated: Iterable[str] | None) -> None:
        """Find what is not driven: these joints, or by default the trees that no actuator moves."""
        model = self._model
        self._mocap_velocity = np.zeros((int(model.nmocap), 6))
        if unactuated is None:
            found = _without_actuator(model)
        else:
            names = self._joint_names
            trees = []
            for name in unactuated:
                if name not in names:
                    raise RobotError(f"unactuated: {unknown_name('joint', name, names)}")
                trees.append(int(model.dof_treeid[model.jnt_dofadr[names.index(name)]]))
            found = np.flatnonzero(np.isin(model.dof_treeid, trees))
        if len(found) == self._nv:
            raise RobotError(f"unactuated leaves {self._name} no joint to move; leave some out.")
        found = found.astype(np.int64)
        found.setflags(write=False)
        self._unactuated = found
        self._unactuated_velocity = frozen(np.zeros(len(found)))


def _without_actuator(model: Any) -> IntArray:
    """Velocity indices of the trees that no actuator moves; none where nothing is actuated."""
    if not model.nu or model.ntree < 2:
        return np.zeros(0, dtype=np.int64)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    moment = np.zeros((model.nu, model.nv))
    mujoco.mju_sparse2dense(moment, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind)
    driven = np.unique(model.dof_treeid[moment.any(axis=0)])
    if not driven.size:
        return np.zeros(0, dtype=np.int64)
    return np.flatnonzero(~np.isin(model.dof_treeid, driven)).astype(np.int64)
