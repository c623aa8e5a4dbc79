"""The box on the velocity that position, velocity and acceleration limits leave."""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.compile import lean


@lean
def allowed_step(distance, gain, a):
    """phi(d): the signed step towards a limit at the signed distance d; a = A dt^2, or infinite.

    `phi(d) = sign(d) min(gain |d|, X(|d|))`, `X(d) = d / N + a (N - 1) / 2`, `N = max(1, ceil((sqrt(1 + 8 d / a) - 1) / 2))`.
    """
    size = abs(distance)
    longest = size
    if size < np.inf and a < np.inf:
        steps = max(1.0, math.ceil((math.sqrt(1.0 + 8.0 * size / a) - 1.0) / 2.0))
        longest = size / steps + a * (steps - 1.0) / 2.0
    return math.copysign(min(gain * size, longest), distance)


@lean
def box_limit(header, index, numbers, values, matrix, lower, upper):
    """Rows of the identity and the box: numbers gain, then least and greatest position, V and A (n each).

    index: where in `values` each coordinate is, -1 for a velocity without one (n), then where dt is; the velocity before the
    step follows dt. gain 0: positions do not count. Acceleration yields to velocity, and position to both.
    """
    n, row, at, start = header[1], header[2], header[3], header[6]
    time = index[start + n]
    dt, gain = values[time], numbers[at]
    for i in range(n):
        for j in range(n):
            matrix[row + i, j] = 1.0 if i == j else 0.0
        speed, acceleration = numbers[at + 1 + 2 * n + i], numbers[at + 1 + 3 * n + i]
        low, high = -speed, speed
        if acceleration < np.inf:
            # A velocity beyond V comes back to V at once: the clip moves both bounds there.
            before, change = values[time + 1 + i], acceleration * dt
            low = min(max(before - change, -speed), speed)
            high = min(max(before + change, -speed), speed)
        if gain > 0.0:
            q = values[index[start + i]] if index[start + i] >= 0 else 0.0
            down, up = numbers[at + 1 + i] - q, numbers[at + 1 + n + i] - q
            if acceleration < np.inf:
                down = allowed_step(down, gain, acceleration * (dt * dt)) / dt
                up = allowed_step(up, gain, acceleration * (dt * dt)) / dt
            else:
                down, up = down * (gain / dt), up * (gain / dt)
            up = max(down, up)  # the step grows with the distance, but rounding may swap two that are equal
            low, high = min(max(down, low), high), max(min(up, high), low)
        lower[row + i], upper[row + i] = low, high
