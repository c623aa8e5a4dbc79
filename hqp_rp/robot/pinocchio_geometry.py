"""Collision geometry for Pinocchio: of a URDF file, of a compiled MuJoCo model, of a `DHArm`."""

from __future__ import annotations

import dataclasses
import os
import pathlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin

from hqp_rp.core.errors import RobotError
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.dh import DHArm
from hqp_rp.robot.geoms import Geoms, standing_geoms
from hqp_rp.robot.mesh_files import Meshes, resolved, warn_of_lost
from hqp_rp.robot.model_file import Path, one_line, parse_urdf

if TYPE_CHECKING:
    import mujoco

_FLAT = 1e-9
"""Points whose smallest extent is this share of the largest, or less, have no convex hull (coal crashes on them)."""
_PLANES = (coal.Halfspace, coal.Plane)
_URDF_SIZES = {
    "box": ("size",),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
}


def geometry_from_urdf(
    model: Any, path: Path, *, meshes: Meshes = True, package_paths: Sequence[pathlib.Path] = ()
) -> Any:
    """The `pinocchio.GeometryModel` of the `<collision>` elements of a URDF file: box, sphere, cylinder, capsule, mesh.

    An element's name is that of its object; without one, or if another has it too, that is "LINK_0", "LINK_1" and so on, as
    in Pinocchio, whose own reader leaves out every shape of a link that has a capsule. A mesh is its convex hull, as it is to
    MuJoCo. Its file is looked for where the URDF says, "package://" as `hqp_rp.robot.mesh_files.resolved` says, and beside
    the URDF.

    Args:
        model: the `pinocchio.Model` of that file.
        meshes: False leaves out meshes; "if found" those whose files are not there, and warns in one sentence.
        package_paths: folders that hold packages.

    Raises:
        RobotError: a shape that is none of these or has no positive size; a mesh that is not found or not read.
    """
    root = parse_urdf(path)
    geometry = pin.GeometryModel()
    absent: list[str] = []
    collisions = [
        (link, i, item) for link in root.iterfind("link") for i, item in enumerate(link.iterfind("collision"))
    ]
    stated = [item.get("name") for _, _, item in collisions]
    for link, i, item in collisions:
        owner, name = link.get("name", ""), item.get("name")
        shape = item.find("geometry")
        shape = shape[0] if shape is not None and len(shape) else None
        if not meshes and shape is not None and shape.tag == "mesh":
            continue
        where = f"The URDF file {os.fspath(path)!r}: link {owner!r}"
        frame = model.frames[model.getFrameId(owner, pin.FrameType.BODY)]
        origin = item.find("origin")
        placement = frame.placement * (pin.SE3.Identity() if origin is None else _urdf_origin(origin, where))
        if shape is not None and shape.tag == "mesh":
            file = _mesh_file(shape.get("filename", ""), pathlib.Path(path), root, package_paths)
            if file is None and meshes == "if found":
                absent.append(shape.get("filename", ""))
                continue
            body = _urdf_mesh(shape, file, where)
        else:
            body = _urdf_shape(shape, where)
        own_name = name if name and stated.count(name) == 1 else f"{owner}_{i}"
        frame_id = model.getFrameId(owner, pin.FrameType.BODY)
        geometry.addGeometryObject(pin.GeometryObject(own_name, frame.parentJoint, frame_id, placement, body))
    if absent:
        count = len([item for _, _, item in collisions if item.find("geometry/mesh") is not None])
        warn_of_lost(pathlib.Path(path), count, absent, [])
    return geometry


def geometry_of_arm(model: Any, arm: DHArm) -> Any:
    """The `pinocchio.GeometryModel` of an arm: the capsules (or spheres) of its links, as `arm_spec` has them."""
    geometry = pin.GeometryModel()
    for link in arm.links:
        frame_id = model.getFrameId(link.name)
        length = float(np.linalg.norm(link.end))
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), np.asarray(link.end)) if length else None
        rotation = np.eye(3) if turn is None else turn.toRotationMatrix()
        placement = model.frames[frame_id].placement * pin.SE3(rotation, 0.5 * np.asarray(link.end))
        shape = coal.Capsule(link.radius, length) if length else coal.Sphere(link.radius)
        joint = model.frames[frame_id].parentJoint
        geometry.addGeometryObject(pin.GeometryObject(link.name, joint, frame_id, placement, shape))
    return geometry


def geometry_from_mujoco(source: mujoco.MjModel, carriers: Sequence[tuple[int, Any]]) -> tuple[Any, Geoms]:
    """The `pinocchio.GeometryModel` of a compiled MuJoCo model, and its names and filter, which stay MuJoCo's.

    A plane is a half-space and a mesh its convex hull, as they are to MuJoCo. Height fields and signed distance fields are
    left out; naming one is an error.

    Args:
        carriers: of each body its joint, and its placement in that joint's frame; see `model_from_mujoco`.
    """
    from hqp_rp.robot.mujoco_model import geoms_of

    geometry, table = pin.GeometryModel(), geoms_of(source)
    refused = dict(table.refused)
    for i in range(source.ngeom):
        try:
            shape = _mujoco_shape(source, i)
        except RobotError as error:
            refused.setdefault(i, str(error))
            continue
        joint, placement = carriers[source.geom_bodyid[i]]
        w, x, y, z = (float(value) for value in source.geom_quat[i])
        local = pin.SE3(pin.Quaternion(w, x, y, z).normalized().toRotationMatrix(), source.geom_pos[i].copy())
        geometry.addGeometryObject(pin.GeometryObject(table.shown[i], joint, placement * local, shape))
    return geometry, dataclasses.replace(table, refused=refused)


def geoms_of(model: Any, geometry: Any) -> Geoms:
    """Names and collision filter of the objects of a `pinocchio.GeometryModel`: bodies are the frames that carry them.

    An object with `disableCollision` does not collide.
    """
    objects = list(geometry.geometryObjects)
    frames = [int(item.parentFrame) for item in objects]
    rigid = [int(item.parentJoint) for item in objects]
    standing = standing_geoms(frames, [not item.disableCollision for item in objects])
    bodies: dict[str, tuple[int, ...]] = {frame.name: () for frame in model.frames if frame.type == pin.FrameType.BODY}
    for i, frame in enumerate(frames):
        if frame < len(model.frames) and standing[i]:
            bodies[model.frames[frame].name] = (*bodies.get(model.frames[frame].name, ()), i)
    bearing = {0, *rigid, *(int(frame.parentJoint) for frame in model.frames if frame.type == pin.FrameType.BODY)}
    return Geoms(
        shown=[item.name for item in objects],
        names={item.name: i for i, item in enumerate(objects)},
        bodies=bodies,
        standing=standing,
        rigid=rigid,
        parent=[_parent(model, joint, bearing) for joint in rigid],
        planes=frozenset(i for i, item in enumerate(objects) if isinstance(item.geometry, _PLANES)),
        refused={
            i: "a height field or an octree"
            for i, item in enumerate(objects)
            if item.geometry.getObjectType() in (coal.OBJECT_TYPE.OT_HFIELD, coal.OBJECT_TYPE.OT_OCTREE)
        },
    )


def convex_hull(points: FloatArray) -> Any:
    """The `coal.Convex` around points (N, 3), m. Raises `RobotError` where they have no volume."""
    points = np.asarray(points, dtype=np.float64)
    extents = np.linalg.svd(points - points.mean(axis=0), compute_uv=False) if len(points) > 3 else np.zeros(3)
    if not extents[2] > _FLAT * extents[0]:
        raise RobotError("a mesh without volume")
    stored = coal.StdVec_Vec3s()
    stored.extend(points)
    return coal.Convex.convexHull(stored, True, "Qt")  # Qt: facets as triangles, as True asks for


def _parent(model: Any, joint: int, bearing: set[int]) -> int:
    """The nearest joint above that carries a body; several joints in a row move one body."""
    above = int(model.parents[joint])
    while above not in bearing:
        above = int(model.parents[above])
    return above


def _urdf_origin(origin: ElementTree.Element, where: str) -> Any:
    position = _numbers(origin.get("xyz", "0 0 0"), 3, f"{where} has a collision whose origin has xyz")
    angles = _numbers(origin.get("rpy", "0 0 0"), 3, f"{where} has a collision whose origin has rpy")
    return pin.SE3(pin.rpy.rpyToMatrix(*angles), position)


def _urdf_shape(shape: ElementTree.Element | None, where: str) -> Any:
    kind = "nothing" if shape is None else shape.tag
    if shape is None or kind not in _URDF_SIZES:
        raise RobotError(f"{where} has a collision with {kind}; it must be box, sphere, cylinder, capsule or mesh.")
    what = f"{where} has a collision {kind} with"
    values = [
        _numbers(shape.get(size, ""), 3 if kind == "box" else 1, f"{what} {size}", positive=True)
        for size in _URDF_SIZES[kind]
    ]
    if kind == "box":
        return coal.Box(values[0])
    classes = {"sphere": coal.Sphere, "cylinder": coal.Cylinder, "capsule": coal.Capsule}
    return classes[kind](*(float(value[0]) for value in values))


def _urdf_mesh(shape: ElementTree.Element, file: pathlib.Path | None, where: str) -> Any:
    name = shape.get("filename", "")
    scale = _numbers(shape.get("scale", "1 1 1"), 3, f"{where} has a collision mesh with scale")
    hint = "Its mesh files can be left out with meshes=False."
    if file is None:
        raise RobotError(
            f"{where} has the collision mesh {name!r}, which is not there: give package_paths=[FOLDER], the folder that holds "
            f"its package. {hint}"
        )
    try:
        mesh = coal.MeshLoader().load(str(file), scale)
    except (ValueError, RuntimeError) as error:
        raise RobotError(
            f"{where} has the collision mesh {name!r}, which is not read: {one_line(error)} {hint}"
        ) from error
    try:
        return convex_hull(mesh.vertices())
    except RobotError:
        return mesh  # no error until it is measured


def _mesh_file(
    name: str, urdf: pathlib.Path, root: ElementTree.Element, package_paths: Sequence[pathlib.Path]
) -> pathlib.Path | None:
    """The file of a mesh, or None where there is none."""
    found = resolved(name if "://" in name else str(urdf.parent / name), urdf, package_paths)
    if found is not None:
        return found
    # As MuJoCo finds it: by its bare name, in the folder that its own extension of URDF states.
    compiler = root.find("mujoco/compiler")
    folder = urdf.parent / ("" if compiler is None else compiler.get("meshdir", ""))
    beside = folder / pathlib.PurePosixPath(name.rpartition("://")[2]).name
    return beside if beside.is_file() else None


def _numbers(text: str, count: int, what: str, *, positive: bool = False) -> FloatArray:
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.empty(0)
    if len(values) != count or not np.isfinite(values).all() or (positive and not (values > 0.0).all()):
        wanted = "one number" if count == 1 else f"{count} numbers"
        raise RobotError(f"{what} {text!r}; it must be {wanted}{' > 0' if positive else ''}.")
    return values


def _mujoco_shape(source: mujoco.MjModel, i: int) -> Any:
    """The shape of a geom. Raises `RobotError`, whose text is what it is, for one that Pinocchio does not measure here."""
    import mujoco

    kind, size = mujoco.mjtGeom(int(source.geom_type[i])), source.geom_size[i]
    a, b, c = (float(value) for value in size)
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        return convex_hull(_hull_points(source, int(source.geom_dataid[i])))
    shapes = {
        mujoco.mjtGeom.mjGEOM_PLANE: lambda: coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0),
        mujoco.mjtGeom.mjGEOM_SPHERE: lambda: coal.Sphere(a),
        mujoco.mjtGeom.mjGEOM_CAPSULE: lambda: coal.Capsule(a, 2.0 * b),
        mujoco.mjtGeom.mjGEOM_ELLIPSOID: lambda: coal.Ellipsoid(a, b, c),
        mujoco.mjtGeom.mjGEOM_CYLINDER: lambda: coal.Cylinder(a, 2.0 * b),
        mujoco.mjtGeom.mjGEOM_BOX: lambda: coal.Box(2.0 * size),
    }
    if kind not in shapes:
        raise RobotError("a height field" if kind == mujoco.mjtGeom.mjGEOM_HFIELD else "a signed distance field")
    return shapes[kind]()


def _hull_points(source: mujoco.MjModel, mesh: int) -> FloatArray:
    """(N, 3) m, the vertices that MuJoCo's own hull of the mesh has; all of them where it made none."""
    start = int(source.mesh_vertadr[mesh])
    points = np.array(source.mesh_vert[start : start + int(source.mesh_vertnum[mesh])], dtype=np.float64)
    graph = int(source.mesh_graphadr[mesh])
    if graph < 0:
        return points
    count = int(source.mesh_graph[graph])
    hull: FloatArray = points[source.mesh_graph[graph + 2 + count : graph + 2 + 2 * count]]
    return hull
