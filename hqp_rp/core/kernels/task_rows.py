"""Rows of a stack's tasks and limits from the poses and Jacobians of frames: all of them in one call.

A task or limit is a row of `items` and a run of `numbers`. `items` (K, 7) holds for each

    kind, m, its first row, start of its numbers, its frame, the frame of its axes (-1: the world), start of its indices

and `numbers`, from that start on, gain (m), weight (m), then what the kind needs (see each function). Frames are numbered as
in `rotations` (F, 3, 3), `origins` (F, 3) and `jacobians` (F, 6, n); Jacobians hold the velocity of the frame's origin over
the angular velocity, in world axes.
"""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.box_rows import box_limit
from hqp_rp.core.kernels.compile import inlined, kernel, lean
from hqp_rp.core.kernels.room import as_matrix, as_vector
from hqp_rp.core.kernels.rotation import rotation_error, turned
from hqp_rp.core.kernels.row_kinds import BOX, FRAME, POSTURE, RELATIVE, TWIST


@inlined
def frame_row(J, rotations, axes, axis, w, row):
    """row (n,) <- w times row `axis` of J (6, n), in the world's axes or, for axes >= 0, in those of that frame."""
    if axes < 0:
        for j in range(len(row)):
            row[j] = w * J[axis, j]
        return
    R = rotations[axes]
    half = 3 if axis >= 3 else 0
    x, y, z = w * R[0, axis - half], w * R[1, axis - half], w * R[2, axis - half]
    for j in range(len(row)):
        row[j] = x * J[half, j] + y * J[half + 1, j] + z * J[half + 2, j]


@lean
def frame_task(header, index, numbers, rotations, origins, jacobians, plain, matrix, rate, room, product):
    """Position over orientation along chosen axes: numbers gain, weight, world feed-forward (6), R* (9), p* (3); index: axes.

    `[R_f^T J_p - [e_p]x R_f^T J_omega,f; R_f^T J_omega]` and `e = [R_f^T (p* - p); R_f^T log(R* R^T)]`.
    """
    m, row, at, f, axes, start = header[1], header[2], header[3], header[4], header[5], header[6]
    n = matrix.shape[1]
    J = jacobians[f]
    forward = numbers[at + 2 * m : at + 2 * m + 6]
    target = as_matrix(numbers[at + 2 * m + 6 : at + 2 * m + 15], 3, 3)
    place = numbers[at + 2 * m + 15 : at + 2 * m + 18]
    e, feed, world = room[0], room[1], room[2]
    linear, angular = False, False
    for i in range(m):
        if index[start + i] < 3:
            linear = True
        else:
            angular = True
    if linear:
        for k in range(3):
            e[k] = place[k] - origins[f, k]
    if angular:
        rotation_error(target, rotations[f], product, e[3:])
    for k in range(6):
        feed[k] = forward[k]
    if axes >= 0:
        for half in range(0, 6, 3):
            for k in range(3):
                world[k] = e[half + k]
                world[3 + k] = feed[half + k]
            turned(rotations[axes], world, e[half:])
            turned(rotations[axes], world[3:], feed[half:])
    for i in range(m):
        axis = index[start + i]
        w = 1.0 if plain else numbers[at + m + i]
        rate[row + i] = e[axis] if plain else w * (feed[axis] + numbers[at + i] * e[axis])
        frame_row(J, rotations, axes, axis, w, matrix[row + i])
        if axes >= 0 and axis < 3:
            # ([e]x R^T omega)_c = e_a (R^T omega)_b - e_b (R^T omega)_a with (c, a, b) in cyclic order
            R, turning = rotations[axes], jacobians[axes]
            a, b = (axis + 1) % 3, (axis + 2) % 3
            x = w * (e[a] * R[0, b] - e[b] * R[0, a])
            y = w * (e[a] * R[1, b] - e[b] * R[1, a])
            z = w * (e[a] * R[2, b] - e[b] * R[2, a])
            for j in range(n):
                matrix[row + i, j] -= x * turning[3, j] + y * turning[4, j] + z * turning[5, j]


@lean
def twist_task(header, index, numbers, rotations, jacobians, plain, matrix, rate):
    """A commanded velocity: numbers gain (not used), weight, velocity (m); index: axes. Rows `(R_f^T J)[axes]`."""
    m, row, at, f, axes, start = header[1], header[2], header[3], header[4], header[5], header[6]
    for i in range(m):
        w = 1.0 if plain else numbers[at + m + i]
        rate[row + i] = w * numbers[at + 2 * m + i]
        frame_row(jacobians[f], rotations, axes, index[start + i], w, matrix[row + i])


@lean
def posture_task(header, index, numbers, values, plain, matrix, rate):
    """Chosen joints: numbers gain, weight, feed-forward, target (m each).

    index: velocities (m), then where in `values` their coordinates are (m).
    """
    m, row, at, start = header[1], header[2], header[3], header[6]
    for i in range(m):
        w = 1.0 if plain else numbers[at + m + i]
        error = numbers[at + 3 * m + i] - values[index[start + m + i]]
        rate[row + i] = error if plain else w * (numbers[at + 2 * m + i] + numbers[at + i] * error)
        for j in range(matrix.shape[1]):
            matrix[row + i, j] = 0.0
        matrix[row + i, index[start + i]] = w


@lean
def relative_task(header, index, numbers, rotations, origins, jacobians, plain, matrix, rate, room, product):
    """Pose of frame b (`header`'s frame) seen from a (the frame of the axes): numbers as of `frame_task`, all in a's axes.

    `e = [p* - R_a^T (p_b - p_a); log(R* (R_a^T R_b)^T)]`,
    `J = [R_a^T (J_p,b - J_p,a + [p_b - p_a]x J_omega,a); R_a^T (J_omega,b - J_omega,a)]`.
    """
    m, row, at, b, a, start = header[1], header[2], header[3], header[4], header[5], header[6]
    n = matrix.shape[1]
    target = as_matrix(numbers[at + 2 * m + 6 : at + 2 * m + 15], 3, 3)
    R_a, R_b, J_a, J_b = rotations[a], rotations[b], jacobians[a], jacobians[b]
    e, between, local = room[0], room[1], room[2]
    for k in range(3):
        between[k] = origins[b, k] - origins[a, k]
    turned(R_a, between, local)
    for k in range(3):
        e[k] = numbers[at + 2 * m + 15 + k] - local[k]
    # R* R^T with R^T = R_b^T R_a
    seen = product[:3]
    for i in range(3):
        for j in range(3):
            seen[i, j] = R_a[0, i] * R_b[0, j] + R_a[1, i] * R_b[1, j] + R_a[2, i] * R_b[2, j]
    rotation_error(target, seen, product[3:], e[3:])
    for i in range(m):
        axis = index[start + i]
        w = 1.0 if plain else numbers[at + m + i]
        error = e[axis]
        rate[row + i] = error if plain else w * (numbers[at + 2 * m + axis] + numbers[at + i] * error)
        half = 3 if axis >= 3 else 0
        x, y, z = R_a[0, axis - half], R_a[1, axis - half], R_a[2, axis - half]
        for j in range(n):
            matrix[row + i, j] = (
                x * (J_b[half, j] - J_a[half, j])
                + y * (J_b[half + 1, j] - J_a[half + 1, j])
                + z * (J_b[half + 2, j] - J_a[half + 2, j])
            )
        if half == 0:
            # r . ([d]x omega) = (r x d) . omega
            u = y * between[2] - z * between[1]
            v = z * between[0] - x * between[2]
            s = x * between[1] - y * between[0]
            for j in range(n):
                matrix[row + i, j] += u * J_a[3, j] + v * J_a[4, j] + s * J_a[5, j]
        if w != 1.0:
            for j in range(n):
                matrix[row + i, j] *= w


@lean
def pointing_task(header, numbers, rotations, jacobians, plain, matrix, rate, room, product):
    """An axis onto a direction: numbers gain, weight (2), feed-forward (3), basis (9), direction d (3); two rows.

    With B = R basis = (b1, b2, a): `e = theta (-d . b2, d . b1) / |a x d|`, `J = (b1, b2)^T J_omega`.
    """
    row, at, f = header[2], header[3], header[4]
    R, J = rotations[f], jacobians[f]
    basis = as_matrix(numbers[at + 7 : at + 16], 3, 3)
    B = product[:3]
    for i in range(3):
        for j in range(3):
            B[i, j] = R[i, 0] * basis[0, j] + R[i, 1] * basis[1, j] + R[i, 2] * basis[2, j]
    d = room[0]
    turned(B, numbers[at + 16 : at + 19], d)
    sine = math.hypot(d[0], d[1])
    if sine > 0.0:
        factor = math.atan2(sine, d[2]) / sine
        first, second = -factor * d[1], factor * d[0]
    else:
        first, second = (0.0 if d[2] > 0.0 else math.pi), 0.0
    forward = room[1]
    turned(B, numbers[at + 4 : at + 7], forward)
    for i in range(2):
        w = 1.0 if plain else numbers[at + 2 + i]
        error = first if i == 0 else second
        rate[row + i] = error if plain else w * (forward[i] + numbers[at + i] * error)
        for j in range(matrix.shape[1]):
            matrix[row + i, j] = w * (B[0, i] * J[3, j] + B[1, i] * J[4, j] + B[2, i] * J[5, j])


@lean
def task_rows(items, index, numbers, rotations, origins, jacobians, values, plain, matrix, lower, upper, room, product):
    """Fill the rows of all tasks and limits in matrix (M, n), lower and upper (M,), then judge all rows.

    Rows of other items stand in the arrays already. `upper` is empty where every row is an equality. `values`: coordinates
    that posture tasks and limits refer to, dt, and the velocity before the step. `plain`: rows without weights, and errors in
    the place of rates. room (3, 6) and product (6, 3) are overwritten. True where every entry of the matrix is finite, bounds
    are ordered, and each row has an answer.
    """
    one_sided = upper.shape[0] == 0
    for k in range(items.shape[0]):
        header = items[k]
        kind = header[0]
        if kind == BOX:
            box_limit(header, index, numbers, values, matrix, lower, upper)
            continue
        if kind == FRAME:
            frame_task(header, index, numbers, rotations, origins, jacobians, plain, matrix, lower, room, product)
        elif kind == TWIST:
            twist_task(header, index, numbers, rotations, jacobians, plain, matrix, lower)
        elif kind == POSTURE:
            posture_task(header, index, numbers, values, plain, matrix, lower)
        elif kind == RELATIVE:
            relative_task(header, index, numbers, rotations, origins, jacobians, plain, matrix, lower, room, product)
        else:
            pointing_task(header, numbers, rotations, jacobians, plain, matrix, lower, room, product)
        if not one_sided:
            for i in range(header[2], header[2] + header[1]):
                upper[i] = lower[i]
    # Zero times anything finite is zero; times nan or infinity it is nan, which no sum loses.
    total = 0.0
    entries = as_vector(matrix)
    for i in range(len(entries)):
        total += 0.0 * entries[i]
    sound = True
    for i in range(matrix.shape[0]):
        if one_sided:
            total += 0.0 * lower[i]
        else:
            sound = sound and lower[i] <= upper[i] and lower[i] < np.inf and upper[i] > -np.inf
    return sound and total == 0.0


@kernel
def many_task_rows(items, index, numbers, rotations, origins, jacobians, values, matrices, lowers, none):
    """`task_rows` of equalities at N configurations: every array but `items`, `index` and `numbers` has N entries.

    The number of the first configuration whose rows no solver can take, -1 where there is none.
    """
    room, product = np.empty((3, 6)), np.empty((6, 3))
    for i in range(len(matrices)):
        if not task_rows(
            items,
            index,
            numbers,
            rotations[i],
            origins[i],
            jacobians[i],
            values[i],
            False,
            matrices[i],
            lowers[i],
            none,
            room,
            product,
        ):
            return i
    return -1
