"""Rotations: the logarithm of SO(3), and vectors in turned axes."""

from __future__ import annotations

import math

from hqp_rp.core.kernels.compile import inlined, lean


@lean
def rotation_vector(R, r):
    """r (3,) <- log R, with 0 <= |r| <= pi, through the largest of the four forms of the quaternion (Shepperd 1978)."""
    a, b, c = R[0, 0], R[0, 1], R[0, 2]
    d, e, f = R[1, 0], R[1, 1], R[1, 2]
    g, h, i = R[2, 0], R[2, 1], R[2, 2]
    trace = a + e + i
    largest = max(max(trace, a), max(e, i))
    # Four times the product of one quaternion component with all of them; the common factor drops out below.
    if largest == trace:
        w, x, y, z = 1.0 + trace, h - f, c - g, d - b
    elif largest == a:
        w, x, y, z = h - f, 1.0 + a - e - i, b + d, c + g
    elif largest == e:
        w, x, y, z = c - g, b + d, 1.0 - a + e - i, f + h
    else:
        w, x, y, z = d - b, c + g, f + h, 1.0 - a - e + i
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = math.sqrt(x * x + y * y + z * z)  # squares that underflow are below what the test of `factor` looks at
    # atan2(s, w) / s tends to 1 / w: below 1e-9 the next term of the series, (s / w)^2 / 3, is lost in rounding.
    factor = 2.0 * math.atan2(sine, w) / sine if sine > 1e-9 * w else 2.0 / w
    r[0], r[1], r[2] = factor * x, factor * y, factor * z


@inlined
def turned(R, v, out):
    """out (3,) <- R^T v."""
    for i in range(3):
        out[i] = R[0, i] * v[0] + R[1, i] * v[1] + R[2, i] * v[2]


@lean
def rotation_error(R_target, R, product, r):
    """r (3,) <- log(R_target R^T); product (3, 3) is room."""
    for i in range(3):
        for j in range(3):
            product[i, j] = R_target[i, 0] * R[j, 0] + R_target[i, 1] * R[j, 1] + R_target[i, 2] * R[j, 2]
    rotation_vector(product, r)
