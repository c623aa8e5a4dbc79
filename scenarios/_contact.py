"""A simulated arm with a ball at its tool, against walls of a given stiffness: the contact physics of the force scenarios."""

from __future__ import annotations

import collections
import dataclasses
import math
from collections.abc import Mapping

import mujoco
import numpy as np

from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.dh import DHArm
from hqp_rp.robot.mujoco_arm import arm_spec
from hqp_rp.robot.mujoco_robot import MujocoRobot

BALL_RADIUS = 0.02
"""m, of the ball that stands for the tool; its centre is the frame "tool"."""

_STICKS = 100.0  # how much stiffer the contact is against sliding than across: less creep while it sticks
_PLATE = 0.3  # m, half the size at which a wall is drawn; the plane itself has no end


@dataclasses.dataclass(frozen=True, slots=True)
class Surface:
    """What a wall is made of: while it is touched, `F_e = K_e r + B_e r' + M_e r''`, r the depth of the ball in it, in m.

    F_e is never negative: nothing sticks. That is equation (36). A ball that slides meets Coulomb friction, `friction` F_e
    against its motion. Args: stiffness K_e, N/m, > 0; damping B_e, N s/m, >= 0; mass M_e, kg, > 0, what moves with the
    surface, small beside the arm's; friction, >= 0.
    """

    stiffness: float = 1e5
    damping: float = 10.0
    mass: float = 0.01
    friction: float = 0.0

    def __post_init__(self) -> None:
        for name, low in (("stiffness", "> 0"), ("damping", ">= 0"), ("mass", "> 0"), ("friction", ">= 0")):
            value = getattr(self, name)
            good = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
            if not good or value < 0.0 or (value == 0.0 and low == "> 0"):
                raise SettingError(f"{name} of a wall is {value!r}; it must be a finite number {low}.")


def axis_turned(axis: str, tilt: float) -> FloatArray:
    """(3,) the world's axis "x", "y" or "z", turned about z by `tilt`, rad."""
    if axis == "z":
        return np.array((0.0, 0.0, 1.0))
    cosine, sine = math.cos(tilt), math.sin(tilt)
    return np.array((cosine, sine, 0.0)) if axis == "x" else np.array((-sine, cosine, 0.0))


@dataclasses.dataclass(frozen=True, slots=True)
class Touch:
    """What the walls felt during one control period. Every mapping has one entry for each wall, by its axis.

    Attributes:
        force: N, at the end of the period. peak: N, the largest at any simulation step.
        share: of the simulation steps with contact. energy: J, work done on the wall, the integral of F_e dr.
        depth: m, of the ball in the wall at the end; negative when it is away.
    """

    force: Mapping[str, float]
    peak: Mapping[str, float]
    share: Mapping[str, float]
    energy: Mapping[str, float]
    depth: Mapping[str, float]


class ContactArm:
    """The arm of `arm_spec` with a ball at its tool, and a flat wall across each of the given axes, on its positive side.

    The contact is MuJoCo's own; where the surface has friction, with an elliptic cone. Its constraint obeys
    `R f = a_ref - a`, a_ref = -b r' - k r with the depth r counted negative; with the regularization R = 1 / M_e, k = K_e
    / M_e and b = B_e / M_e that is exactly `Surface`'s law. So `solref` and `solimp` follow from K_e, B_e, M_e and
    the model's inverse weight of the last link, and nothing is tuned. Only the ball touches the walls.

    Args:
        arm: the arm. timestep: s, of the simulation.
        walls: axis ("x", "y" or "z" of the world) -> m, where along it the ball's centre is when it touches.
        surface: what all walls are made of.
        delay: steps of the simulation by which `reading` is late.
        tilt: rad, by which the axes that walls stand across are turned about the world's z.
        torques: the arm has motors without friction in the place of its velocity servos; see `drive`.
    """

    def __init__(
        self,
        arm: DHArm,
        timestep: float,
        walls: Mapping[str, float],
        surface: Surface,
        *,
        delay: int = 0,
        tilt: float = 0.0,
        torques: bool = False,
    ) -> None:
        spec = arm_spec(arm, timestep=timestep)
        spec.visual.global_.offwidth, spec.visual.global_.offheight = 1280, 960
        last = spec.body(arm.links[-1].name)
        site = spec.site("tool")
        last.add_geom(
            name="ball",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[BALL_RADIUS, 0.0, 0.0],
            pos=site.pos,
            contype=0,
            conaffinity=0,
            rgba=[0.83, 0.37, 0.0, 1.0],
            mass=0.0,
        )
        normals = np.array([axis_turned(axis, tilt) for axis in walls]).reshape(-1, 3)
        for row, (axis, place) in enumerate(walls.items()):
            spec.worldbody.add_geom(
                name=f"wall {axis}",
                type=mujoco.mjtGeom.mjGEOM_PLANE,
                size=[_PLATE, _PLATE, 0.01],
                pos=(place + BALL_RADIUS) * normals[row],
                zaxis=-normals[row],
                contype=0,
                conaffinity=0,
                rgba=[0.6, 0.65, 0.7, 0.35],
            )
            pair = spec.add_pair(name=f"wall {axis}", geomname1="ball", geomname2=f"wall {axis}", condim=1)
            if surface.friction:
                pair.condim = 3
                pair.friction = [surface.friction, surface.friction, 0.005, 1e-4, 1e-4]
        if surface.friction:
            spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
            spec.option.impratio = _STICKS
        self.robot = MujocoRobot.from_spec(spec, velocity_limit=arm.velocity_limit, neutral=arm.neutral)
        if torques:
            self.robot.model.actuator_gainprm[:] = self.robot.model.actuator_biasprm[:] = 0.0
            self.robot.model.dof_damping[:] = 0.0
        self.surface = surface
        self._axes = tuple(walls)
        self._places = np.array([walls[axis] for axis in self._axes], dtype=np.float64)
        self._normals = normals
        self._readings: collections.deque[tuple[FloatArray, FloatArray | None]] = collections.deque(maxlen=delay + 1)
        self._make_walls()

    def _make_walls(self) -> None:
        model, s = self.robot.model, self.surface
        self._row_of_geom = {model.geom(f"wall {axis}").id: i for i, axis in enumerate(self._axes)}
        self._tool = model.site("tool").id
        self._tip = self.robot.data.site_xpos[self._tool]
        last = self._last = int(model.geom("ball").bodyid[0])
        inverse = float(model.body_invweight0[last, 0])
        d = s.mass * inverse / (1.0 + s.mass * inverse)  # R = (1 - d) / d * inverse = 1 / M_e
        if not mujoco.mjMINIMP <= d <= mujoco.mjMAXIMP:
            raise SettingError(f"mass of a wall is {s.mass!r} kg; MuJoCo takes what is about {0.01 / inverse:.2g} kg.")
        # MuJoCo divides the stiffness by d and the damping by d.
        model.pair_solref[:] = (-s.stiffness * d / s.mass, -s.damping * d / s.mass)
        model.pair_solreffriction[:] = 0.0
        model.pair_solimp[:] = (d, d, 0.001, 0.5, 2.0)

    def reset(self, q: FloatArray) -> None:
        """Put the arm at rest at q (n,), rad."""
        robot = self.robot
        mujoco.mj_resetData(robot.model, robot.data)
        robot.data.qpos[:] = q
        mujoco.mj_forward(robot.model, robot.data)
        self._readings.clear()
        self._depth, self._force = self._sample()

    def reading(self) -> FloatArray:
        """(6,) what a force and torque sensor at the tool reads: force in N on the walls, and no torque; world axes.

        It is as old as the delay says, and 0 before there was anything to read. The torque of friction about the ball's
        centre is left out.
        """
        reading = np.zeros(6)
        if len(self._readings) == self._readings.maxlen:
            force, along = self._readings[0]
            reading[:3] = force.dot(self._normals) if along is None else force.dot(self._normals) + along
        return reading

    def push(self, wrench: FloatArray) -> None:
        """Apply a force in N and a torque in N m about the tool, (6,), world axes, until the next call."""
        data = self.robot.data
        lever = data.site_xpos[self._tool] - data.xipos[self._last]
        data.xfrc_applied[self._last, :3] = wrench[:3]
        data.xfrc_applied[self._last, 3:] = wrench[3:] + np.cross(lever, wrench[:3])

    def advance(self, command: FloatArray, substeps: int) -> Touch:
        """Send the servos a joint velocity (n,), rad/s, for that many simulation steps."""
        self.robot.data.ctrl[:] = command
        return self._advance(substeps)

    def drive(self, torque: FloatArray, substeps: int) -> Touch:
        """Hold joint torques (n,), N m, for that many simulation steps; of an arm with `torques`."""
        self.robot.data.qfrc_applied[:] = torque
        return self._advance(substeps)

    def _advance(self, substeps: int) -> Touch:
        model, data = self.robot.model, self.robot.data
        depths, forces = [self._depth], [self._force]
        for step in range(substeps):
            # A step ends with a new state whose forces the next one computes first; the last has none after it.
            mujoco.mj_step(model, data)
            if step:
                self._append(depths, forces)
        mujoco.mj_forward(model, data)
        self._append(depths, forces)
        self._depth, self._force = depths[-1], forces[-1]
        r, f = np.array(depths), np.array(forces)
        work = 0.5 * ((f[1:] + f[:-1]) * np.diff(r, axis=0)).sum(axis=0)
        found = (f[-1], f[1:].max(axis=0), (f[1:] > 0.0).mean(axis=0), work, r[-1])
        return Touch(*(dict(zip(self._axes, values.tolist(), strict=True)) for values in found))

    def _append(self, depths: list[FloatArray], forces: list[FloatArray]) -> None:
        depth, force = self._sample()
        depths.append(depth)
        forces.append(force)

    def _sample(self) -> tuple[FloatArray, FloatArray]:
        """Depth in m and force in N for each wall, at the state that MuJoCo computed last; it is read as well."""
        data = self.robot.data
        depth: FloatArray = self._normals.dot(self._tip) - self._places
        force, along = np.zeros(len(self._axes)), None
        if data.ncon:
            contact, rough = data.contact, self.surface.friction > 0.0
            addresses = contact.efc_address.tolist()
            for i, geoms in enumerate(contact.geom.tolist()):
                if addresses[i] >= 0:
                    row = self._row_of_geom.get(geoms[0], self._row_of_geom.get(geoms[1]))
                    force[row] = data.efc_force[addresses[i]]
                    if rough:
                        sliding = self._sliding(i, geoms[0])
                        along = sliding if along is None else along + sliding
        self._readings.append((force, along))
        return depth, force

    def _sliding(self, i: int, first: int) -> FloatArray:
        """(3,) N, along the wall, what the ball does to it at the contact i, whose first geom this is."""
        data = self.robot.data
        local = np.zeros(6)
        mujoco.mj_contactForce(self.robot.model, data, i, local)
        along: FloatArray = local[1:3] @ data.contact.frame[i].reshape(3, 3)[1:]
        return along if first not in self._row_of_geom else -along
