"""A serial chain computed by hand from axes and offsets: a `Robot` that shares no code with any robot library."""

from __future__ import annotations

import numpy as np


def expm_so3(r: np.ndarray) -> np.ndarray:
    """exp([r]x) by Rodrigues' formula."""
    angle = float(np.linalg.norm(r))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = r / angle
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


class Chain:
    """n hinges with axes (n, 3) in their own frames and offsets (n + 1, 3) between them; frames "link1" ... and "tool".

    The centre of mass is that of unit masses at the frames' origins.
    """

    def __init__(self, axes: np.ndarray, offsets: np.ndarray, limit: float = 2.0, velocity: float = 1.5) -> None:
        self.axes = axes / np.linalg.norm(axes, axis=1)[:, None]
        self.offsets = offsets
        self.nq = self.nv = len(axes)
        self.joint_names = tuple(f"joint{i + 1}" for i in range(self.nv))
        self.frame_names = (*(f"link{i + 1}" for i in range(self.nv)), "tool")
        self.lower, self.upper = np.full(self.nv, -limit), np.full(self.nv, limit)
        self.velocity_limit = np.full(self.nv, velocity)
        self.neutral = np.zeros(self.nv)
        self.update(self.neutral)

    def update(self, q: np.ndarray) -> None:
        self.q = np.array(q, dtype=float)
        R, p = np.eye(3), self.offsets[0].copy()
        self._poses, self._axes, self._origins = {}, [], []
        for i in range(self.nv):
            self._axes.append(R @ self.axes[i])
            self._origins.append(p.copy())
            R = R @ expm_so3(self.q[i] * self.axes[i])
            self._poses[f"link{i + 1}"] = (R.copy(), p.copy(), i + 1)
            p = p + R @ self.offsets[i + 1]
        self._poses["tool"] = (R.copy(), p.copy(), self.nv)

    def pose(self, frame: str):
        R, p, _ = self._poses[frame]
        return R, p

    def jacobian(self, frame: str) -> np.ndarray:
        _, p, moved_by = self._poses[frame]
        J = np.zeros((6, self.nv))
        for i in range(moved_by):
            J[:3, i] = np.cross(self._axes[i], p - self._origins[i])
            J[3:, i] = self._axes[i]
        return J

    def center_of_mass(self) -> np.ndarray:
        return np.mean([self.pose(frame)[1] for frame in self.frame_names], axis=0)

    def center_of_mass_jacobian(self) -> np.ndarray:
        return np.mean([self.jacobian(frame)[:3] for frame in self.frame_names], axis=0)

    def mass_matrix(self) -> np.ndarray:
        raise NotImplementedError

    def gravity(self) -> np.ndarray:
        raise NotImplementedError

    def integrate(self, q, v, dt) -> np.ndarray:
        return np.asarray(q) + dt * np.asarray(v)

    def difference(self, q0, q1) -> np.ndarray:
        return np.asarray(q1) - np.asarray(q0)


def random_chain(rng: np.random.Generator, n: int = 7) -> Chain:
    chain = Chain(rng.normal(size=(n, 3)), 0.4 * rng.normal(size=(n + 1, 3)))
    chain.update(rng.uniform(-1.5, 1.5, n))
    return chain


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return Q * np.sign(np.linalg.det(Q))
