"""A humanoid under torques: stands, reaches beyond its balance, is pushed, lifts a foot. Who keeps feet and balance?"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from hqp_rp.control.activation import BlendedSolution, ramp
from hqp_rp.control.center_of_mass_task import CenterOfMassTask
from hqp_rp.control.command import Mode
from hqp_rp.control.contact import Contact
from hqp_rp.control.contact_force_task import ContactForceTask
from hqp_rp.control.joint_limit import JointLimit
from hqp_rp.control.orientation_task import OrientationTask
from hqp_rp.control.pose_task import PoseTask
from hqp_rp.control.position_task import PositionTask
from hqp_rp.control.posture_task import PostureTask
from hqp_rp.control.torque_controller import TorqueCommand, TorqueController
from hqp_rp.control.torque_stack import TorqueStack
from hqp_rp.core.damping import ErrorDamping
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.solver import Solver
from hqp_rp.scenarios.humanoid_reach import in_stance, jvrc_efforts, jvrc_spec
from hqp_rp.scenarios.scenario import Scenario, Step, refused_step

if TYPE_CHECKING:
    from hqp_rp.robot.mujoco_robot import MujocoRobot

_RIGHT, _LEFT, _HAND, _TORSO = "r_ankle", "l_ankle", "r_wrist", "base_link"
_SOLE = (0.11, 0.06, 0.02)
"""m, half sizes of the box under each ankle: JVRC-1's URDF has meshes alone; the box is about as large."""
_PLACE = (0.03, 0.0, -0.08)
_ANKLE = -_PLACE[2] + _SOLE[2]
"""m, how high the ankles are when the soles stand."""
_PHASES = (0.5, 1.5, 2.0, 3.0, 3.2, 3.3, 3.8, 4.3, 4.5, 5.0, 5.5, 5.7, 6.2)
"""s of 6.5: reach begins, is out, goes back, is back; push begins, ends; weight to the left begins, is there; right foot open,
highest, down; closed; weight in the middle again."""
_END = 6.5


@dataclasses.dataclass(frozen=True, kw_only=True)
class HumanoidStandReach(Scenario):
    """JVRC-1 (32 joints on a floating base) on two soles with friction, its torques from a `TorqueStack` of six levels.

    ::

        1  contacts       soles that are closed stay where they are
        2  balance        centre of mass over the middle of what stands, x and y
        3  swing foot     pose of the right ankle: where it stands, and its path while it is lifted
        4  hand           the right wrist follows its target
        5  torso          upright
        6  posture        the joints return to the stance; contact forces small and even

    Hard: the equation of motion of the base, torques within the URDF's limits, friction and unilaterality at the eight corners,
    and joint positions, velocities and accelerations in one box. In 6.5 s (or `duration`) the robot stands, reaches `reach` m
    forward and beyond what balance allows, comes back, is pushed at the pelvis, shifts its weight to the left foot, lifts the
    right one and sets it down. What MuJoCo makes of the torques is what happens; the controller knows the model, the state and
    which contacts are meant to be closed, and not the push. A refusal is yielded, with nothing measured, and ends the run.

    While a foot comes or goes, the torques are a blend of two answers; the one that weighs more is the step's problem and
    solution, and the solve time is that of both.

    `Step.measured`, of the period that follows the problem:

        "slip [m]": how far a closed sole is from where it was closed, the larger; "tilt [rad]": of the pelvis from upright;
        "balance error [m]", "foot error [m, rad]", "hand error [m]", "torso error [rad]";
        "largest torque [N m]", "torque violation [N m]": beyond the limits, of what was sent;
        "friction used": largest |f_xy| / (mu f_z) of a sole in the simulation, where it is loaded by more than 20 N;
        "holding": 1 where no answer could be used and gravity was compensated; "height [m]": of the pelvis.

    Args:
        duration: s. period: s between two solves. substeps: simulation steps in one.
        friction: of floor and controller alike, > 0. reach: m. push: N, forwards at the pelvis for 0.1 s.
        acceleration: rad/s^2, of the joint box. hand_damping: c >= 0, m s^2, of `ErrorDamping(c, power=1)` of the hand's level,
            0 for none: a target out of reach is one that a strict level throws the robot over for.

    Seeds other than 0 turn the push by a random angle and vary reach and push by a tenth.

    Raises:
        SettingError: a setting out of its range. MissingExtraError: jvrc-description is not installed.
    """

    name: ClassVar[str] = "humanoid_stand_reach"
    question: ClassVar[str] = (
        "A humanoid under torques stands, reaches beyond its balance, is pushed and lifts a foot: who keeps its feet, its "
        "balance and its limits, and in what time?"
    )
    cannot_tell: ClassVar[tuple[str, ...]] = (
        "The controller knows masses, inertias, friction and the state exactly, without delay or noise, and "
        "torques are what is commanded.",
        "The soles are boxes and MuJoCo's contact is a stiff spring, not rigid; slip below a millimetre is its creep.",
        "One motion with one set of gains. Each solver is judged on the motion that it leads to.",
        "Solvers that take no hard rows refuse, and are not in the tables.",
    )
    abscissa: ClassVar[str] = "time (s)"
    by_default: ClassVar[bool] = False

    duration: float = _END
    period: float = 0.004
    substeps: int = 4
    friction: float = 0.7
    reach: float = 0.9
    push: float = 80.0
    acceleration: float = 150.0
    hand_damping: float = 0.003

    def __post_init__(self) -> None:
        for name in ("duration", "period", "friction", "acceleration"):
            value = getattr(self, name)
            if not isinstance(value, int | float) or isinstance(value, bool) or not 0.0 < value < math.inf:
                raise SettingError(f"{name} of {self.name} is {value!r}; it must be a finite number > 0.")
        for name in ("reach", "push", "hand_damping"):
            value = getattr(self, name)
            if not isinstance(value, int | float) or isinstance(value, bool) or not math.isfinite(value):
                raise SettingError(f"{name} of {self.name} is {value!r}; it must be a finite number.")
        if self.hand_damping < 0.0:
            raise SettingError(f"hand_damping of {self.name} is {self.hand_damping!r}; it must be >= 0.")
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
        """Control periods twice as long, on the same simulation steps, up to the push."""
        return dataclasses.replace(
            self,
            period=2.0 * self.period,
            substeps=2 * self.substeps,
            duration=max(0.55 * self.duration, 4.0 * self.period),
        )

    def check(self) -> None:
        jvrc_spec()

    def robot(self) -> MujocoRobot:
        """JVRC-1 in its stance, a box under each ankle, on a floor."""
        import mujoco

        spec, speed = jvrc_spec()
        spec.option.timestep = self.period / self.substeps
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        grip = [self.friction, 0.005, 1e-4]
        for geom in list(spec.geoms):
            geom.contype = geom.conaffinity = 0
        spec.worldbody.add_geom(
            name="floor",
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            size=[5.0, 5.0, 0.1],
            friction=grip,
            contype=1,
            conaffinity=2,
        )
        for ankle in (_RIGHT, _LEFT):
            spec.body(ankle).add_geom(
                name=f"{ankle} sole",
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=list(_SOLE),
                pos=list(_PLACE),
                mass=0.0,
                friction=grip,
                contype=2,
                conaffinity=1,
            )
        return in_stance(spec, speed, _ANKLE)

    def steps(self, solver: Solver, seed: int) -> Iterator[Step]:
        import mujoco

        run = _Run(self, self.robot(), seed)
        robot, model, data = run.robot, run.robot.model, run.robot.data
        run.refer(0.0)
        refusal = refused_step(solver, run.stack.problem(robot, self.period, np.zeros(robot.nv)))
        if refusal is not None:
            yield refusal
            return
        controller = TorqueController(run.stack, solver)
        solver.reset()
        pelvis = model.body("PELVIS_S").id
        for k in range(self.periods()):
            t = k * self.period
            robot.update(data.qpos)
            run.refer(t)
            command = controller.step(robot, self.period, np.array(data.qvel))
            if command.problem is None or command.solution is None:
                return
            data.qfrc_applied[:] = 0.0
            data.qfrc_applied[6:] = command.torque
            data.xfrc_applied[pelvis, :3] = run.push(t)
            mujoco.mj_step(model, data, self.substeps)
            robot.update(data.qpos)
            run.refer(t + self.period)
            measured = run.measured(command, data)
            problem, solution = command.problem, command.solution
            if isinstance(solution, BlendedSolution):  # each part answers a problem of its own; the blend answers none
                solution = max(solution.parts, key=lambda part: part[0])[1]
                problem = solution.problem
            yield Step("", t, problem, solution, command.solve_time, measured)


class _Run:
    """The stack on the robot, its references in time, and what is measured."""

    def __init__(self, scenario: HumanoidStandReach, robot: MujocoRobot, seed: int) -> None:
        self.scenario, self.robot = scenario, robot
        rng = np.random.default_rng(seed)
        scale, turn = (1.0 + 0.1 * rng.normal(size=2), rng.uniform(-math.pi, math.pi)) if seed else (np.ones(2), 0.0)
        self._reach = np.array([scenario.reach * scale[0], 0.1, 0.1])
        self._shove = scenario.push * scale[1] * np.array([math.cos(turn), math.sin(turn), 0.0])
        robot.update(robot.neutral)
        corners = np.array([[x, y, -_SOLE[2]] for x in (-_SOLE[0], _SOLE[0]) for y in (-_SOLE[1], _SOLE[1])])
        weight = float(robot.gravity()[2])
        self.contacts = [
            Contact(ankle, points=corners + _PLACE, friction=scenario.friction, max_force=weight)
            for ankle in (_RIGHT, _LEFT)
        ]
        self._soles = {ankle: robot.pose(ankle)[1] for ankle in (_RIGHT, _LEFT)}
        self._foot, self._wrist = robot.pose(_RIGHT), robot.pose(_HAND)[1]
        self._middle = 0.5 * (self._soles[_RIGHT] + self._soles[_LEFT]) + [_PLACE[0], 0.0, 0.0]
        self._left = self._soles[_LEFT] + [_PLACE[0], 0.0, 0.0]
        self.balance = CenterOfMassTask(self._middle, axes="xy", gain=6.0, name="balance")
        self.foot = PoseTask(_RIGHT, self._foot, gain=12.0, name="swing foot")
        self.hand = PositionTask(_HAND, self._wrist, gain=8.0, name="hand")
        self.torso = OrientationTask(_TORSO, robot.pose(_TORSO)[0], gain=6.0, name="torso")
        self.posture = PostureTask(robot.neutral, joints=range(6, robot.nv), gain=4.0)
        forces = ContactForceTask(self.contacts, each=True, weight=0.1, name="forces")
        most = np.concatenate([np.full(6, np.inf), np.full(robot.nv - 6, scenario.acceleration)])
        efforts = {name: value for name, value in jvrc_efforts().items() if name in robot.joint_names}
        self.limit = np.array([efforts.get(name, np.inf) for name in robot.joint_names[1:]])
        hand_damping = ErrorDamping(scenario.hand_damping, power=1) if scenario.hand_damping else None
        self.stack = TorqueStack(
            [self.balance, self.foot, self.hand, self.torso, [self.posture, forces]],
            [JointLimit(acceleration=most)],
            contacts=self.contacts,
            torque=efforts,
            names=["balance", "swing foot", "hand", "torso", "posture"],
            damping=[None, None, hand_damping, None, None],
        )
        robot.data.qpos[:] = robot.neutral
        self._was_open = False

    def refer(self, t: float) -> None:
        """Write the references of the time t, s, into tasks and contacts."""
        s = t * _END / self.scenario.duration
        out, away, back, home, _, _, shift, over, lifted, top, down, closed, middle = _PHASES
        part = float(ramp(s, out, away) - ramp(s, back, home))
        self.hand.target = self._wrist + part * self._reach
        across = float(ramp(s, shift, over) - ramp(s, closed, middle))
        self.balance.target = self._middle + across * (self._left - self._middle)
        height = 0.05 * float(ramp(s, lifted, top) - ramp(s, top, down))
        self.foot.target = self._foot[0], self._foot[1] + [0.0, 0.0, height]
        self.contacts[0].activation = float(np.clip(1.0 - ramp(s, over, lifted) + ramp(s, down, closed), 0.0, 1.0))
        is_open = self.contacts[0].activation < 1.0
        if self._was_open and not is_open:
            self._soles[_RIGHT] = self.robot.pose(_RIGHT)[1]
        self._was_open = is_open

    def push(self, t: float) -> FloatArray:
        """(3,) N at the pelvis."""
        s = t * _END / self.scenario.duration
        return self._shove if _PHASES[4] <= s < _PHASES[5] else np.zeros(3)

    def measured(self, command: TorqueCommand, data: Any) -> dict[str, float]:
        """What happened in the period, at its end."""
        robot = self.robot
        closed = [contact.frame for contact in self.contacts if contact.activation == 1.0]
        slip = max(float(np.linalg.norm(robot.pose(ankle)[1] - self._soles[ankle])) for ankle in closed)
        pelvis = robot.pose(_TORSO)[0]
        error: Callable[[Any], float] = lambda task: float(np.linalg.norm(task.error(robot)))  # noqa: E731
        return {
            "slip [m]": slip,
            "tilt [rad]": math.acos(max(-1.0, min(1.0, float(pelvis[2, 2])))),
            "balance error [m]": error(self.balance),
            "foot error [m, rad]": error(self.foot),
            "hand error [m]": error(self.hand),
            "torso error [rad]": error(self.torso),
            "largest torque [N m]": float(np.abs(command.torque).max()),
            "torque violation [N m]": max(0.0, float((np.abs(command.torque) - self.limit).max())),
            "friction used": self._friction_used(data),
            "holding": float(command.mode is not Mode.RUNNING),
            "height [m]": float(data.qpos[2]),
        }

    def _friction_used(self, data: Any) -> float:
        """The larger |f_xy| / (mu f_z) of the soles, as MuJoCo has it."""
        import mujoco

        model, used = self.robot.model, 0.0
        for ankle in (_RIGHT, _LEFT):
            sole, total, force = model.geom(f"{ankle} sole").id, np.zeros(3), np.zeros(6)
            for i in range(data.ncon):
                if sole in data.contact[i].geom:
                    mujoco.mj_contactForce(model, data, i, force)
                    sign = 1.0 if data.contact[i].geom[1] == sole else -1.0
                    total += sign * (data.contact[i].frame.reshape(3, 3).T @ force[:3])
            if total[2] > 20.0:
                used = max(used, float(np.hypot(total[0], total[1]) / (self.scenario.friction * total[2])))
        return used
