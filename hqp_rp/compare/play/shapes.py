"""The geometry of a MuJoCo model as triangles, body by body: what a page draws. Arrays only, no graphics library."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
from numpy.typing import NDArray

from hqp_rp.control.pointing_task import basis_with
from hqp_rp.core.problem import FloatArray

_SIDES = 24  # around
_RINGS = 8  # of a half sphere
_GREY = np.array([0.5, 0.5, 0.5, 1.0])
_HIDDEN_GROUP = 3  # MuJoCo's viewers show geoms of groups 0 to 2


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """One geom, in the axes of its body.

    Attributes:
        name: the geom's, or "geom NUMBER". body: the number of its body.
        vertices: (V, 3) m. faces: (F, 3) indices of vertices, counterclockwise seen from outside.
        color: (4,) red, green, blue and opacity, 0 to 1.
    """

    name: str
    body: int
    vertices: FloatArray
    faces: NDArray[np.int64]
    color: FloatArray


def shapes_of(model: mujoco.MjModel) -> tuple[Shape, ...]:
    """Boxes, spheres, capsules, cylinders, ellipsoids and meshes of a model, those that MuJoCo's viewers show at first.

    Where a model shows none of these, all that are not wholly transparent. Planes, height fields and signed
    distance fields are left out.
    """
    seen = {
        g: made for g in range(model.ngeom) if model.geom_rgba[g, 3] > 0.0 and (made := _surface(model, g)) is not None
    }
    found = []
    for g in [g for g in seen if model.geom_group[g] < _HIDDEN_GROUP] or seen:
        vertices, faces = seen[g]
        R = np.empty(9)
        mujoco.mju_quat2Mat(R, model.geom_quat[g])
        vertices = vertices @ R.reshape(3, 3).T + model.geom_pos[g]
        color = np.array(model.geom_rgba[g], dtype=np.float64)
        material = int(model.geom_matid[g])
        if material >= 0 and (color == 0.5).all(
            where=[True, True, True, False]
        ):  # MuJoCo's default: the material counts
            color = np.array(model.mat_rgba[material], dtype=np.float64)
        found.append(Shape(model.geom(g).name or f"geom {g}", int(model.geom_bodyid[g]), vertices, faces, color))
    return tuple(found)


def skeleton_of(model: mujoco.MjModel) -> tuple[Shape, ...]:
    """Bars from each body's origin to those of the bodies that hang on it: what is drawn of a model without geometry.

    MuJoCo keeps of a URDF what collides, and drops what is only to be seen.
    """
    reach = np.linalg.norm(model.body_pos[1:], axis=1)
    radius = 0.06 * float(reach.max(initial=0.0)) or 0.05
    found = []
    for body in range(1, model.nbody):
        name, parent, end = model.body(body).name, int(model.body_parentid[body]), np.array(model.body_pos[body])
        length = float(np.linalg.norm(end))
        ball, faces = revolved(1.5 * radius * _ball())
        found.append(Shape(f"joint of {name}", body, ball, faces, _GREY))
        if length > radius:
            bar, faces = revolved(np.array([[0.0, length], [radius, length], [radius, 0.0], [0.0, 0.0]]))
            found.append(Shape(f"bar to {name}", parent, bar @ basis_with(end / length).T, faces, _GREY))
    return tuple(found)


def _ball() -> FloatArray:
    """(radius, height) of half a circle of radius 1, from pole to pole."""
    around = np.linspace(0.0, np.pi, 2 * _RINGS + 1)
    profile: FloatArray = np.stack([np.sin(around), np.cos(around)], axis=1)
    return profile


def _surface(model: mujoco.MjModel, g: int) -> tuple[FloatArray, NDArray[np.int64]] | None:
    """Vertices and faces of a geom in its own axes; None for a kind that is not drawn."""
    kind, (a, b, c) = int(model.geom_type[g]), model.geom_size[g].tolist()
    geoms = mujoco.mjtGeom
    if kind == geoms.mjGEOM_MESH:
        return _mesh(model, int(model.geom_dataid[g]))
    if kind == geoms.mjGEOM_BOX:
        return box(a, b, c)
    ball = _ball()
    cap = ball[: _RINGS + 1]  # from the pole to the equator
    if kind == geoms.mjGEOM_SPHERE:
        return revolved(a * ball)
    if kind == geoms.mjGEOM_ELLIPSOID:
        vertices, faces = revolved(ball)
        return vertices * (a, b, c), faces
    if kind == geoms.mjGEOM_CYLINDER:
        return revolved(np.array([[0.0, b], [a, b], [a, -b], [0.0, -b]]))
    if kind == geoms.mjGEOM_CAPSULE:
        return revolved(np.concatenate([a * cap + (0.0, b), (a * cap * (1.0, -1.0))[::-1] - (0.0, b)]))
    return None


def revolved(profile: FloatArray, sides: int = _SIDES) -> tuple[FloatArray, NDArray[np.int64]]:
    """The surface that a profile (K, 2) of radius and height draws around z; its first and last point are on the axis.

    Heights fall from first to last. Returns vertices (V, 3) and faces (F, 3), outward.
    """
    angles = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    rings = [np.column_stack([radius * circle, np.full(sides, z)]) for radius, z in profile[1:-1].tolist()]
    top, bottom = [[0.0, 0.0, profile[0, 1]]], [[0.0, 0.0, profile[-1, 1]]]
    vertices = np.concatenate([top, *rings, bottom])
    i = np.arange(sides)
    j = (i + 1) % sides
    faces = [np.stack([np.zeros(sides, dtype=np.int64), 1 + i, 1 + j], axis=1)]
    for ring in range(len(rings) - 1):
        upper, lower = 1 + ring * sides, 1 + (ring + 1) * sides
        faces.append(np.stack([upper + i, lower + i, lower + j], axis=1))
        faces.append(np.stack([upper + i, lower + j, upper + j], axis=1))
    last = 1 + (len(rings) - 1) * sides
    faces.append(np.stack([last + i, np.full(sides, len(vertices) - 1), last + j], axis=1))
    return vertices, np.concatenate(faces)


def box(a: float, b: float, c: float) -> tuple[FloatArray, NDArray[np.int64]]:
    """Vertices (8, 3) and faces (12, 3), outward, of a box of half sizes a, b, c."""
    corners = np.array([[x, y, z] for x in (-a, a) for y in (-b, b) for z in (-c, c)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([face for p, q, r, s in quads for face in ((p, q, r), (p, r, s))], dtype=np.int64)


def _mesh(model: mujoco.MjModel, mesh: int) -> tuple[FloatArray, NDArray[np.int64]] | None:
    if mesh < 0:
        return None
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    face, faces = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    vertices = np.array(model.mesh_vert[first : first + count], dtype=np.float64).reshape(-1, 3)
    return vertices, np.array(model.mesh_face[face : face + faces], dtype=np.int64).reshape(-1, 3)
