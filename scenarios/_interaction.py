"""What the force scenarios share: gains, starts, and the loop of controller, arm and walls, with what it measures."""

from __future__ import annotations

import abc
import dataclasses
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import ClassVar, Self

import numpy as np

from hqp_rp.control._rotations import rotation_log
from hqp_rp.control.interaction_controller import InteractionController
from hqp_rp.control.limit import VelocityLimit
from hqp_rp.control.reference import Reference
from hqp_rp.control.singularities import SingularConfiguration, search_singularities
from hqp_rp.control.stack import Stack
from hqp_rp.control.task import Task
from hqp_rp.control.torque_controller import TorqueController
from hqp_rp.control.torque_stack import TorqueStack
from hqp_rp.control.twist_task import TwistTask
from hqp_rp.control.wrench import WrenchSensor
from hqp_rp.core.diagnostics import norm
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.solution import Status
from hqp_rp.core.solver import Solver
from hqp_rp.robot.arms import sawyer
from hqp_rp.robot.dh import DHArm
from hqp_rp.robot.robot import Robot
from hqp_rp.scenarios._contact import ContactArm, Surface, Touch
from hqp_rp.scenarios.scenario import Scenario, Step, refused_step

PAPER, DAMPED = "paper's numbers", "well damped"
REGULAR, SINGULAR = "regular", "near singular"

INNER_LOOPS = ("velocity", "torque")
METRICS = ("none", "inertia")

LOWER_AXES = ("y", "z", "rx", "ry", "rz")
"""The second level of 5.1 and 5.2; the first is x."""

INERTIA = (15.0, 15.0, 15.0, 80.0, 80.0, 80.0)
"""kg, then kg m^2: the paper's M_d, 5.1."""
DAMPING = (150.0, 150.0, 150.0, 280.0, 280.0, 280.0)
"""N s/m, then N m s/rad: the paper's B_d, 5.1."""


@dataclasses.dataclass(frozen=True, slots=True)
class Gains:
    """M_d, B_d and K_d along x, y, z, rx, ry, rz: kg, N s/m, N/m, then the same for rotation."""

    M_d: FloatArray
    B_d: FloatArray
    K_d: FloatArray


@dataclasses.dataclass(frozen=True, slots=True)
class Case:
    """One variant: which gains, and where the arm starts.

    Attributes:
        gains: `PAPER` or `DAMPED`. place: `REGULAR` or `SINGULAR`. q: (n,) rad, the start.
        middle: (n,) rad, direction: (n,), axis: (3,): what a path of the scenario goes through, along which joint direction,
            and about or along which axis of the world; None where the scenario has no use for it.
    """

    gains: str
    place: str
    q: FloatArray
    middle: FloatArray | None = None
    direction: FloatArray | None = None
    axis: FloatArray | None = None

    @property
    def name(self) -> str:
        """What reports call the case."""
        return f"{self.gains}, {self.place}"


@dataclasses.dataclass(frozen=True, slots=True)
class Place:
    """A posture to start from, or a singular one to start beside.

    Attributes:
        name: `REGULAR` or `SINGULAR`. q: (n,) rad.
        approach: (n,) joint direction away from the singularity. direction: of the lower level's task, the one that is lost.
        distance: rad, along the approach, of the start.
    """

    name: str
    q: FloatArray
    approach: FloatArray | None = None
    direction: FloatArray | None = None
    distance: float = 0.0

    def start(self) -> FloatArray:
        """(n,) rad, where the arm starts."""
        return self.q if self.approach is None else self.q + self.distance * self.approach


@dataclasses.dataclass(frozen=True, slots=True)
class Experiment:
    """What a scenario puts on the arm in one case.

    Attributes:
        stack: the levels. update: sets the references to the time t, s; called before every step.
        desired: F_d of each wall's axis at t, N. errors: what else is measured at t and the robot's configuration.
    """

    stack: Stack
    update: Callable[[float], None]
    desired: Callable[[float], Mapping[str, float]]
    errors: Callable[[float, Robot], Mapping[str, float]]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Interaction(Scenario):
    """The Sawyer of Table 1 under velocity servos, its tool a ball, its force sensor exact, against walls.

    At every period the controller reads force, configuration and velocity, integrates the references (33)-(51), and the
    solver turns the levels into joint velocities. With the defaults the walls have no friction, the reading no delay, and no
    solver is told of a limit: a command that passes a joint's velocity limit is shortened as a whole. A solver that fails
    stops the arm (`InteractionController`), and the case ends.

    Four cases: two sets of gains at two starts.

    - "paper's numbers": M_d and B_d of 5.1. Where a law has a spring, the paper gives none: K_d = B_d^2 / (4 M_d), which
      makes the free motion critically damped.
    - "well damped": the same but for B_d on axes that meet a wall: B_d = 2 damping_ratio sqrt(M_d K_e). Against the wall
      the law itself, (37) without M_e and B_e, then has that damping ratio; the paper's numbers have 0.06 on 1e5 N/m. A
      practitioner would choose it so because the stiffness is known, and M_d stays as it is.
    - "regular": the arm's neutral posture. "near singular": where the lower levels are about to lose a direction beside
      the first one; see the scenario.

    Seed 0 has an exact sensor and starts as said. Every other seed starts off by a normal offset of standard deviation
    `spread` per joint, and each reading has normal noise of standard deviation `noise` per axis.

    Args:
        duration: s, of one case; rounded to whole periods. period: s between two solves. substeps: simulation steps in one.
        stiffness, wall_damping, wall_mass: K_e, B_e, M_e of `Surface`.
        damping_ratio: > 0, of the second set. noise: N, >= 0. spread: rad, >= 0.
        friction: >= 0, Coulomb coefficient of the walls. delay: s, >= 0, age of the force reading, rounded to whole steps of
            the simulation. servo: > 0, factor on the gains of the arm's velocity servos.
        hard_limits: the velocity limits are hard rows of the stack, for solvers that take them, and nothing is shortened.
        recovery: s, >= 0, the references' anti-windup, None for none; see `Reference`.
        inner_loop: what carries out the references. "velocity": as above. "torque": the law's accelerations are the levels of a
            `TorqueStack` and the arm has motors without friction: inverse dynamics, told the force reading, in the place of the
            servos; servo, hard_limits and recovery have no meaning then, no velocity is limited, and a solver that fails makes
            the arm hold against gravity.
        torque_limit: N m, > 0, at which each motor's torque is cut.
        metric: of the torque loop's stack: "inertia" for the dynamically consistent pseudo-inverse, or "none".

    `Step.parameter` is the time of the problem. `Step.measured`, for the period that follows it, with A for the axis of
    each wall:

        "force A [N]", "desired force A [N]": at the end of the period;
        "peak force A [N]": the largest at any simulation step; "contact A": share of the simulation steps in contact;
        "energy A [J]": work done on the wall since the start;
        "commanded speed [rad/s]": ||x|| as the solver asked; "measured speed [rad/s]": ||dq/dt||;
        "shortened to": the factor in [0, 1] that the velocity limits left of x;

    and position and orientation errors as the scenario says.

    Raises:
        SettingError: a setting out of its range.
    """

    by_default: ClassVar[bool] = False
    abscissa: ClassVar[str] = "time (s)"
    cannot_tell: ClassVar[tuple[str, ...]] = (
        "The wall is a spring with a little damping and mass, and only the tool's ball touches it.",
        "The velocity servos, link masses and inertias are chosen: the paper gives none, nor its control period.",
        "The force reading is the simulation's own, without filter or bias; seed 0 has no noise.",
        "Unless hard_limits is set, no solver is told of the velocity limits: a command that passes one is shortened as a "
        "whole, so that an answer that is too fast slows the force level too.",
        "Each solver is judged on the motion that it leads to; from the first differing answer on these differ.",
    )

    duration: float = 3.0
    period: float = 0.002
    substeps: int = 8
    stiffness: float = 1e5
    wall_damping: float = 10.0
    wall_mass: float = 0.01
    damping_ratio: float = 1.0
    noise: float = 0.2
    spread: float = 0.01
    friction: float = 0.0
    delay: float = 0.0
    servo: float = 1.0
    hard_limits: bool = False
    recovery: float | None = 0.05
    inner_loop: str = "velocity"
    metric: str = "none"
    torque_limit: float = 80.0

    def __post_init__(self) -> None:
        for name in ("duration", "period", "damping_ratio", "servo", "torque_limit"):
            self._require(name, lambda value: value > 0.0, "> 0")
        for name in ("noise", "spread", "delay", *(("recovery",) if self.recovery is not None else ())):
            self._require(name, lambda value: value >= 0.0, ">= 0")
        for name, allowed in (("inner_loop", INNER_LOOPS), ("metric", METRICS)):
            if getattr(self, name) not in allowed:
                raise SettingError(
                    f"{name} of {self.name} is {getattr(self, name)!r}; it must be one of {', '.join(allowed)}."
                )
        if not isinstance(self.hard_limits, bool):
            raise SettingError(f"hard_limits of {self.name} is {self.hard_limits!r}; it must be True or False.")
        if isinstance(self.substeps, bool) or not isinstance(self.substeps, int) or self.substeps < 1:
            raise SettingError(f"substeps of {self.name} is {self.substeps!r}; it must be an integer of at least 1.")
        if self.duration < 2.0 * self.period:
            raise SettingError(
                f"duration is {self.duration:g} s, period is {self.period:g} s; a run needs at least two periods."
            )
        self.surface()

    @property
    def commands_torques(self) -> bool:
        return self.inner_loop == "torque"

    @abc.abstractmethod
    def cases(self) -> tuple[Case, ...]:
        """The cases, in the order in which they are run."""

    @abc.abstractmethod
    def walls(self, case: Case, position: FloatArray) -> Mapping[str, float]:
        """Axis -> where the ball's centre touches, m, from where it starts, (3,)."""

    @abc.abstractmethod
    def experiment(self, case: Case, robot: Robot) -> Experiment:
        """The levels and references, for a robot at its start."""

    def case_at(self, gains: str, place: Place) -> Case:
        """The case with these gains that starts at another posture; `place` comes from the study that varies them."""
        return Case(gains, place.name, place.start())

    def turned(self) -> float:
        """rad, by which the axes of the walls are turned about the world's z."""
        return 0.0

    def push(self, t: float) -> FloatArray | None:
        """(6,) what somebody does to the tool at t: force in N and torque in N m about it, world axes; None for nothing."""
        return None

    def arm(self) -> DHArm:
        """The arm that is simulated."""
        arm = sawyer()
        if self.servo == 1.0:
            return arm
        return dataclasses.replace(arm, servo_gain=tuple(self.servo * gain for gain in arm.servo_gain))

    def surface(self) -> Surface:
        """What the walls are made of."""
        return Surface(self.stiffness, self.wall_damping, self.wall_mass, self.friction)

    def stack(self, *levels: Task) -> Stack:
        """These levels, above the velocity limits as hard rows where `hard_limits` asks for them."""
        return Stack(levels, limits=[VelocityLimit()] if self.hard_limits else [])

    def gains(self, case: Case, walled: str) -> Gains:
        """M_d, B_d, K_d of a case; `walled` are the axes that meet a wall, "xy"."""
        M, B = np.array(INERTIA), np.array(DAMPING)
        K = B**2 / (4.0 * M)
        if case.gains == DAMPED:
            for axis in walled:
                i = "xyz".index(axis)
                B[i] = 2.0 * self.damping_ratio * math.sqrt(M[i] * self.stiffness)
        return Gains(M, B, K)

    def periods(self) -> int:
        """Number of control periods of one case."""
        return max(2, round(self.duration / self.period))

    def length(self) -> int:
        return len(self.cases()) * self.periods()

    def quick(self) -> Self:
        """A sixth of the duration, on simulation steps twice as long: too short to settle."""
        return dataclasses.replace(
            self, duration=max(self.duration / 6.0, 2.0 * self.period), substeps=max(1, self.substeps // 2)
        )

    def contact_arm(self, case: Case, seed: int = 0) -> ContactArm:
        """The arm at the start of a case, with its walls."""
        arm, timestep = self.arm(), self.period / self.substeps
        offset = np.random.default_rng((seed, 1)).normal(scale=self.spread if seed else 0.0, size=arm.n)
        q = case.q + offset
        late = round(self.delay / timestep)
        walls = self.walls(case, arm.pose(q, "tool")[1])
        contact = ContactArm(
            arm, timestep, walls, self.surface(), delay=late, tilt=self.turned(), torques=self.inner_loop == "torque"
        )
        contact.reset(q)
        contact.robot.update(q)
        return contact

    def steps(self, solver: Solver, seed: int) -> Iterator[Step]:
        for case in self.cases():
            for step in self.run_case(case, self.contact_arm(case, seed), solver, seed):
                yield step
                if step.solution.status is Status.REFUSED:
                    return

    def run_case(self, case: Case, contact: ContactArm, solver: Solver, seed: int) -> Iterator[Step]:
        """The steps of one case on an arm at its start; between two steps the simulation may be looked at."""
        robot, data = contact.robot, contact.robot.data
        experiment = self.experiment(case, robot)
        sensor = WrenchSensor("tool", measures="on_environment", expressed_in="world", frozen_after=None)
        if self.inner_loop == "torque":
            yield from self._run_torques(case, contact, solver, seed, experiment, sensor)
            return
        shortened_into = () if self.hard_limits else (VelocityLimit(),)
        refusal = self._refusal(case, contact, solver, experiment, experiment.stack)
        if refusal is not None:
            yield refusal
            return
        controller = InteractionController(experiment.stack, sensor, solver, scale_into=shortened_into)
        controller.start(robot, data.qvel)
        rng = np.random.default_rng((seed, 2))
        energy = dict.fromkeys(experiment.desired(0.0), 0.0)
        for k in range(self.periods()):
            t, end = k * self.period, (k + 1) * self.period
            experiment.update(t)
            robot.update(data.qpos)
            reading = self._reading(contact, t, rng if seed else None)
            command = controller.step(robot, reading, self.period, data.qvel)
            touch = contact.advance(command.v, self.substeps)
            if command.problem is None or command.solution is None:
                return
            robot.update(data.qpos)
            measured = _touched(experiment, touch, energy, end)
            measured.update(experiment.errors(end, robot))
            x = command.solution.x
            measured["commanded speed [rad/s]"] = 0.0 if x is None else norm(x)
            measured["measured speed [rad/s]"] = norm(data.qvel)
            measured["shortened to"] = command.scale
            yield Step(case.name, t, command.problem, command.solution, command.solve_time, measured)

    def _refusal(
        self, case: Case, contact: ContactArm, solver: Solver, experiment: Experiment, stack: Stack | TorqueStack
    ) -> Step | None:
        """The only step of a case whose solver refuses the stack; None where it takes it."""
        robot, v = contact.robot, np.array(contact.robot.data.qvel)
        robot.update(contact.robot.data.qpos)
        experiment.update(0.0)
        for item in itertools.chain(*experiment.stack.levels):
            if isinstance(item, Reference):
                item.start(robot, v)
        return refused_step(solver, stack.problem(robot, self.period, v, np.zeros(robot.nv)), case.name)

    def _reading(self, contact: ContactArm, t: float, rng: np.random.Generator | None) -> FloatArray:
        """(6,) what the sensor says at t; somebody's push begins."""
        reading = contact.reading()
        push = self.push(t)
        if push is not None:
            contact.push(push)
            reading -= push
        if rng is not None:
            reading[:3] += rng.normal(scale=self.noise, size=3)
        return reading

    def _run_torques(
        self,
        case: Case,
        contact: ContactArm,
        solver: Solver,
        seed: int,
        experiment: Experiment,
        sensor: WrenchSensor,
    ) -> Iterator[Step]:
        robot, data = contact.robot, contact.robot.data
        levels = [list(level) for level in experiment.stack.levels]
        references = [item for level in levels for item in level if isinstance(item, Reference)]
        stack = TorqueStack(levels, metric=None if self.metric == "none" else self.metric)
        refusal = self._refusal(case, contact, solver, experiment, stack)
        if refusal is not None:
            yield refusal
            return
        controller = TorqueController(stack, solver)
        rng = np.random.default_rng((seed, 2))
        energy = dict.fromkeys(experiment.desired(0.0), 0.0)
        solver.reset()
        for k in range(self.periods()):
            t, end = k * self.period, (k + 1) * self.period
            experiment.update(t)
            robot.update(data.qpos)
            reading = self._reading(contact, t, rng if seed else None)
            v = np.array(data.qvel)
            wrench = sensor.read(robot, reading, self.period)
            assert wrench is not None  # the reading is finite and fresh
            for reference in references:
                reference.accelerate(robot, wrench, v)
            command = controller.step(robot, self.period, v, applied=-robot.jacobian("tool").T @ reading)
            # The joints compensate the weight of the links themselves.
            torque = np.clip(command.torque, -self.torque_limit, self.torque_limit)
            touch = contact.drive(torque - robot.gravity(), self.substeps)
            if command.problem is None or command.solution is None:
                return
            robot.update(data.qpos)
            measured = _touched(experiment, touch, energy, end)
            measured.update(experiment.errors(end, robot))
            x = command.solution.x
            measured["commanded acceleration [rad/s^2]"] = 0.0 if x is None else norm(x)
            measured["commanded speed [rad/s]"] = 0.0 if x is None else norm(v + self.period * x)
            measured["shortened to"] = 1.0
            measured["measured speed [rad/s]"] = norm(data.qvel)
            measured["largest torque [N m]"] = float(np.abs(command.torque).max())
            yield Step(case.name, t, command.problem, command.solution, command.solve_time, measured)

    def _require(self, name: str, allowed: Callable[[float], bool], sign: str) -> None:
        value = getattr(self, name)
        number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        if not number or not allowed(value):
            raise SettingError(f"{name} of {self.name} is {value!r}; it must be a finite number {sign}.")


def _touched(experiment: Experiment, touch: Touch, energy: dict[str, float], end: float) -> dict[str, float]:
    """What the walls have to say of a period that ends at `end`; the energy goes on."""
    measured: dict[str, float] = {}
    for axis, desired in experiment.desired(end).items():
        energy[axis] += touch.energy[axis]
        measured[f"force {axis} [N]"] = touch.force[axis]
        measured[f"desired force {axis} [N]"] = desired
        measured[f"peak force {axis} [N]"] = touch.peak[axis]
        measured[f"contact {axis}"] = touch.share[axis]
        measured[f"energy {axis} [J]"] = energy[axis]
    return measured


# What `find_start()` returns: q and approach of a singular configuration, rad.
_SINGULAR = (
    0.4683577852020258,
    -2.1575718220403344,
    1.9760827226142124,
    -1.064097034832635,
    1.7075379247664757,
    0.19660215245172266,
    1.9076044064373974,
)
_APPROACH = (
    0.0,
    -0.13936644702870618,
    0.23911061319208116,
    0.6137932799961336,
    -0.614085203707955,
    -0.4117769786183404,
    0.0,
)
_DISTANCE = 0.1
"""rad, how far along the approach the arm starts: the smallest singular value of the lower level beside the first is
0.013 there, of 1.6 the largest and 0.32 the next."""


def first_axis_cases() -> tuple[Case, ...]:
    """Both gains at the neutral posture and near the singularity of `find_start`, for X first and everything else second."""
    near = np.array(_SINGULAR) + _DISTANCE * np.array(_APPROACH)
    places = ((REGULAR, np.array(sawyer().neutral)), (SINGULAR, near))
    return tuple(Case(gains, place, q) for gains in (PAPER, DAMPED) for place, q in places)


def find_start(
    lower_axes: Sequence[str] = LOWER_AXES, *, starts: int = 64, seed: int = 0, margin: float = 0.6
) -> SingularConfiguration:
    """The search behind the cases "near singular": where these axes of the tool lose a direction beside x.

    Of the algorithmic singularities (12) of the two levels, x and `lower_axes`, that are at least `margin` rad from every
    joint limit, the one farthest from any kinematic singularity: the largest min(own_sigma, earlier_sigma). With the
    defaults it remakes the constants of this file. Raises `SettingError` when these starts find none.
    """
    from hqp_rp.robot.mujoco_robot import MujocoRobot

    arm = sawyer()
    stack = Stack([TwistTask("tool", axes=("x",)), TwistTask("tool", axes=lower_axes)])
    found = search_singularities(MujocoRobot.from_arm(arm), stack, level=1, starts=starts, seed=seed)
    inside = [
        place for place in found if np.minimum(place.q - arm.lower, np.subtract(arm.upper, place.q)).min() >= margin
    ]
    if not inside:
        raise SettingError(f"starts is {starts!r}, margin is {margin!r}: these find no singularity; give more starts.")
    return max(inside, key=lambda place: min(place.own_sigma, place.earlier_sigma))


def turn(R: FloatArray, R_desired: FloatArray) -> float:
    """rad, the angle between two orientations (3, 3)."""
    return norm(rotation_log(R @ R_desired.T))


def pose_errors(robot: Robot, desired: tuple[FloatArray, FloatArray], axes: str) -> dict[str, float]:
    """The tool against a desired pose (R, p): m along some of "xyz", and the angle between the orientations, rad."""
    R, p = robot.pose("tool")
    errors = {f"position error {axis} [m]": float((p - desired[1])["xyz".index(axis)]) for axis in axes}
    return errors | {"orientation error [rad]": turn(R, desired[0])}
