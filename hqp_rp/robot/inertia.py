"""Inertias that no rigid body can have, as model files often state them, made acceptable to MuJoCo."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hqp_rp.core.problem import FloatArray

if TYPE_CHECKING:
    import mujoco

# kg and kg m^2: far below anything of a real robot, far above MuJoCo's own limit of 1e-15.
SMALLEST = 1e-12


def nearest_principal_inertia(principal: FloatArray) -> FloatArray:
    """(3,) principal inertias of a rigid body, nearest in least squares to `principal` (3,) kg m^2, ascending.

    A rigid body has `0 < A <= B <= C <= A + B`. Values below 1e-12 are raised to it; an excess d = C - A - B > 0 is
    shared: A + d/3, B + d/3, C - d/3.
    """
    a, b, c = np.maximum(np.sort(principal), SMALLEST).tolist()
    excess = c - a - b
    if excess > 0.0:
        # A hair more than the boundary, so that rounding does not put it back outside.
        share = excess / 3.0 + 1e-9 * c
        a, b, c = a + share, b + share, c - share
    return np.sort([a, b, c])


def repair(spec: mujoco.MjSpec) -> None:
    """Replace each inertia that MuJoCo refuses by the nearest one it accepts, in the spec itself.

    Massless moving links (virtual links between two joints) get 1e-12 kg and kg m^2.
    """
    import mujoco

    spec.compiler.boundmass = SMALLEST
    spec.compiler.boundinertia = SMALLEST
    for body in spec.bodies:
        if body.name == "world" or not body.explicitinertial:
            continue
        full = np.array(body.fullinertia)
        if np.isfinite(full).all():
            xx, yy, zz, xy, xz, yz = full
            principal, axes = np.linalg.eigh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            axes[:, 2] *= np.sign(np.linalg.det(axes))
        else:
            order = np.argsort(body.inertia)
            principal, axes = np.array(body.inertia)[order], np.eye(3)[:, order]
            axes[:, 2] *= np.sign(np.linalg.det(axes))
        if principal[0] >= SMALLEST and principal[0] + principal[1] >= principal[2]:
            continue
        turn, frame = np.empty(4), np.empty(4)
        mujoco.mju_mat2Quat(turn, np.ascontiguousarray(axes).ravel())
        mujoco.mju_mulQuat(frame, np.array(body.iquat), turn)
        body.fullinertia = [np.nan, 0.0, 0.0, 0.0, 0.0, 0.0]
        body.inertia = nearest_principal_inertia(principal)
        body.iquat = frame
