"""The MuJoCo adapter: any MJCF or URDF file, any MjModel, and the arms of the library."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.core import _native
from hqp_rp.core.errors import RobotError
from hqp_rp.core.paths import user_path
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.coupling import couplings_of, limited_balls
from hqp_rp.robot.dh import DHArm
from hqp_rp.robot.distance import Distances, Side
from hqp_rp.robot.frames import (
    FrameTable,
    Point,
    checked_limit,
    checked_vector,
    frozen,
    require_joints,
    require_velocity,
)
from hqp_rp.robot.mesh_files import Meshes
from hqp_rp.robot.model_file import Path, file_format, one_line, urdf_effort_limits, urdf_velocity_limits
from hqp_rp.robot.mujoco_arm import arm_spec
from hqp_rp.robot.mujoco_file import mujoco_model
from hqp_rp.robot.mujoco_frames import MujocoFrames, kinematics_of
from hqp_rp.robot.mujoco_model import (
    effort_limits,
    geometry,
    keyframe,
    model_name,
    position_limits,
    quaternions,
    scalar_coordinates,
)
from hqp_rp.robot.mujoco_surroundings import MujocoSurroundings

# Below this squared norm MuJoCo silently takes a quaternion for the identity.
_MIN_SQUARE = float(mujoco.mjMINVAL) ** 2
_take_configuration, _kinematics = _native.take_configuration, mujoco.mj_kinematics
_velocities, _newton_euler = mujoco.mj_comVel, mujoco.mj_rne
_inertias, _full_inertia = mujoco.mj_makeM, mujoco.mj_fullM


class MujocoRobot(MujocoSurroundings):
    """A `Robot` computed by MuJoCo.

    Frames are the named bodies and sites; a name borne by both is asked for as "body:NAME" or "site:NAME". The world
    is the body "world". Configuration and velocity follow MuJoCo: a free joint has position and quaternion (w, x, y, z)
    in q, linear velocity in world axes and angular velocity in body axes in v; a ball joint has a quaternion in q.
    Quaternions need not be normalized, but must not be zero.

    `model` is the compiled model. `data` is a simulation state of its own, at `neutral` to begin with, for
    `mujoco.mj_step(robot.model, robot.data)`: `update` and the other methods neither read nor change it; they
    compute on a private state whose velocity is always zero.

    Every array returned is fresh, except `lower`, `upper`, `velocity_limit`, `neutral` and `q`, which are read-only.
    The centre of mass is that of the bodies that the robot moves; what is fixed to the world, or not actuated, does not count.

    A model may hold more than the robot. Mocap bodies are where `set_mocap` or `follow` puts them. A kinematic tree without
    an actuator in a model that has some (a box on the table, a door) is not the robot's to move: `unactuated` lists its
    velocities, a stack gives them none, and `unactuated_velocity` says how fast they move by themselves.

    Args:
        model: a compiled model.
        velocity_limit: what MJCF cannot say: one number, (nv,) numbers or a mapping by joint name; default infinite.
        neutral: (nq,) the reference configuration, or the name of a keyframe; default `model.qpos0`.
        unactuated: names of joints whose trees the robot does not drive, empty for none; by default as said above.

    Raises:
        RobotError: a limit or a configuration that does not fit the model, a keyframe or joint that it does not have.

    Warns:
        UserWarning: a neutral configuration outside the joint limits; ranges that look like degrees taken for radians, or
            the other way round.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        *,
        velocity_limit: ArrayLike | Mapping[str, float] | None = None,
        neutral: ArrayLike | str | None = None,
        unactuated: Sequence[str] | None = None,
    ) -> None:
        if not isinstance(model, mujoco.MjModel):
            raise RobotError(f"model is a {type(model).__name__}; give a mujoco.MjModel, or use MujocoRobot.from_file.")
        self._model = model
        self._nq, self._nv = int(model.nq), int(model.nv)
        self._name = f"the MuJoCo model {model_name(model)!r}"
        require_joints(self._nv, self._name)
        self._joint_names = tuple(model.joint(j).name or f"unnamed_joint_{j}" for j in range(model.njnt))
        widths = self._joint_widths = tuple(np.diff([*model.jnt_dofadr, model.nv]).tolist())
        self._couplings, self._loops = couplings_of(model)
        self._limited_balls = limited_balls(model)
        limit = np.inf if velocity_limit is None else velocity_limit
        self._velocity_limit = checked_limit(limit, self._joint_names, widths)
        self._lower, self._upper = position_limits(model)
        self._quaternions = np.array(quaternions(model), dtype=np.int64)
        # Sites are numbered after the bodies: one integer says which frame it is.
        self._nbody = int(model.nbody)
        bodies = [("body", model.body(i).name, i) for i in range(model.nbody)]
        sites = [("site", model.site(i).name, model.nbody + i) for i in range(model.nsite)]
        self._table = FrameTable([*bodies, *sites])

        data = mujoco.MjData(model)
        self._data = data
        self._qpos, self._qvel = data.qpos, data.qvel
        self._rest = np.zeros(self._nv)
        self._body_pose = (data.xmat.reshape(-1, 3, 3), data.xpos)
        self._site_pose = (data.site_xmat.reshape(-1, 3, 3), data.site_xpos)
        self._begin_with(unactuated)
        self._own_trees = set(model.dof_treeid.tolist()) - set(model.dof_treeid[self._unactuated].tolist())
        own = np.isin(model.body_treeid, list(self._own_trees))
        self._moving_bodies: list[int] = np.flatnonzero(own).tolist()
        self._moving_mass = float(model.body_mass[own].sum())
        self._kinematics: dict[int | None, _native.Kinematics] = {}
        self._part_kinematics: dict[frozenset[int], _native.Kinematics] = {}
        self._pose_room = (np.empty((1, 3, 3)), np.empty((1, 3)))
        neutral = keyframe(model, neutral) if isinstance(neutral, str) else model.qpos0 if neutral is None else neutral
        self._neutral = frozen(np.array(self._checked(neutral, "neutral")))
        self._simulation: mujoco.MjData | None = None
        self._given: FloatArray | None = None
        self._arm: tuple[DHArm, FloatArray] | None = None
        self._efforts: dict[str, float] = {}
        self.update(self._neutral)
        self._warn_of_neutral(self._neutral, scalar_coordinates(model))
        self._warn_of_ranges(np.array(model.jnt_dofadr[model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE], dtype=np.int64))

    @classmethod
    def from_arm(cls, arm: DHArm, *, timestep: float = 0.001, gravity_compensation: bool = True) -> MujocoRobot:
        """The robot of `arm_spec(arm, ...)`: see there for what the model is. Errors as `arm_spec`."""
        model = arm_spec(arm, timestep=timestep, gravity_compensation=gravity_compensation).compile()
        robot = cls(model, velocity_limit=arm.velocity_limit, neutral=arm.neutral)
        robot._arm = arm, geometry(model)
        return robot

    @classmethod
    def from_file(
        cls,
        path: Path,
        *,
        floating_base: bool = False,
        meshes: Meshes = True,
        package_paths: Iterable[Path] = (),
        repair_inertias: bool = False,
        velocity_limit: ArrayLike | Mapping[str, float] | None = None,
        neutral: ArrayLike | str | None = None,
    ) -> MujocoRobot:
        """The robot of an MJCF or URDF file.

        Args:
            path: the file. Of a URDF every link stays a frame, those behind fixed joints included; its velocity limits
                are read, and a link without `<inertial>` has no mass, whatever its geometry.
            floating_base: for a URDF, give the root link a free joint "root_joint".
            meshes: False leaves out the geoms that need mesh files, and the files need not be there; "if found" leaves out
                those whose file is not there, or that MuJoCo does not read, and says so in one warning. Meshes matter for
                collision distances, and for inertias that an MJCF takes from them.
            package_paths: folders where the packages of `package://PACKAGE/FILE` are, before the folders above the file,
                ROS_PACKAGE_PATH and AMENT_PREFIX_PATH.
            repair_inertias: True replaces inertias that MuJoCo refuses (not positive, or against A + B >= C) by the
                nearest it accepts, and gives massless moving links 1e-12 kg.
            velocity_limit: one number, (nv,) numbers or a mapping by joint name; default: the URDF's, else infinite.
            neutral: (nq,) the reference configuration, or the name of a keyframe; default MuJoCo's `qpos0`.

        A URDF joint whose lower and upper limits are stated and equal is locked there; where it states one of them, the
        other is 0. What a `<mimic>` says is in `couplings`.

        Raises:
            RobotError: no such file, a file that MuJoCo does not read or compile (with its message), or an argument
                that does not fit; a URDF joint with lower > upper or a negative velocity limit.
            SettingError: `meshes` is none of the three, or a package path is no folder.

        Warns:
            UserWarning: a URDF joint with velocity limit 0, which may not move, with one limit, stated as 0, or that mimics
                what cannot be followed; a neutral configuration outside the limits.
        """
        path = user_path(path)
        model = mujoco_model(
            path,
            floating_base=floating_base,
            meshes=meshes,
            package_paths=package_paths,
            repair_inertias=repair_inertias,
        )
        efforts: dict[str, float] = {}
        if file_format(path) == "urdf":
            stated = urdf_velocity_limits(path, warn=velocity_limit is None)
            joints = {model.joint(j).name for j in range(model.njnt)}
            efforts = {name: value for name, value in urdf_effort_limits(path).items() if name in joints}
            if velocity_limit is None:
                velocity_limit = {name: value for name, value in stated.items() if name in joints}
        robot = cls(model, velocity_limit=velocity_limit, neutral=neutral)
        robot._efforts = efforts
        return robot

    @classmethod
    def from_spec(
        cls,
        spec: mujoco.MjSpec,
        *,
        velocity_limit: ArrayLike | Mapping[str, float] | None = None,
        neutral: ArrayLike | str | None = None,
    ) -> MujocoRobot:
        """The robot of an MjSpec, compiled here. Raises `RobotError` with MuJoCo's message when it does not compile."""
        try:
            model = spec.compile()
        except ValueError as error:
            raise RobotError(f"MuJoCo does not compile the model {spec.modelname!r}: {one_line(error)}") from error
        return cls(model, velocity_limit=velocity_limit, neutral=neutral)

    @property
    def name(self) -> str:
        """The model's own name."""
        return model_name(self._model)

    @property
    def model(self) -> mujoco.MjModel:
        """The compiled model."""
        return self._model

    @property
    def data(self) -> mujoco.MjData:
        """The simulation state, made on first use at `neutral` and never touched by this object afterwards."""
        if self._simulation is None:
            data = mujoco.MjData(self._model)
            data.qpos[:] = self._neutral
            mujoco.mj_forward(self._model, data)
            self._simulation = data
        return self._simulation

    def update(self, q: FloatArray) -> None:
        """Set the configuration (nq,) and compute the kinematics. Raises `RobotError` on a wrong size or a NaN."""
        if not _take_configuration(q, self._qpos, self._quaternions, _MIN_SQUARE):
            self._qpos[...] = self._checked(q, "q")
        self._given = None
        self._is_complete = False
        _kinematics(self._model, self._data)

    @property
    def q(self) -> FloatArray:
        """(nq,) the configuration of the last `update`, read-only."""
        if self._given is None:
            self._given = frozen(self._qpos.copy())
        return self._given

    def pose(self, frame: str) -> tuple[FloatArray, FloatArray]:
        """Rotation (3, 3) from frame to world and origin (3,) of `frame` in the world."""
        index = self._frame(frame)
        if index < self._nbody:
            rotations, origins = self._body_pose
        else:
            rotations, origins = self._site_pose
            index -= self._nbody
        return rotations[index].copy(), origins[index].copy()

    def jacobian(self, frame: str) -> FloatArray:
        """(6, nv): linear velocity of the frame's origin over angular velocity, both in world axes, per unit v."""
        # The way in which a stack's rows are made: rows that say the same are then the same, to the last bit.
        kinematics = self._kinematics.get(self._frame(frame)) or self._kinematics_of((frame,))
        jacobian: FloatArray = np.zeros((6, self._nv))
        kinematics.read(*self._pose_room, jacobian[None])
        return jacobian

    def frame_reader(self, names: tuple[str | Point, ...]) -> MujocoFrames:
        """Poses and Jacobians of these frames in arrays that are read again and again; see `Frames`."""
        return MujocoFrames(self, names)

    def distances_between(self, pairs: Sequence[tuple[Side, Side]], *, detection: float = 1.0) -> Distances:
        """Distances in m between these pairs of geoms; see `MujocoDistances`."""
        from hqp_rp.robot.mujoco_distance import MujocoDistances

        return MujocoDistances(self, pairs, detection=detection)

    def center_of_mass(self) -> FloatArray:
        """(3,) centre of mass of the bodies that can move, in the world. Raises `RobotError` where nothing can."""
        return self._center_of_mass()[0]

    def center_of_mass_jacobian(self) -> FloatArray:
        """(3, nv) velocity of that centre of mass in world axes, per unit v."""
        return self._center_of_mass()[1]

    def part_center_of_mass(self, bodies: Sequence[str]) -> tuple[FloatArray, FloatArray]:
        """Centre of mass (3,) of parts of the robot in the world, and its velocity (3, nv) in world axes, per unit v.

        Args:
            bodies: names of frames: each stands for all that moves with its body, what that body carries included. None is
                counted twice.

        Raises:
            RobotError: a name that there is not, a body that is fixed to the world, or parts without mass.
        """
        self._complete()
        model, data = self._model, self._data
        roots = {self._moving_body(name) for name in bodies}
        total, center, jacobian, own = 0.0, np.zeros(3), np.zeros((3, self._nv)), np.empty((3, self._nv))
        for body in roots:
            above = int(model.body_parentid[body])
            while above and above not in roots:
                above = int(model.body_parentid[above])
            mass = float(model.body_subtreemass[body])
            if above or mass == 0.0:
                continue  # a part of another part
            mujoco.mj_jacSubtreeCom(model, data, own, body)
            total += mass
            center += mass * data.subtree_com[body]
            jacobian += mass * own
        self._require_part_mass(total, bodies)
        return center / total, jacobian / total

    def part_center_of_mass_bias_acceleration(self, bodies: Sequence[str], v: FloatArray) -> FloatArray:
        """(3,) acceleration of that centre of mass in world axes, at v (nv,) and v-dot = 0; arguments and errors as there."""
        roots = frozenset(self._moving_body(name) for name in bodies)
        kinematics = self._part_kinematics.get(roots)
        if kinematics is None:
            parts = set(roots)
            for body in range(1, self._nbody):  # a body comes after its parent
                if int(self._model.body_parentid[body]) in parts:
                    parts.add(body)
            mass = float(self._model.body_mass[list(parts)].sum())
            self._require_part_mass(mass, bodies)
            kinematics = kinematics_of(self._model, self._data, [None], mass, parts)
            self._part_kinematics[roots] = kinematics
        return self._bias_of(kinematics, v)[:3]

    def _moving_body(self, name: str) -> int:
        """The body that moves and to which this frame is fixed."""
        index = self._frame(name)
        body = index if index < self._nbody else int(self._model.site_bodyid[index - self._nbody])
        body = int(self._model.body_weldid[body])
        self._require_moving(body, name)
        return body

    def mass_matrix(self) -> FloatArray:
        """(nv, nv) joint-space inertia matrix, rotor inertia (armature) included."""
        matrix = np.empty((self._nv, self._nv))
        self._write_mass_matrix(matrix)
        return matrix

    def gravity(self) -> FloatArray:
        """(nv,) gravity torque g(q) in M(q) a + h(q, v) + g(q) = tau, before any gravity compensation of the model."""
        return self.bias(self._rest)

    def bias(self, v: FloatArray) -> FloatArray:
        """(nv,) h(q, v) + g(q) in M(q) a + h(q, v) + g(q) = tau, for v (nv,): Coriolis, centrifugal and gravity torques."""
        torque = np.empty(self._nv)
        self._write_bias(checked_vector(v, self._nv, "v"), torque)
        return torque

    def _read_dynamics(self, v: FloatArray, mass_matrix: FloatArray, bias: FloatArray) -> None:
        """Write `mass_matrix()` (nv, nv) and `bias(v)` (nv,) into arrays; v (nv,) is a float64 array and not checked."""
        self._write_mass_matrix(mass_matrix)
        self._write_bias(v, bias)

    def _write_mass_matrix(self, out: FloatArray) -> None:
        if not self._is_complete:
            self._complete()
        model, data = self._model, self._data
        _inertias(model, data)
        _full_inertia(model, data, out)

    def _write_bias(self, v: FloatArray, out: FloatArray) -> None:
        if not self._is_complete:
            self._complete()
        model, data = self._model, self._data
        self._qvel[...] = v  # nothing else reads the velocity of the private state
        _velocities(model, data)
        _newton_euler(model, data, 0, out)

    @property
    def effort_limit(self) -> FloatArray:
        """(nv,) the greatest |torque| that the model states of its motors, N m or N; infinite where none is stated.

        What MuJoCo keeps of it, and the `effort` of the URDF from which `from_file` made the robot, which MuJoCo drops.
        """
        limit = effort_limits(self._model)
        for name, effort in self._efforts.items():
            i = int(self._model.jnt_dofadr[self._model.joint(name).id])
            limit[i] = min(limit[i], effort)
        return limit

    def inverse_dynamics(self, v: FloatArray, a: FloatArray) -> FloatArray:
        """(nv,) tau = M(q) a + h(q, v) + g(q) for v and a (nv,); without friction, damping and contacts of the model."""
        acceleration = checked_vector(a, self._nv, "a")
        return self.mass_matrix() @ acceleration + self.bias(v)

    def bias_acceleration(self, frame: str, v: FloatArray) -> FloatArray:
        """(6,) Jdot v: acceleration of the frame's origin over angular acceleration, in world axes, at v (nv,) and v-dot = 0.

        The acceleration of a point, not of a spatial vector; gravity is not in it.
        """
        kinematics = self._kinematics.get(self._frame(frame)) or self._kinematics_of((frame,))
        return self._bias_of(kinematics, v)

    def center_of_mass_bias_acceleration(self, v: FloatArray) -> FloatArray:
        """(3,) acceleration of the centre of mass in world axes, at v (nv,) and v-dot = 0, without gravity."""
        kinematics = self._kinematics.get(None) or self._kinematics_of((Point.CENTER_OF_MASS,))
        return self._bias_of(kinematics, v)[:3]

    def angular_momentum_jacobian(self) -> FloatArray:
        """A (3, nv): angular momentum about the centre of mass, kg m^2/s, in world axes, is A v; of a robot on a free base.

        Raises `RobotError` for a robot whose only moving tree does not begin with a free joint.
        """
        body = self._free_body()
        self._complete()
        matrix: FloatArray = np.empty((3, self._nv))
        mujoco.mj_angmomMat(self._model, self._data, matrix, body)
        return matrix

    def angular_momentum_bias(self, v: FloatArray) -> FloatArray:
        """(3,) N m: the rate of that angular momentum at v (nv,) and v-dot = 0; errors as of its Jacobian."""
        body = self._free_body()
        wrench = (self.bias(v) - self.gravity())[:6]
        rotation, origin = self._body_pose[0][body], self._body_pose[1][body]
        # The wrench that moves the whole robot, from the base's origin to the centre of mass.
        found: FloatArray = rotation @ wrench[3:] + np.cross(origin - self.center_of_mass(), wrench[:3])
        return found

    def _free_body(self) -> int:
        """The body that the free joint carries."""
        model = self._model
        if model.ntree != 1 or int(model.jnt_type[0]) != int(mujoco.mjtJoint.mjJNT_FREE):
            raise RobotError(
                f"{self._name}: an angular momentum about the centre of mass is told of one tree on a free joint alone."
            )
        return int(model.jnt_bodyid[0])

    def _bias_of(self, kinematics: _native.Kinematics, v: FloatArray) -> FloatArray:
        twist, bias = np.empty((1, 6)), np.empty((1, 6))
        velocity = np.ascontiguousarray(checked_vector(v, self._nv, "v"))
        kinematics.motion(velocity, twist, bias)
        return bias.ravel()

    def integrate(self, q: FloatArray, v: FloatArray, dt: float) -> FloatArray:
        """(nq,) configuration reached from q by the constant velocity v during dt seconds."""
        require_velocity(v)
        result = self._checked(q, "q").copy()
        mujoco.mj_integratePos(self._model, result, checked_vector(v, self._nv, "v"), dt)
        return result

    def difference(self, q0: FloatArray, q1: FloatArray) -> FloatArray:
        """(nv,) velocity that leads from q0 to q1 in one second."""
        velocity = np.empty(self._nv)
        mujoco.mj_differentiatePos(self._model, velocity, 1.0, self._checked(q0, "q0"), self._checked(q1, "q1"))
        return velocity

    def _unchanged_arm(self) -> DHArm | None:
        """The arm that the robot was made from, while its model still has that arm's geometry; None otherwise."""
        if self._arm is None or not np.array_equal(geometry(self._model), self._arm[1]):
            return None
        return self._arm[0]

    def __reduce__(self) -> tuple[Any, ...]:
        others = {
            "mocap_pos": self._data.mocap_pos.copy(),
            "mocap_quat": self._data.mocap_quat.copy(),
            "_mocap_velocity": self._mocap_velocity,
            "_unactuated": self._unactuated,
            "_unactuated_velocity": self._unactuated_velocity,
            "_efforts": self._efforts,
        }
        return _rebuild, (self._model, self._velocity_limit, self._neutral, self.q, self._unchanged_arm(), others)

    def __repr__(self) -> str:
        return f"MujocoRobot({model_name(self._model)!r}, nq={self.nq}, nv={self.nv}, {len(self.frame_names)} frames)"

    def _checked(self, q: ArrayLike, what: str) -> FloatArray:
        vector = checked_vector(q, self._nq, what)
        for start in self._quaternions:
            quaternion = vector[start : start + 4]
            if not quaternion.dot(quaternion) > _MIN_SQUARE:
                raise RobotError(f"{what}[{start}:{start + 4}] is a zero quaternion; it must have a direction.")
        return vector

    def _center_of_mass(self) -> tuple[FloatArray, FloatArray]:
        kinematics = self._kinematics.get(None) or self._kinematics_of((Point.CENTER_OF_MASS,))
        origin, jacobian = np.empty(3), np.zeros((6, self._nv))
        kinematics.read(self._pose_room[0], origin[None], jacobian[None])
        return origin, jacobian[:3]

    def _kinematics_of(self, names: tuple[str | Point, ...]) -> _native.Kinematics:
        """What reads these frames; of a single one it is kept."""
        if Point.CENTER_OF_MASS in names:
            self._require_mass()
        numbers = [None if isinstance(name, Point) else self._frame(name) for name in names]
        kinematics = kinematics_of(self._model, self._data, numbers, self._moving_mass, self._moving_bodies)
        if len(numbers) == 1:
            self._kinematics[numbers[0]] = kinematics
        return kinematics

    def _complete(self) -> None:
        """What only dynamics need of the configuration, when first asked for: dof axes and inertias."""
        if not self._is_complete:
            mujoco.mj_comPos(self._model, self._data)
            self._is_complete = True

    def _require_mass(self) -> float:
        if self._moving_mass <= 0.0:
            raise RobotError(f"{self._name} has no moving mass, hence no centre of mass.")
        return self._moving_mass


def _rebuild(
    model: mujoco.MjModel,
    limit: FloatArray,
    neutral: FloatArray,
    q: FloatArray,
    arm: DHArm | None,
    others: dict[str, Any],
) -> MujocoRobot:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # said when it was first loaded
        trees = {int(model.dof_treeid[i]) for i in others["_unactuated"]}
        joints = range(model.njnt)
        named = [model.joint(j).name or f"unnamed_joint_{j}" for j in joints]
        names = [named[j] for j in joints if int(model.dof_treeid[model.jnt_dofadr[j]]) in trees]
        robot = MujocoRobot(model, velocity_limit=limit, neutral=neutral, unactuated=names)
    for name in ("mocap_pos", "mocap_quat"):
        getattr(robot._data, name)[:] = others[name]
    for name in ("_mocap_velocity", "_unactuated_velocity", "_efforts"):
        setattr(robot, name, others[name])
    robot._arm = None if arm is None else (arm, geometry(model))
    robot.update(q)
    return robot
