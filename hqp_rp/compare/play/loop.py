"""The loop behind the page: one or two solvers that follow the same targets, and what they did at every step. No page."""

from __future__ import annotations

import copy
import dataclasses

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.compare.play.arm import Arm, ArmState
from hqp_rp.compare.play.recording import Recorder, Recording
from hqp_rp.compare.play.targets import Target, quaternion_of, rest_where_it_is, targets_of
from hqp_rp.control._checks import finite_vector, positive_number
from hqp_rp.control.catalogue import Catalogue, find_singularities
from hqp_rp.control.singularities import SingularConfiguration
from hqp_rp.control.stack import Stack
from hqp_rp.control.stack_file import StackFile
from hqp_rp.core.damping import LevelDamping
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray
from hqp_rp.core.solver import Solver, get_solver
from hqp_rp.robot.mujoco_robot import MujocoRobot
from hqp_rp.robot.robot_source import RobotSource

DT = 0.01
"""s, the control period where the stack file says none."""


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Step:
    """What happened at one step.

    Attributes:
        time: s since the loop began. arms: what each solver did, the first one's ghost after it.
        targets: (h, 7) position in m and quaternion (w, x, y, z) of each target; nan in the half that a target does not have.
        driving: whether the arms are on their way to a configuration, and not moved by their solvers.
    """

    time: float
    arms: tuple[ArmState, ...]
    targets: FloatArray
    driving: bool


class PlayLoop:
    """One or two solvers, each on a robot of its own, after the same targets; kinematics only. ::

        loop = PlayLoop(RobotSource("sawyer"), load_stack("sawyer"), "null_space", beside="reverse_priority")
        loop.drag(0, position=[0.8, 0.2, 0.4])
        step = loop.step()
        step.arms[0].error, step.arms[1].error

    At each step the stack's problem is stated at the robot's configuration, the solver answers, and the robot moves by
    the answer for `dt` seconds: shortened as a whole where a joint would go faster than its velocity limit (3 rad/s or
    m/s where the robot states none), and stopped at the joint limits. Where no answer comes the robot brakes, and the solver is
    asked again at the next step.

    Args:
        source: where the robot comes from; MuJoCo computes it.
        file: the stack. solver: a `Solver` or its name. beside: another, for a ghost that starts where the robot is; or None.
        dt: > 0, s, the control period; None takes the file's, or 0.01 s.

    Raises:
        SettingError: a stack without a target to drag, a dt that is not > 0, a robot that MuJoCo does not compute.
        HqpError: what the robot's file, the stack's file and the solver's name raise.
    """

    def __init__(
        self,
        source: RobotSource,
        file: StackFile,
        solver: str | Solver,
        *,
        beside: str | Solver | None = None,
        dt: float | None = None,
    ) -> None:
        self.source, self.file = source, file
        self._dt = positive_number(dt, "dt") if dt is not None else file.dt or DT
        robot = source.robot()
        if not isinstance(robot, MujocoRobot):
            raise SettingError(
                f"the robot is a {type(robot).__name__}; what is drawn is a MuJoCo model: leave library out."
            )
        self._robot = robot
        self._arms = [self._new_arm(get_solver(solver))]
        self._targets = targets_of(self._arms[0].stack)
        if not self._targets:
            raise SettingError(
                f"{file.origin} has no task with a target to drag; give it one of type position, orientation, pose or look_at."
            )
        self._time, self._goal, self._joint_limits = 0.0, None, False
        self._catalogue: Catalogue | None = None
        self._recorder: Recorder | None = None
        if beside is not None:
            self.compare_with(beside)

    _goal: FloatArray | None

    @property
    def dt(self) -> float:
        """s, the control period."""
        return self._dt

    @property
    def time(self) -> float:
        """s since the loop began."""
        return self._time

    @property
    def robot(self) -> MujocoRobot:
        """The model; each arm moves a copy."""
        return self._robot

    @property
    def arms(self) -> tuple[Arm, ...]:
        """The arm, and its ghost where two solvers are compared."""
        return tuple(self._arms)

    @property
    def targets(self) -> tuple[Target, ...]:
        """What can be dragged."""
        return self._targets

    @property
    def levels(self) -> tuple[str, ...]:
        """The names of the levels."""
        return self._arms[0].stack.names

    @property
    def catalogue(self) -> Catalogue | None:
        """The singularities found so far; None before they were searched for."""
        return self._catalogue

    @property
    def driving(self) -> bool:
        """Whether the arms are on their way to a configuration."""
        return self._goal is not None

    @property
    def recording(self) -> bool:
        """Whether steps are being recorded."""
        return self._recorder is not None and self._recorder.open

    def place(self, target: int) -> FloatArray:
        """(7,) position and quaternion (w, x, y, z) of a target; nan in the half that it does not have."""
        position, rotation = self._target(target).place(self._arms[0].stack)
        found = np.full(7, np.nan)
        if position is not None:
            found[:3] = position
        if rotation is not None:
            found[3:] = quaternion_of(rotation)
        return found

    def drag(self, target: int, position: ArrayLike | None = None, quaternion: ArrayLike | None = None) -> None:
        """Put a target to this position (3,), m, and quaternion (w, x, y, z); what is None stays. A drive ends there.

        Raises `SettingError` for a target that there is not, and for numbers that are none.
        """
        chosen = self._target(target)
        p = None if position is None else finite_vector(position, 3, "position", "m")
        r = None if quaternion is None else finite_vector(quaternion, 4, "quaternion", "any unit")
        if r is not None and not r.any():
            raise SettingError("quaternion is zero; it must have a direction.")
        self._goal = None
        for arm in self._arms:
            chosen.put(arm.stack, p, r)

    def choose(self, solver: str | Solver | None = None, damping: LevelDamping | None = None, *, arm: int = 0) -> None:
        """Let the arm (0) or its ghost (1) go on with this solver (None: the one it has) and this damping.

        damping: in place of the solver's own where it has one, otherwise at every level of its stack; None for what was given.

        Raises `SettingError` where the solver takes no such damping, or there is no such arm; all stays as it was.
        """
        if not 0 <= arm < len(self._arms):
            raise SettingError(f"arm is {arm!r}; there are {len(self._arms)}, counted from 0.")
        self._arms[arm].choose(None if solver is None else get_solver(solver), damping)

    def compare_with(self, solver: str | Solver | None, damping: LevelDamping | None = None) -> None:
        """Set a second solver beside the first, as a ghost that starts where the robot is now; None takes it away."""
        if solver is None:
            del self._arms[1:]
            return
        first = self._arms[0]
        ghost = self._new_arm(get_solver(solver))
        ghost.robot.update(first.robot.q)
        ghost.choose(None, damping, joint_limits=self._joint_limits)
        _copy_targets(first.stack, ghost.stack)
        self._arms[1:] = [ghost]

    def meet(self) -> None:
        """Put the ghost where the arm is."""
        for arm in self._arms[1:]:
            arm.robot.update(self._arms[0].robot.q)
            arm.rest()

    def hold_joint_limits(self, hold: bool, damping: tuple[LevelDamping | None, ...] = ()) -> None:
        """Whether the robot's joint limits are hard rows of the problem, or only stops that it runs into.

        damping: of each arm, as `choose` takes it.
        """
        self._joint_limits = hold
        for i, arm in enumerate(self._arms):
            arm.choose(None, damping[i] if i < len(damping) else None, joint_limits=hold)

    def find_singularities(self, starts: int = 16, seed: int = 0) -> Catalogue:
        """The atlas of the stack's singularities on a copy of the robot (`hqp_rp.find_singularities`), kept for `drive_to`."""
        robot = copy.copy(self._robot)
        self._catalogue = find_singularities(robot, self.file.stack(robot), starts=starts, seed=seed, dt=self._dt)
        return self._catalogue

    def drive_to(self, place: SingularConfiguration, sigma: float = 1e-3) -> None:
        """Drive all arms to a singular configuration, or up to where its singular value over ||A_k|| is `sigma`.

        Along a straight line in joint space, at the joints' speed limits; the targets go with the arm, and rest where it ends.

        Raises `SettingError` for a sigma outside [0, 1) and before `find_singularities`.
        """
        if not 0.0 <= sigma < 1.0:
            raise SettingError(f"sigma is {sigma!r}; it must be in [0, 1); 0 is the singular configuration itself.")
        if self._catalogue is None:
            raise SettingError("there is no atlas yet; call find_singularities first.")
        goal = place.q
        if sigma > 0.0 and place.approach_rate > 0.0:
            try:
                path = self._catalogue.approach(place, [sigma])
                goal = path.q[-1] if len(path) else goal
            except SettingError:  # sigma does not grow along the line: the place itself
                goal = place.q
        self._goal = goal

    def drive_home(self) -> None:
        """Drive all arms to the robot's neutral configuration."""
        self._goal = self._robot.neutral

    def step(self) -> Step:
        """One control period."""
        driving = self._goal is not None
        if self._goal is not None:
            self._drive(self._goal)
        states = tuple(arm.step(moving=not driving) for arm in self._arms)
        targets = np.array([self.place(i) for i in range(len(self._targets))])
        step = Step(self._time, states, targets, driving)
        if self._recorder is not None and self._recorder.open:
            self._recorder.add(step, tuple(arm.label for arm in self._arms))
        self._time += self._dt
        return step

    def record(self) -> None:
        """Begin a recording, in place of the last one."""
        self._recorder = Recorder(
            self.source, self.file.text, self.levels, tuple(t.name for t in self._targets), self._dt
        )

    def stop_recording(self) -> Recording:
        """End the recording and return it. Raises `SettingError` where nothing was recorded."""
        if self._recorder is None:
            raise SettingError("nothing is being recorded; call record first.")
        self._recorder.open = False
        return self._recorder.recording()

    def _new_arm(self, solver: Solver) -> Arm:
        robot = copy.copy(self._robot)  # the model is shared, the configuration is not
        return Arm(robot, self.file.stack(robot), solver, self._dt)

    def _target(self, target: int) -> Target:
        if not 0 <= target < len(self._targets):
            names = ", ".join(f"{i}: {one.name}" for i, one in enumerate(self._targets))
            raise SettingError(f"target is {target!r}; there are {names}.")
        return self._targets[target]

    def _drive(self, goal: FloatArray) -> None:
        """All arms one step nearer to goal (nq,), and their targets with them."""
        there = True
        for arm in self._arms:
            away = arm.robot.difference(arm.robot.q, goal)
            steps = float((np.abs(away) / (arm.fastest * self._dt)).max(initial=0.0))
            there = there and steps <= 1.0
            arm.robot.update(goal if steps <= 1.0 else arm.robot.integrate(arm.robot.q, away, 1.0 / steps))
            arm.rest()
        for arm in self._arms:
            rest_where_it_is(arm.stack, self._arms[0].robot)
        if there:
            self._goal = None


def _copy_targets(source: Stack, stack: Stack) -> None:
    """Give the tasks of `stack` the targets that those of `source` have; both come from one file."""
    for theirs, own in zip(source.levels, stack.levels, strict=True):
        for task, other in zip(theirs, own, strict=True):
            if hasattr(task, "target"):
                other.target = task.target
