"""Poses and Jacobians of frames on a kinematic tree, read out of the memory in which a robot library keeps its state.

What a library computes at each step (poses, joint axes, anchors) stays at fixed addresses while its state lives. `tree`, int64,
names them once, so that a step copies nothing and calls no library. It holds, one after the other,

    F, where the dofs begin, where the bodies begin, B, address of the moving mass             `TREE_HEADER`
    of each frame:  address of its rotation (3, 3), of its origin (3), chain begin, chain end   `FRAME_ROW`
    of each dof:    address of its axis, bytes between the axis' entries, address of its anchor, 1 if it turns, its body
    of each moving body, leaves first:  itself, its parent, address of its mass, of its centre of mass (3)
    the chains:     for each frame the dofs that move it

A frame whose rotation has address 0 is the centre of mass of the moving bodies. Nothing is checked: whoever fills `tree` keeps
the memory alive.
"""

from __future__ import annotations

from hqp_rp.core.kernels.compile import lean
from hqp_rp.core.kernels.room import number_at
from hqp_rp.core.kernels.row_kinds import BODY_ROW, DOF_ROW, FRAME_ROW, TREE_HEADER


@lean
def tree_frames(tree, rotations, origins, jacobians, room):
    """Rotations (F, 3, 3), origins (F, 3) and world Jacobians (F, 6, n) of all frames; room is (bodies, 4).

    Column j of a frame with origin p, moved by a dof with axis a and anchor c: `[a x (p - c); a]` if it turns, `[a; 0]` if it
    slides. Columns of dofs that do not move the frame, and the angular half of those that slide, are left as they are: zero.
    """
    for f in range(tree[0]):
        row = TREE_HEADER + f * FRAME_ROW
        rotation, origin = tree[row], tree[row + 1]
        if rotation == 0:
            center_of_mass(tree, origins[f], jacobians[f], room)
            continue
        R, p, J = rotations[f], origins[f], jacobians[f]
        for i in range(3):
            for j in range(3):
                R[i, j] = number_at(rotation + 8 * (3 * i + j))
            p[i] = number_at(origin + 8 * i)
        for k in range(tree[row + 2], tree[row + 3]):
            column = tree[k]
            dof = tree[1] + column * DOF_ROW
            axis, step, anchor = tree[dof], tree[dof + 1], tree[dof + 2]
            x, y, z = number_at(axis), number_at(axis + step), number_at(axis + 2 * step)
            if tree[dof + 3] == 0:
                J[0, column], J[1, column], J[2, column] = x, y, z
                continue
            u, v, w = p[0] - number_at(anchor), p[1] - number_at(anchor + 8), p[2] - number_at(anchor + 16)
            J[0, column], J[1, column], J[2, column] = y * w - z * v, z * u - x * w, x * v - y * u
            J[3, column], J[4, column], J[5, column] = x, y, z


@lean
def center_of_mass(tree, c, J, room):
    """Centre of mass c (3,) of the moving bodies, of mass m, and the linear half of J (6, n).

    With the mass m_j and the centre c_j of all bodies that dof j carries: `J_j = m_j / m a x (c_j - anchor)` if it turns,
    `m_j / m a` if it slides.
    """
    mass = number_at(tree[4])
    dofs, bodies = tree[1], tree[2]
    for i in range(room.shape[0]):
        for k in range(4):
            room[i, k] = 0.0
    c[0], c[1], c[2] = 0.0, 0.0, 0.0
    # Leaves first: a body is complete when its parent takes it.
    for i in range(tree[3]):
        row = bodies + i * BODY_ROW
        body, parent, own, place = tree[row], tree[row + 1], number_at(tree[row + 2]), tree[row + 3]
        room[body, 3] += own
        room[parent, 3] += room[body, 3]
        for k in range(3):
            moment = own * number_at(place + 8 * k)
            room[body, k] += moment
            room[parent, k] += room[body, k]
            c[k] += moment / mass
    for j in range(J.shape[1]):
        dof = dofs + j * DOF_ROW
        axis, step, anchor, body = tree[dof], tree[dof + 1], tree[dof + 2], tree[dof + 4]
        x, y, z = number_at(axis) / mass, number_at(axis + step) / mass, number_at(axis + 2 * step) / mass
        own = room[body, 3]
        if tree[dof + 3] == 0:
            J[0, j], J[1, j], J[2, j] = own * x, own * y, own * z
            continue
        u = room[body, 0] - own * number_at(anchor)
        v = room[body, 1] - own * number_at(anchor + 8)
        w = room[body, 2] - own * number_at(anchor + 16)
        J[0, j], J[1, j], J[2, j] = y * w - z * v, z * u - x * w, x * v - y * u
