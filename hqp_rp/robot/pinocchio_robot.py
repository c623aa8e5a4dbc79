"""The Pinocchio adapter: any URDF or MJCF file, any pinocchio.Model, and the arms of the library."""

from __future__ import annotations

import contextlib
import functools
import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hqp_rp.core.errors import RobotError
from hqp_rp.core.extras import require
from hqp_rp.core.paths import user_path
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.robot.coupling import couplings_of, limited_balls
from hqp_rp.robot.dh import DHArm
from hqp_rp.robot.distance import Distances, Side
from hqp_rp.robot.frames import FrameTable, checked_limit, checked_vector, frozen, require_joints, require_velocity
from hqp_rp.robot.geoms import Geoms
from hqp_rp.robot.mesh_files import Meshes, checked_folders, checked_meshes
from hqp_rp.robot.model_file import (
    Path,
    file_format,
    one_line,
    parse_urdf,
    require_floatable,
    urdf_mimics,
    urdf_position_limits,
    urdf_velocity_limits,
)
from hqp_rp.robot.model_robot import ModelRobot
from hqp_rp.robot.pinocchio_geometry import geometry_from_mujoco, geometry_from_urdf, geometry_of_arm
from hqp_rp.robot.pinocchio_model import arm_model, configuration_from_mujoco, model_from_mujoco

_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
_KINDS = {
    pin.FrameType.BODY: "body",
    pin.FrameType.OP_FRAME: "site",
    pin.FrameType.SENSOR: "sensor",
    pin.FrameType.JOINT: "joint",
    pin.FrameType.FIXED_JOINT: "joint",
}


class PinocchioRobot(ModelRobot):
    """A `Robot` computed by Pinocchio.

    Frames are the bodies (links), the operational frames (sites of an MJCF) and the joints; the universe is "world". A
    name borne by a body and a site is asked for as "body:NAME" or "site:NAME"; a joint that shares its name with one of
    them as "joint:NAME". Configuration and velocity follow Pinocchio: a free flyer has position and quaternion
    (x, y, z, w) in q, and linear and angular velocity in the axes of the body itself in v; a continuous joint of a URDF
    has (cos, sin) in q. Quaternions and (cos, sin) need not be normalized, but must not be zero.

    `model` is the `pinocchio.Model`, for use with Pinocchio itself. Every array returned is fresh, except `lower`,
    `upper`, `velocity_limit`, `neutral` and `q`, which are read-only. The centre of mass is that of the bodies that can
    move; what is fixed to the world does not count.

    Args:
        model: a `pinocchio.Model`; it is used, not copied, and must not be changed afterwards.
        velocity_limit: one number, (nv,) numbers or a mapping by joint name; default the model's own.
        neutral: (nq,) the reference configuration; default `pinocchio.neutral(model)`.
        geometry: a `pinocchio.GeometryModel` of what may collide, for distances; used, not copied.

    Raises:
        RobotError: a limit, a configuration or a geometry that does not fit the model.

    Warns:
        UserWarning: a neutral configuration outside the joint limits; ranges that look like degrees taken for radians, or
            the other way round.

    A `pinocchio.Model` does not say whether limits [0, 0] were stated: they are taken for none. `from_file` knows.
    """

    _geometry: Any | None = None
    _geoms: Geoms | None = None

    def __init__(
        self,
        model: Any,
        *,
        velocity_limit: ArrayLike | Mapping[str, float] | None = None,
        neutral: ArrayLike | None = None,
        geometry: Any | None = None,
    ) -> None:
        self._read(model, velocity_limit)
        if not isinstance(geometry, pin.GeometryModel | None):
            raise RobotError(
                f"geometry is a {type(geometry).__name__}; give a pinocchio.GeometryModel, such as "
                "pinocchio.buildGeomFromUrdf(model, path, pinocchio.GeometryType.COLLISION) makes."
            )
        self._geometry = geometry
        self._begin_at(neutral)

    def _read(self, model: Any, velocity_limit: ArrayLike | Mapping[str, float] | None) -> None:
        """Everything but the neutral configuration."""
        if not isinstance(model, pin.Model):
            raise RobotError(
                f"model is a {type(model).__name__}; give a pinocchio.Model, or use PinocchioRobot.from_file."
            )
        self._model = model
        self._nq, self._nv = int(model.nq), int(model.nv)
        self._name = f"the Pinocchio model {model.name!r}"
        require_joints(self._nv, self._name)
        self._joint_names = tuple(list(model.names)[1:])
        widths = self._joint_widths = tuple(int(nv) for nv in list(model.nvs)[1:])
        limit = _without_maxima(model.velocityLimit) if velocity_limit is None else velocity_limit
        self._velocity_limit = checked_limit(limit, self._joint_names, widths)
        self._lower, self._upper = _position_limits(model)
        links = {frame.name for frame in model.frames if frame.type == pin.FrameType.BODY}
        entries = [] if "world" in links else [("body", "world", 0)]
        entries += [(_KINDS[frame.type], frame.name, i) for i, frame in enumerate(model.frames) if i > 0]
        self._table = FrameTable(entries)
        self._moving_mass = float(sum(inertia.mass for inertia in list(model.inertias)[1:]))
        self._below = np.tril_indices(self._nv, -1)
        # Mass matrix and centre of mass overwrite what the frame Jacobians are read from: they get data of their own.
        self._data = model.createData()
        self._dynamics = model.createData()
        self._rest = np.zeros(self._nv)

    def _begin_at(self, neutral: ArrayLike | str | None) -> None:
        """Take this for the neutral configuration, and be there; outside the limits as they are now, that is said."""
        if isinstance(neutral, str):
            raise RobotError(
                f"neutral is {neutral!r}, but a URDF has no keyframes, nor has {self._name}; give {self._nq} numbers."
            )
        neutral = pin.neutral(self._model) if neutral is None else neutral
        self._checked(neutral, "neutral")
        self._neutral = frozen(np.array(neutral, dtype=np.float64))
        self.update(self._neutral)
        self._warn_of_neutral(self._neutral, _scalar_coordinates(self._model))
        revolute = [
            j for j in range(1, self._model.njoints) if self._model.joints[j].shortname().startswith("JointModelR")
        ]
        self._warn_of_ranges(np.array([self._model.idx_vs[j] for j in revolute], dtype=np.int64))

    @classmethod
    def from_arm(cls, arm: DHArm) -> PinocchioRobot:
        """The robot of an arm, built from the same data as `MujocoRobot.from_arm`, without a file in between."""
        model = arm_model(arm)
        return cls(model, neutral=arm.neutral, geometry=geometry_of_arm(model, arm))

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
    ) -> PinocchioRobot:
        """The robot of a URDF or MJCF file.

        A URDF is read by Pinocchio. An MJCF is read by MuJoCo, whose compiled model is then rebuilt joint by joint, so
        that defaults, references, gravity, unnamed bodies and inertias from geometry mean what they mean to MuJoCo
        (Pinocchio's own reader leaves out gravity, shifts the limits of a joint by its reference, and misplaces a free body
        that the file rotates).

        Args:
            path: the file.
            floating_base: for a URDF, put the root link on a free flyer "root_joint".
            meshes, package_paths: as in `MujocoRobot.from_file`. Of a URDF only the meshes of `<collision>` elements are read,
                and not before a distance is asked for: see `geometry_from_urdf`.
            repair_inertias: for an MJCF, as in `MujocoRobot.from_file`; Pinocchio takes a URDF's inertias as they are.
            velocity_limit: one number, (nv,) numbers or a mapping by joint name; default: the URDF's, else infinite.
            neutral: (nq,) the reference configuration, or the name of an MJCF's keyframe; default MuJoCo's `qpos0`, or
                Pinocchio's neutral for a URDF.

        Raises:
            RobotError: no such file, a file that is not read (with the library's message), or an argument that does
                not fit; a URDF joint with lower > upper or a negative velocity limit.

        Warns:
            UserWarning: as `MujocoRobot.from_file`.
        """
        checked_meshes(meshes)
        path, folders = user_path(path), checked_folders(package_paths)
        if file_format(path) == "mjcf":
            require("An MJCF file in Pinocchio", "mujoco")
            from hqp_rp.robot.mujoco_file import mujoco_model

            source = mujoco_model(
                path,
                floating_base=floating_base,
                meshes=meshes,
                package_paths=folders,
                repair_inertias=repair_inertias,
            )
            return cls.from_mujoco(source, velocity_limit=velocity_limit, neutral=neutral)
        tree = parse_urdf(path)
        urdf_velocity_limits(path, warn=velocity_limit is None)
        stated = urdf_position_limits(path)
        if floating_base:
            require_floatable(path)
        try:
            root = [pin.JointModelFreeFlyer()] if floating_base else []
            # Without shapes, which are read here: Pinocchio's reader knows fewer, and complains of the others.
            for link in tree.iterfind("link"):
                for shape in [*link.findall("visual"), *link.findall("collision")]:
                    link.remove(shape)
            model = pin.buildModelFromXML(ElementTree.tostring(tree, encoding="unicode"), *root)
        except (ValueError, RuntimeError) as error:
            raise RobotError(
                f"Pinocchio does not read {os.fspath(path)!r}: {one_line(error)} Its reader names the reason on stderr."
            ) from error
        robot = cls.__new__(cls)
        robot._read(model, velocity_limit)
        robot._couplings = urdf_mimics(path)
        robot._geometry = functools.partial(geometry_from_urdf, model, path, meshes=meshes, package_paths=folders)
        lower, upper = robot._lower.copy(), robot._upper.copy()
        for name, limits in stated.items():
            i = int(model.idx_vs[model.getJointId(name)])
            lower[i], upper[i] = limits
        robot._lower, robot._upper = frozen(lower), frozen(upper)
        robot._begin_at(neutral)
        return robot

    @classmethod
    def from_mujoco(
        cls,
        source: Any,
        *,
        velocity_limit: ArrayLike | Mapping[str, float] | None = None,
        neutral: ArrayLike | str | None = None,
    ) -> PinocchioRobot:
        """The robot of a compiled `mujoco.MjModel`: the same kinematics and inertias, in Pinocchio's convention.

        Args as `from_file`; `neutral` (nq,) in Pinocchio's convention, default `qpos0`.
        """
        from hqp_rp.robot.mujoco_model import keyframe, position_limits

        require_joints(int(source.nv), "the MuJoCo model")
        names = tuple(source.joint(j).name or f"unnamed_joint_{j}" for j in range(source.njnt))
        if neutral is None or isinstance(neutral, str):
            q = source.qpos0 if neutral is None else keyframe(source, neutral)
            neutral = configuration_from_mujoco(source, q)
        robot = cls.__new__(cls)
        model, carriers = model_from_mujoco(source, names)
        robot._read(model, velocity_limit)
        robot._geometry, robot._geoms = geometry_from_mujoco(source, carriers)
        robot._couplings, robot._loops = couplings_of(source)
        robot._limited_balls = limited_balls(source)
        robot._lower, robot._upper = position_limits(source)
        robot._begin_at(neutral)
        return robot

    @property
    def name(self) -> str:
        """The model's own name."""
        return str(self._model.name)

    @property
    def model(self) -> Any:
        """The `pinocchio.Model`."""
        return self._model

    @property
    def geometry(self) -> Any:
        """The `pinocchio.GeometryModel` of what may collide. Raises `RobotError` where there is none.

        Collision pairs added to it, less those that an SRDF removes (`pinocchio.removeCollisionPairs`), are the only ones
        that groups and bodies have then; see `hqp_rp.robot.geoms.pairs_of`.
        """
        if self._geometry is None:
            raise RobotError(
                f"{self._name} has no collision geometry: load the robot with PinocchioRobot.from_file, or give "
                "PinocchioRobot(model, geometry=...) a pinocchio.GeometryModel."
            )
        if isinstance(self._geometry, functools.partial):
            self._geometry = self._geometry()
        return self._geometry

    @property
    def mujoco_geoms(self) -> Geoms | None:
        """Names and collision filter of the geometry as MuJoCo states them, for a model that was made from MuJoCo's."""
        return self._geoms

    def distances_between(self, pairs: Sequence[tuple[Side, Side]], *, detection: float = 1.0) -> Distances:
        """Distances in m between these pairs of the geometry's objects; see `PinocchioDistances`."""
        from hqp_rp.robot.pinocchio_distance import PinocchioDistances

        return PinocchioDistances(self, pairs, detection=detection)

    def update(self, q: FloatArray) -> None:
        """Set the configuration (nq,) and compute the kinematics. Raises `RobotError` on a wrong size or a NaN."""
        normalized = self._checked(q, "q")
        self._q = frozen(np.array(q, dtype=np.float64))
        self._normalized = self._q if self._nq == self._nv else normalized
        pin.computeJointJacobians(self._model, self._data, self._normalized)

    def pose(self, frame: str) -> tuple[FloatArray, FloatArray]:
        """Rotation (3, 3) from frame to world and origin (3,) of `frame` in the world."""
        placement = pin.updateFramePlacement(self._model, self._data, self._frame(frame))
        return np.array(placement.rotation, order="C"), np.array(placement.translation)

    def jacobian(self, frame: str) -> FloatArray:
        """(6, nv): linear velocity of the frame's origin over angular velocity, both in world axes, per unit v."""
        jacobian = pin.getFrameJacobian(self._model, self._data, self._frame(frame), _ALIGNED)
        # The reshape is for nv = 1, where the bindings return a vector.
        return np.array(jacobian, order="C").reshape(6, self._nv)

    def center_of_mass(self) -> FloatArray:
        """(3,) centre of mass of the bodies that can move, in the world. Raises `RobotError` where nothing can."""
        self._require_mass()
        return np.array(pin.centerOfMass(self._model, self._dynamics, self._normalized, False))

    def center_of_mass_jacobian(self) -> FloatArray:
        """(3, nv) velocity of that centre of mass in world axes, per unit v."""
        self._require_mass()
        jacobian = pin.jacobianCenterOfMass(self._model, self._dynamics, self._normalized, False)
        return np.array(jacobian, order="C").reshape(3, self._nv)

    def part_center_of_mass(self, bodies: Sequence[str]) -> tuple[FloatArray, FloatArray]:
        """As `MujocoRobot.part_center_of_mass`."""
        model, data = self._model, self._dynamics
        roots = {self._moving_joint(name) for name in bodies}
        total, center, jacobian = 0.0, np.zeros(3), np.zeros((3, self._nv))
        for joint in roots:
            if roots & set(list(model.supports[joint])[:-1]):
                continue  # a part of another part
            own = pin.jacobianSubtreeCenterOfMass(model, data, self._normalized, joint)
            mass = float(data.mass[joint])
            total += mass
            center += mass * np.asarray(data.com[joint])
            jacobian += mass * np.array(own).reshape(3, self._nv)
        self._require_part_mass(total, bodies)
        return center / total, jacobian / total

    def part_center_of_mass_bias_acceleration(self, bodies: Sequence[str], v: FloatArray) -> FloatArray:
        """As `MujocoRobot.part_center_of_mass_bias_acceleration`."""
        model, data = self._model, self._dynamics
        velocity = checked_vector(v, self._nv, "v")
        roots = {self._moving_joint(name) for name in bodies}
        pin.centerOfMass(model, data, self._normalized, velocity, self._rest, True)
        total, acceleration = 0.0, np.zeros(3)
        for joint in roots:
            if roots & set(list(model.supports[joint])[:-1]):
                continue  # a part of another part
            mass = float(data.mass[joint])
            total += mass
            acceleration += mass * (data.oMi[joint].rotation @ data.acom[joint])
        self._require_part_mass(total, bodies)
        return acceleration / total

    def _moving_joint(self, name: str) -> int:
        """The joint that carries this frame."""
        joint = int(self._model.frames[self._frame(name)].parentJoint)
        self._require_moving(joint, name)
        return joint

    def mass_matrix(self) -> FloatArray:
        """(nv, nv) joint-space inertia matrix, rotor inertia (armature) included."""
        matrix = np.array(pin.crba(self._model, self._dynamics, self._normalized), order="C")
        matrix = matrix.reshape(self._nv, self._nv)
        matrix[self._below] = matrix.T[self._below]  # only the upper triangle is computed
        return matrix

    def gravity(self) -> FloatArray:
        """(nv,) generalized gravity torque g(q) in M(q) a + h(q, v) + g(q) = tau."""
        return np.array(pin.computeGeneralizedGravity(self._model, self._dynamics, self._normalized))

    def bias(self, v: FloatArray) -> FloatArray:
        """(nv,) h(q, v) + g(q) in M(q) a + h(q, v) + g(q) = tau, for v (nv,): Coriolis, centrifugal and gravity torques."""
        velocity = checked_vector(v, self._nv, "v")
        return np.array(pin.nonLinearEffects(self._model, self._dynamics, self._normalized, velocity))

    @property
    def effort_limit(self) -> FloatArray:
        """(nv,) the greatest |torque| that a URDF states of its joints, N m or N; infinite where none is stated."""
        limit = np.array(self._model.effortLimit, dtype=np.float64)
        limit[(limit <= 0.0) | (limit >= np.finfo(np.float64).max)] = np.inf
        return limit

    def inverse_dynamics(self, v: FloatArray, a: FloatArray) -> FloatArray:
        """(nv,) tau = M(q) a + h(q, v) + g(q) for v and a (nv,)."""
        velocity, acceleration = checked_vector(v, self._nv, "v"), checked_vector(a, self._nv, "a")
        return np.array(pin.rnea(self._model, self._dynamics, self._normalized, velocity, acceleration))

    def bias_acceleration(self, frame: str, v: FloatArray) -> FloatArray:
        """As `MujocoRobot.bias_acceleration`."""
        found: FloatArray = np.empty((1, 6))
        self.fill_bias_accelerations(((0, frame),), v, found)
        return found.ravel()

    def fill_bias_accelerations(self, frames: Iterable[tuple[int, str]], v: FloatArray, out: FloatArray) -> None:
        """`bias_acceleration` of several frames in these rows of out (F, 6): the tree is gone through once."""
        model, data, frame_of = self._model, self._dynamics, self._frame
        pin.forwardKinematics(model, data, self._normalized, checked_vector(v, self._nv, "v"), self._rest)
        for f, frame in frames:
            out[f] = pin.getFrameClassicalAcceleration(model, data, frame_of(frame), _ALIGNED).vector

    def center_of_mass_bias_acceleration(self, v: FloatArray) -> FloatArray:
        """As `MujocoRobot.center_of_mass_bias_acceleration`."""
        self._require_mass()
        velocity = checked_vector(v, self._nv, "v")
        pin.centerOfMass(self._model, self._dynamics, self._normalized, velocity, self._rest, False)
        return np.array(self._dynamics.acom[0])

    def angular_momentum_jacobian(self) -> FloatArray:
        """As `MujocoRobot.angular_momentum_jacobian`, of any robot."""
        self._require_mass()
        matrix = pin.computeCentroidalMap(self._model, self._dynamics, self._normalized)
        return np.array(matrix, order="C").reshape(6, self._nv)[3:]

    def angular_momentum_bias(self, v: FloatArray) -> FloatArray:
        """As `MujocoRobot.angular_momentum_bias`, of any robot."""
        self._require_mass()
        velocity = checked_vector(v, self._nv, "v")
        rate = np.array(pin.dccrba(self._model, self._dynamics, self._normalized, velocity)).reshape(6, self._nv)
        found: FloatArray = rate[3:] @ velocity
        return found

    def integrate(self, q: FloatArray, v: FloatArray, dt: float) -> FloatArray:
        """(nq,) configuration reached from q by the constant velocity v during dt seconds."""
        require_velocity(v)
        step = checked_vector(v, self._nv, "v") * dt
        return np.array(pin.integrate(self._model, self._checked(q, "q"), step))

    def difference(self, q0: FloatArray, q1: FloatArray) -> FloatArray:
        """(nv,) velocity that leads from q0 to q1 in one second."""
        return np.array(pin.difference(self._model, self._checked(q0, "q0"), self._checked(q1, "q1")))

    def __reduce__(self) -> tuple[Any, ...]:
        with contextlib.suppress(RobotError):  # meshes that are not there: whoever asks for distances is told
            _ = None if self._geometry is None else self.geometry
        parts = ("_lower", "_upper", "_couplings", "_loops", "_limited_balls", "_geometry", "_geoms")
        stated = {name: getattr(self, name) for name in parts}
        return _rebuild, (self._model, self._velocity_limit, self._neutral, self._q, stated)

    def __repr__(self) -> str:
        return f"PinocchioRobot({self._model.name!r}, nq={self.nq}, nv={self.nv}, {len(self.frame_names)} frames)"

    def _checked(self, q: ArrayLike, what: str) -> FloatArray:
        """q as Pinocchio's functions take it: checked, and normalized where the model has quaternions."""
        vector = checked_vector(q, self._nq, what)
        if self._nq == self._nv:
            return vector
        normalized = np.asarray(pin.normalize(self._model, vector))
        if not pin.isNormalized(self._model, normalized):
            raise RobotError(f"{what} holds a zero quaternion or a zero (cos, sin); it must have a direction.")
        return normalized

    def _require_mass(self) -> None:
        if self._moving_mass <= 0.0:
            raise RobotError(f"{self._name} has no moving mass, hence no centre of mass.")


def _rebuild(
    model: Any, limit: FloatArray, neutral: FloatArray, q: FloatArray, stated: dict[str, Any]
) -> PinocchioRobot:
    robot = PinocchioRobot.__new__(PinocchioRobot)
    robot._read(model, limit)
    robot._neutral = frozen(neutral)
    for name, value in stated.items():
        setattr(robot, name, value)
    robot.update(q)
    return robot


def _scalar_coordinates(model: Any) -> IntArray:
    """(nv,) index into q of the joint position of each velocity, -1 where it is not one number."""
    index = np.full(model.nv, -1, dtype=np.int64)
    for j in range(1, model.njoints):
        if model.nqs[j] == model.nvs[j] == 1:
            index[model.idx_vs[j]] = model.idx_qs[j]
    return index


def _position_limits(model: Any) -> tuple[FloatArray, FloatArray]:
    lower, upper = np.full(model.nv, -np.inf), np.full(model.nv, np.inf)
    for j in range(1, model.njoints):
        # Where q has more numbers than v (quaternions, continuous joints) its bounds are no bounds of a velocity index.
        if model.nqs[j] == model.nvs[j]:
            rows = slice(model.idx_vs[j], model.idx_vs[j] + model.nvs[j])
            columns = slice(model.idx_qs[j], model.idx_qs[j] + model.nqs[j])
            lower[rows] = _without_maxima(model.lowerPositionLimit[columns])
            upper[rows] = _without_maxima(model.upperPositionLimit[columns])
    # A URDF that states no lower and upper reads as [0, 0]; like MuJoCo, take that for no limit.
    unstated = (lower == 0.0) & (upper == 0.0)
    lower[unstated], upper[unstated] = -np.inf, np.inf
    return frozen(lower), frozen(upper)


def _without_maxima(limits: FloatArray) -> FloatArray:
    """The limits, with the largest float, which Pinocchio writes for "none", as infinity."""
    return np.where(np.abs(limits) >= np.finfo(np.float64).max, np.copysign(np.inf, limits), limits)
