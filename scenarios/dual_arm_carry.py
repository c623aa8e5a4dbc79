"""Two arms carry a box between their hands: is the squeeze a level like any other, below where the box goes?"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from hqp_rp.control.activation import ramp
from hqp_rp.control.command import Mode
from hqp_rp.control.contact import Contact
from hqp_rp.control.contact_force_task import ContactForceTask
from hqp_rp.control.joint_limit import JointLimit
from hqp_rp.control.pose_task import PoseTask
from hqp_rp.control.posture_task import PostureTask
from hqp_rp.control.torque_controller import TorqueCommand, TorqueController
from hqp_rp.control.torque_stack import TorqueStack
from hqp_rp.core.errors import SettingError
from hqp_rp.core.solver import Solver
from hqp_rp.robot.arms import sawyer
from hqp_rp.robot.dual_arm import SIDES, dual_arm_spec
from hqp_rp.scenarios._crossing import turned_about
from hqp_rp.scenarios.scenario import Scenario, Step, refused_step

if TYPE_CHECKING:
    from hqp_rp.robot.mujoco_robot import MujocoRobot

# Both tools at +-0.16 m beside (0.6, 0, 0.35) m, their z axes towards each other; of sixty random starts of an inverse
# kinematics the one farthest from singularities and limits.
_START = (
    *(0.22391895932582886, 2.38334326926436, -0.5548106932807692, -1.8282590278804032),
    *(-0.13436908612579565, 1.9138639739090808, 0.6775294419950121),
    *(-0.17568724177328482, 2.073621178699512, -1.5934768173868168, -1.2803276509315027),
    *(-0.6105969420986412, 1.1650172178404488, -1.3741424193760374),
)
_MIDDLE = (0.6, 0.0, 0.35)
_BOX = (0.12, 0.1602, 0.08)
"""m, half sizes: 0.2 mm more than the hands are apart."""
_PAD = 0.035
"""m, half the side of the square pad at each tool."""
_END = 4.0
_PHASES = (0.0, 0.4, 0.6, 1.5, 1.6, 2.5, 2.6, 3.0, 3.2, 3.3)
"""s of 4: squeeze begins, is there; lift begins, is up; turn and shift begin, end; more squeeze begins, is there; push begins,
ends."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class DualArmCarry(Scenario):
    """Two Sawyers under torques hold a box by friction, lift it, shift and turn it, squeeze harder, and are pushed.

    Arms and box are one mechanism of 20 velocities, of which the motors drive 14; each hand has four points of contact on the
    box, whose forces act between the two. The levels are

        1  contacts    the hands do not move on the box
        2  box         pose of the box
        3  squeeze     the normal force of each hand: internal, as far as the box's motion leaves it free
        4  posture     the arms stay as they start; forces even

    Hard: the equation of motion of the box, torques, friction and unilaterality at eight points, joint positions,
    velocities and accelerations in one box.

    A refusal is yielded, with nothing measured, and ends the run. `Step.measured`, of the period that follows the problem:

        "box position error [m]", "box orientation error [rad]": norms;
        "squeeze error [N]": of the forces of both hands in the answer, the larger;
        "squeeze measured [N]": mean normal force of the hands in the simulation;
        "slip [m]": how far a hand is from where it took hold of the box, the larger; "friction used": largest |f_xy|
        / (mu f_z);
        "largest torque [N m]", "torque violation [N m]": of what was sent; "holding": 1 where no answer could be used.

    Args:
        duration: s. period: s between two solves. substeps: simulation steps in one.
        mass: kg, of the box. friction: > 0. squeeze: N, of each hand; half as much again later. push: N, along x at the box for
            0.1 s. torque: N m, the limit of each joint. acceleration: rad/s^2, of the joint box.

    Seeds other than 0 vary mass (told to the controller), squeeze and push by a tenth.

    Raises:
        SettingError: a setting out of its range.
    """

    name: ClassVar[str] = "dual_arm_carry"
    question: ClassVar[str] = (
        "Two arms carry a box by friction: who keeps hold of it, on its path, with the internal force as a level of its own?"
    )
    cannot_tell: ClassVar[tuple[str, ...]] = (
        "The controller knows the box's mass, inertia and place and the friction exactly, and torques are what is commanded.",
        "MuJoCo's contact is a stiff spring with creep: slip below a millimetre is its own.",
        "Link masses and inertias of the arms are chosen; the paper gives none.",
        "Solvers that take no hard rows refuse, and are not in the tables.",
    )
    abscissa: ClassVar[str] = "time (s)"
    by_default: ClassVar[bool] = False

    duration: float = _END
    period: float = 0.004
    substeps: int = 8
    mass: float = 3.0
    friction: float = 0.8
    squeeze: float = 40.0
    push: float = 15.0
    torque: float = 80.0
    acceleration: float = 100.0

    def __post_init__(self) -> None:
        for name in ("duration", "period", "mass", "friction", "squeeze", "torque", "acceleration"):
            value = getattr(self, name)
            if not isinstance(value, int | float) or isinstance(value, bool) or not 0.0 < value < math.inf:
                raise SettingError(f"{name} of {self.name} is {value!r}; it must be a finite number > 0.")
        if not isinstance(self.push, int | float) or isinstance(self.push, bool) or not math.isfinite(self.push):
            raise SettingError(f"push of {self.name} is {self.push!r}; it must be a finite number.")
        if isinstance(self.substeps, bool) or not isinstance(self.substeps, int) or self.substeps < 1:
            raise SettingError(f"substeps of {self.name} is {self.substeps!r}; it must be an integer of at least 1.")
        if self.duration < 2.0 * self.period:
            raise SettingError(
                f"duration is {self.duration:g} s, period is {self.period:g} s; a run needs at least two periods."
            )

    @property
    def commands_torques(self) -> bool:
        return True

    def periods(self) -> int:
        """Number of control periods."""
        return max(2, round(self.duration / self.period))

    def length(self) -> int:
        return self.periods()

    def quick(self) -> Self:
        """Control periods twice as long, on the same simulation steps."""
        return dataclasses.replace(
            self, period=2.0 * self.period, substeps=2 * self.substeps, duration=max(self.duration, 4.0 * self.period)
        )

    def robot(self, mass: float | None = None) -> MujocoRobot:
        """Both arms with motors, at the sides of the box, which stands on a table."""
        import mujoco

        from hqp_rp.robot.mujoco_robot import MujocoRobot

        arm = sawyer()
        spec = dual_arm_spec(arm)
        for actuator in list(spec.actuators):
            spec.delete(actuator)
        for joint in spec.joints:
            joint.damping = [0.0, 0.0, 0.0]
        for body in spec.bodies:
            body.gravcomp = 0.0
        for geom in spec.geoms:
            geom.contype = geom.conaffinity = 0
        spec.option.timestep = self.period / self.substeps
        spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10.0
        touching: dict[str, Any] = {"friction": [self.friction, 0.005, 1e-4], "solref": [0.004, 1.0]}
        for side in SIDES:
            site = spec.site(f"{side}_tool")
            spec.body(f"{side}_{arm.links[-1].name}").add_geom(
                name=f"{side} pad",
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=[_PAD, _PAD, 0.005],
                pos=np.array(site.pos) - _turned(site.quat, [0.0, 0.0, 0.005]),
                quat=site.quat,
                mass=0.0,
                contype=2,
                conaffinity=4,
                **touching,
            )
        box = spec.worldbody.add_body(name="box", pos=list(_MIDDLE))
        box.add_freejoint(name="box")
        box.add_geom(
            name="box",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=list(_BOX),
            mass=self.mass if mass is None else mass,
            contype=4,
            conaffinity=2,
            **touching,
        )
        spec.worldbody.add_geom(
            name="table",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[0.2, 0.1, 0.02],
            pos=[_MIDDLE[0], 0.0, _MIDDLE[2] - _BOX[2] - 0.02],
            contype=4,
            conaffinity=4,
            **touching,
        )
        limit = (*arm.velocity_limit, *arm.velocity_limit, *([math.inf] * 6))
        q = (*_START, *_MIDDLE, 1.0, 0.0, 0.0, 0.0)
        return MujocoRobot.from_spec(spec, velocity_limit=limit, neutral=q)

    def steps(self, solver: Solver, seed: int) -> Iterator[Step]:
        import mujoco

        run = _Run(self, seed)
        robot, model, data = run.robot, run.robot.model, run.robot.data
        run.refer(0.0)
        refusal = refused_step(solver, run.stack.problem(robot, self.period, np.zeros(robot.nv)))
        if refusal is not None:
            yield refusal
            return
        controller = TorqueController(run.stack, solver)
        solver.reset()
        box = model.body("box").id
        for k in range(self.periods()):
            t = k * self.period
            robot.update(data.qpos)
            run.refer(t)
            command = controller.step(robot, self.period, np.array(data.qvel))
            if command.problem is None or command.solution is None:
                return
            data.qfrc_applied[:] = 0.0
            data.qfrc_applied[:14] = command.torque
            data.xfrc_applied[box, 0] = run.push(t)
            mujoco.mj_step(model, data, self.substeps)
            robot.update(data.qpos)
            run.refer(t + self.period)
            yield Step("", t, command.problem, command.solution, command.solve_time, run.measured(command, data))


class _Run:
    """The stack on the arms and the box, its references in time, and what is measured."""

    def __init__(self, scenario: DualArmCarry, seed: int) -> None:
        self.scenario = scenario
        scale = 1.0 + 0.1 * np.random.default_rng(seed).normal(size=3) if seed else np.ones(3)
        self.robot = robot = scenario.robot(scenario.mass * float(scale[0]))
        self._squeeze, self._push = scenario.squeeze * float(scale[1]), scenario.push * float(scale[2])
        robot.update(robot.neutral)
        corners = [[x, y, 0.0] for x in (-_PAD, _PAD) for y in (-_PAD, _PAD)]
        self.contacts = [
            Contact(
                f"{side}_tool",
                points=corners,
                on="box",
                normal=(0.0, sign, 0.0),
                friction=scenario.friction,
                max_force=500.0,
            )
            for side, sign in zip(SIDES, (1.0, -1.0), strict=True)
        ]
        self._start = robot.pose("box")
        self._held: list[Any] | None = None
        self.box = PoseTask("box", self._start, gain=8.0, name="box")
        self.squeeze = ContactForceTask(self.contacts, axes="z", weight=0.1, name="squeeze")
        even = ContactForceTask(self.contacts, each=True, axes="xy", weight=0.1, name="even")
        posture = PostureTask(robot.neutral, joints=range(14), gain=2.0)
        most = np.concatenate([np.full(14, scenario.acceleration), np.full(6, np.inf)])
        self.stack = TorqueStack(
            [self.box, self.squeeze, [posture, even]],
            [JointLimit(acceleration=most)],
            contacts=self.contacts,
            torque=scenario.torque,
            names=["box", "squeeze", "posture"],
        )
        robot.data.qpos[:] = robot.neutral
        self._target = 0.0

    def refer(self, t: float) -> None:
        """Write the references of the time t, s, into the tasks."""
        s = t * _END / self.scenario.duration
        hold, held, lift, up, shift, shifted, more, there, _, _ = _PHASES
        force = self._squeeze * (float(ramp(s, hold, held)) + 0.5 * float(ramp(s, more, there)))
        self._target = force
        self.squeeze.target = [0.0, 0.0, force]
        part, height = float(ramp(s, shift, shifted)), float(ramp(s, lift, up))
        R, p = self._start
        turn = turned_about(np.array([0.0, 0.0, 1.0]), np.array([0.25 * part]))[0]
        self.box.target = turn @ R, p + np.array([-0.05 * part, 0.08 * part, 0.15 * height])
        scale = _END / self.scenario.duration
        shifting, lifting = (_rates(s, ends, scale) for ends in ((shift, shifted), (lift, up)))
        self.box.feedforward, self.box.feedforward_acceleration = (
            np.array([-0.05 * a, 0.08 * a, 0.15 * b, 0.0, 0.0, 0.25 * a])
            for a, b in zip(shifting, lifting, strict=True)
        )

    def push(self, t: float) -> float:
        """N, along x at the box."""
        s = t * _END / self.scenario.duration
        return self._push if _PHASES[8] <= s < _PHASES[9] else 0.0

    def measured(self, command: TorqueCommand, data: Any) -> dict[str, float]:
        """What happened in the period, at its end."""
        robot, limit = self.robot, self.scenario.torque
        R, p = robot.pose("box")
        hands = [R.T @ (robot.pose(contact.frame)[1] - p) for contact in self.contacts]
        if self._held is None:
            self._held = hands
        error = self.box.error(robot)
        forces = self._forces(data)
        found = {
            "box position error [m]": float(np.linalg.norm(error[:3])),
            "box orientation error [rad]": float(np.linalg.norm(error[3:])),
            "squeeze measured [N]": float(np.mean([force[0] for force in forces])),
            "slip [m]": max(float(np.linalg.norm(now - then)) for now, then in zip(hands, self._held, strict=True)),
            "friction used": max(
                (math.hypot(f[1], f[2]) / (self.scenario.friction * f[0]) for f in forces if f[0] > 1.0), default=0.0
            ),
            "largest torque [N m]": float(np.abs(command.torque).max()),
            "torque violation [N m]": max(0.0, float(np.abs(command.torque).max()) - limit),
            "holding": float(command.mode is not Mode.RUNNING),
        }
        if command.forces is not None:
            normal = command.forces.reshape(2, 4, 3)[:, :, 2].sum(axis=1)
            found["squeeze error [N]"] = float(np.abs(normal - self._target).max())
        return found

    def _forces(self, data: Any) -> list[tuple[float, float, float]]:
        """Of each hand its normal force on the box and the two along it, N, as MuJoCo has them."""
        import mujoco

        model, found, force = self.robot.model, [], np.zeros(6)
        for side in SIDES:
            pad, total = model.geom(f"{side} pad").id, np.zeros(3)
            for i in range(data.ncon):
                if pad in data.contact[i].geom:
                    mujoco.mj_contactForce(model, data, i, force)
                    total += data.contact[i].frame.reshape(3, 3).T @ force[:3]
            normal = self.robot.pose("box")[0][:, 1]
            along = float(total @ normal)
            across = total - along * normal
            found.append((abs(along), float(np.linalg.norm(across)), 0.0))
        return found


def _rates(s: float, ends: tuple[float, float], scale: float) -> tuple[float, float]:
    """First and second derivative in 1/s and 1/s^2 of `ramp(s, *ends)`, 3 u^2 - 2 u^3, for s running `scale` times as fast."""
    width = ends[1] - ends[0]
    u, rate = (s - ends[0]) / width, scale / width
    return (6.0 * u * (1.0 - u) * rate, 6.0 * (1.0 - 2.0 * u) * rate**2) if 0.0 < u < 1.0 else (0.0, 0.0)


def _turned(quaternion: Any, vector: Any) -> np.ndarray:
    import mujoco

    out = np.zeros(3)
    mujoco.mju_rotVecQuat(out, np.array(vector, dtype=np.float64), np.array(quaternion, dtype=np.float64))
    return out
