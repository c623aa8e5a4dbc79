"""Poses and Jacobians of some frames of a MuJoCo state, read without a copy in between."""

from __future__ import annotations

from typing import TYPE_CHECKING

import mujoco
import numpy as np

from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.frames import Frames, Point

if TYPE_CHECKING:
    from hqp_rp.robot.mujoco_robot import MujocoRobot


class MujocoFrames(Frames):
    """The frames of a `MujocoRobot`, from its private state. Raises `RobotError` for a name that it does not have."""

    def __init__(self, robot: MujocoRobot, names: tuple[str | Point, ...]) -> None:
        super().__init__(robot, names)
        self._arm_of = robot._unchanged_arm
        self._state = model, data = robot._model, robot._data
        self._poses = []
        self._bodies_and_sites = []
        self._points = []
        for f, name in enumerate(names):
            if isinstance(name, Point):
                self._points.append((self.origins[f], self.jacobians[f, :3]))
                continue
            index = robot._frame(name)
            if index < model.nbody:
                function, rotation, origin = mujoco.mj_jacBody, data.xmat[index], data.xpos[index]
            else:
                index -= model.nbody
                function, rotation, origin = mujoco.mj_jacSite, data.site_xmat[index], data.site_xpos[index]
            self._poses += [(self.rotations[f], rotation.reshape(3, 3)), (self.origins[f], origin)]
            self._bodies_and_sites.append((function, self.jacobians[f, :3], self.jacobians[f, 3:], index))

    def read(self) -> None:
        """Fill the arrays for the robot's current configuration."""
        model, data = self._state
        for out, source in self._poses:
            out[:] = source
        for function, linear, angular, index in self._bodies_and_sites:
            function(model, data, linear, angular, index)
        for origin, jacobian in self._points:
            origin[:] = self._robot.center_of_mass()
            jacobian[:] = self._robot.center_of_mass_jacobian()

    def many(self, q: FloatArray, threads: int | None = 1) -> tuple[FloatArray, FloatArray, FloatArray]:
        """As `Frames.many`; of a robot made from an arm, by the arm's compiled kinematics."""
        arm = self._arm_of()
        if arm is None or not self.names or not set(self.names) <= set(arm.frame_names):
            return super().many(q, threads)
        found = [arm.kinematics(q, str(name), threads=threads) for name in self.names]
        return tuple(np.stack([of_one[k] for of_one in found], axis=1) for k in range(3))  # type: ignore[return-value]
