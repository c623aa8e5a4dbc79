"""Rotations as matrices: the logarithm of SO(3), quaternions, the cross-product matrix."""

from __future__ import annotations

import numpy as np

from hqp_rp.core import _native
from hqp_rp.core.problem import FloatArray


def rotation_log(R: FloatArray) -> FloatArray:
    """The rotation vector r (3,) in rad, 0 <= |r| <= pi, with R = exp([r]x); R is a rotation matrix (3, 3).

    Through the quaternion of Shepperd 1978 (the largest of four forms), so it keeps full accuracy near angle 0 and near
    pi. At exactly pi both r and -r are right: the one whose largest component is positive is returned.
    """
    r: FloatArray = _native.rotation_vector(np.ascontiguousarray(R, dtype=np.float64))
    return r


def quaternion_to_matrix(quaternion: FloatArray) -> FloatArray:
    """The rotation matrix (3, 3) of a unit quaternion (4,) in the order (w, x, y, z)."""
    w, x, y, z = quaternion.tolist()
    return np.array(
        (
            (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
            (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
            (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
        )
    )


def nearest_rotation(matrix: FloatArray) -> FloatArray:
    """The orthogonal factor of the polar decomposition: the rotation nearest to `matrix` (3, 3)."""
    U, _, Vt = np.linalg.svd(matrix)
    nearest: FloatArray = U @ Vt
    return nearest


def point_jacobian(J: FloatArray, lever: FloatArray) -> FloatArray:
    """(3, nv) linear Jacobian of the point at `lever` (3,), m in world axes, from the origin of the frame of J (6, nv)."""
    moved: FloatArray = J[:3] - skew(lever) @ J[3:]
    return moved


def skew(vector: FloatArray) -> FloatArray:
    """[a]x (3, 3), with [a]x b = a x b."""
    x, y, z = vector.tolist()
    return np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
