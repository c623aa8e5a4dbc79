"""Kinematics of a serial arm from its Denavit-Hartenberg rows, on eight configurations side by side.

Coordinate (i, lane) of eight configurations lie next to each other, so that every operation but sine and cosine is one vector
operation on all of them.
"""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.compile import kernel

LANES = 8


@kernel
def turn(u, v, c, s):
    """u <- c u + s v, v <- c v - s u, each (3, 8), lane by lane."""
    for k in range(3):
        for lane in range(LANES):
            old = u[k, lane]
            u[k, lane] = c[lane] * old + s[lane] * v[k, lane]
            v[k, lane] = c[lane] * v[k, lane] - s[lane] * old


@kernel
def serial_arm(Q, d, a, cos_alpha, sin_alpha, frame, rotations, origins, jacobians):
    """Pose and Jacobian of one frame at Q (N, n): rotations (N, 3, 3), origins (N, 3), jacobians (N, 6, n).

    Frame i < n is fixed to link i + 1, with origin and z axis on its joint; frame n is the tool. Row i of the table carries
    frame i-1 to frame i by `Rot_z(q_i) Trans_z(d_i) Trans_x(a_i) Rot_x(alpha_i)`. Column k of the Jacobian, for a joint at or
    before the frame, is `[z_k x (p - o_k); z_k]`, z_k and o_k axis and origin of joint k; zero for later joints.
    """
    N, n = Q.shape
    moving = min(frame + 1, n)
    x, y, z = np.empty((3, LANES)), np.empty((3, LANES)), np.empty((3, LANES))
    o = np.empty((3, LANES))
    axes, joints = np.empty((n, 3, LANES)), np.empty((n, 3, LANES))
    columns = np.empty((n, 6, LANES))
    c, s = np.empty(LANES), np.empty(LANES)
    for first in range(0, N, LANES):
        for k in range(3):
            for lane in range(LANES):
                x[k, lane] = 1.0 if k == 0 else 0.0
                y[k, lane] = 1.0 if k == 1 else 0.0
                z[k, lane] = 1.0 if k == 2 else 0.0
                o[k, lane] = 0.0
        for i in range(moving):
            for lane in range(LANES):
                angle = Q[min(first + lane, N - 1), i]
                c[lane] = math.cos(angle)
                s[lane] = math.sin(angle)
            turn(x, y, c, s)
            for k in range(3):
                for lane in range(LANES):
                    axes[i, k, lane] = z[k, lane]
                    joints[i, k, lane] = o[k, lane]
            if i == frame:
                break
            for k in range(3):
                for lane in range(LANES):
                    o[k, lane] += d[i] * z[k, lane] + a[i] * x[k, lane]
            for lane in range(LANES):
                c[lane] = cos_alpha[i]
                s[lane] = sin_alpha[i]
            turn(y, z, c, s)
        for k in range(moving):
            for r in range(3):
                i, j = (r + 1) % 3, (r + 2) % 3
                for lane in range(LANES):
                    columns[k, r, lane] = axes[k, i, lane] * (o[j, lane] - joints[k, j, lane]) - axes[k, j, lane] * (
                        o[i, lane] - joints[k, i, lane]
                    )
                    columns[k, 3 + r, lane] = axes[k, r, lane]
        for lane in range(min(LANES, N - first)):
            at = first + lane
            for k in range(3):
                rotations[at, k, 0] = x[k, lane]
                rotations[at, k, 1] = y[k, lane]
                rotations[at, k, 2] = z[k, lane]
                origins[at, k] = o[k, lane]
            for r in range(6):
                for k in range(moving):
                    jacobians[at, r, k] = columns[k, r, lane]
                for k in range(moving, n):
                    jacobians[at, r, k] = 0.0
