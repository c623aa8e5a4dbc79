"""The law by itself: the mass and damper of (35) against a wall, with a delayed reading, without an arm."""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.problem import FloatArray

_STEP = 1e-5  # s


def ideal_contact(
    M: float, B: float, stiffness: float, force: float, gap: float, duration: float
) -> tuple[FloatArray, FloatArray]:
    """Time in s and contact force in N of `M x'' + B x' = F_d - K_e max(x - gap, 0)` from rest, by semi-implicit Euler steps.

    Args:
        M: kg. B: N s/m. stiffness: K_e, N/m. force: F_d, N. gap: m. duration: s.
    """
    count = round(duration / _STEP)
    x = v = 0.0
    found = np.empty(count)
    for k in range(count):
        touch = stiffness * (x - gap) if x > gap else 0.0
        v += _STEP * (force - B * v - touch) / M
        x += _STEP * v
        found[k] = touch
    return _STEP * np.arange(1.0, count + 1.0), found


def delay_margin(M: float, B: float, stiffness: float) -> float:
    """s, the delay at which the loop K_e e^(-s tau) / (s (M s + B)) loses its phase margin.

    |L| = 1 at w^2 = (-B^2 + sqrt(B^4 + 4 M^2 K_e^2)) / (2 M^2), where the phase of the law is -pi/2 - atan(w M / B); what is
    left to -pi, divided by w, is the margin. In continuous time and without a velocity loop below.
    """
    w = math.sqrt((-(B**2) + math.sqrt(B**4 + 4.0 * M**2 * stiffness**2)) / (2.0 * M**2))
    return (0.5 * math.pi - math.atan(w * M / B)) / w
