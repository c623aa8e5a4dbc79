"""A robot of slides whose Jacobian is constant: what a law asks for, it does exactly. And motions in closed form."""

from __future__ import annotations

import cmath

import numpy as np


class Gantry:
    """Slides along x, y, z, then `spare` more along x, y, z again: nv = 3 + spare. Frame "tool", turned by a fixed R."""

    def __init__(self, rotation: np.ndarray | None = None, spare: int = 0, velocity: float = np.inf) -> None:
        self.nq = self.nv = 3 + spare
        self.rotation = np.eye(3) if rotation is None else rotation
        self.joint_names = tuple(f"slide{i}" for i in range(self.nv))
        self.frame_names = ("tool",)
        self.lower, self.upper = np.full(self.nv, -np.inf), np.full(self.nv, np.inf)
        self.velocity_limit = np.full(self.nv, velocity)
        self.neutral = np.zeros(self.nv)
        self.J = np.zeros((6, self.nv))
        for i in range(self.nv):
            self.J[i % 3, i] = 1.0
        self.update(self.neutral)

    def update(self, q: np.ndarray) -> None:
        self.q = np.array(q, dtype=float)

    def pose(self, frame: str):
        return self.rotation, self.J[:3] @ self.q

    def jacobian(self, frame: str) -> np.ndarray:
        return self.J.copy()

    def center_of_mass(self) -> np.ndarray:
        raise NotImplementedError

    def center_of_mass_jacobian(self) -> np.ndarray:
        raise NotImplementedError

    def mass_matrix(self) -> np.ndarray:
        raise NotImplementedError

    def gravity(self) -> np.ndarray:
        raise NotImplementedError

    def integrate(self, q, v, dt) -> np.ndarray:
        return np.asarray(q) + dt * np.asarray(v)

    def difference(self, q0, q1) -> np.ndarray:
        return np.asarray(q1) - np.asarray(q0)


def mass_damper(t, m: float, b: float, f: float, v0: float = 0.0):
    """Displacement and velocity of m x'' + b x' = f from x = 0, x' = v0."""
    t = np.asarray(t, dtype=float)
    gone = -np.expm1(-b * t / m)
    return f / b * t + (v0 - f / b) * m / b * gone, v0 + (f / b - v0) * gone


def mass_spring_damper(t: float, m: float, b: float, k: float, x0: float, v0: float) -> tuple[float, float]:
    """Position and velocity of m x'' + b x' + k x = 0, from the roots of m s^2 + b s + k."""
    root = cmath.sqrt(b * b - 4.0 * m * k)
    if abs(root) < 1e-12 * b:
        s = -b / (2.0 * m)
        c = v0 - s * x0
        decay = np.exp(s * t)
        return (x0 + c * t) * decay, (c + s * (x0 + c * t)) * decay
    s1, s2 = (-b + root) / (2.0 * m), (-b - root) / (2.0 * m)
    a1, a2 = (v0 - s2 * x0) / (s1 - s2), (s1 * x0 - v0) / (s1 - s2)
    e1, e2 = cmath.exp(s1 * t), cmath.exp(s2 * t)
    return (a1 * e1 + a2 * e2).real, (a1 * s1 * e1 + a2 * s2 * e2).real
