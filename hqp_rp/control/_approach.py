"""How fast a distance may shrink, and how fast it must grow again where it is negative: shared by limits on distances."""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.control._checks import positive_number
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray


class Approach:
    """The least rate at which a distance d to a limit may change, so that it stays >= 0 and comes back where it is not.

    ::

        rate >= -phi(d)                        d >= 0: the approach slows down
        rate >=  min(phi(|d|), return_speed)   d < 0: the way back

        phi(d) = gain d                                          gain^2 d <= A
        phi(d) = the speed from which braking at A arrives there beyond, in continuous time sqrt(2 A d - A^2 / gain^2)

    with A the deceleration. An approach along phi needs no more than A, and no step asks to pass the limit. `braking_step`
    is the exact form of phi for steps of length dt.

    Args:
        gain: 1/s, > 0; a step of more than 1/gain takes 1/dt instead.
        deceleration: A, m/s^2, > 0, or infinite.
        return_speed: m/s, > 0, or infinite.
        owner: the limit's name, for errors.
    """

    __slots__ = ("deceleration", "gain", "return_speed")

    def __init__(self, gain: float, deceleration: float, return_speed: float, owner: str) -> None:
        self.gain = positive_number(gain, f"the gain of {owner!r}")
        self.deceleration = _positive(deceleration, f"the deceleration of {owner!r}")
        self.return_speed = _positive(return_speed, f"the return_speed of {owner!r}")

    def brakes(self, name: str) -> str:
        """What lets x come to the limit of this name slower, as the end of a sentence."""
        if math.isinf(self.deceleration):
            return (
                f"give {name!r} deceleration=, at most what the joints can brake there, or a gain= below {self.gain:g}"
            )
        return f"give {name!r} a deceleration= below {self.deceleration:g}, or a gain= below {self.gain:g}"

    def returns(self, name: str) -> str:
        """What makes the limit of this name ask for a slower way back, as the end of a sentence."""
        return f"give {name!r} a return_speed= below {self.return_speed:g}"

    def least_rate(self, distance: FloatArray, dt: float) -> FloatArray:
        """(m,) m/s, from distances (m,) in m; -inf where the distance is infinite."""
        step = braking_step(np.abs(distance), min(1.0, self.gain * dt), self.deceleration * dt * dt)
        rate: FloatArray = np.minimum(np.copysign(step, -distance) / dt, self.return_speed)
        return rate


def braking_step(distance: FloatArray, share: float, a: float) -> FloatArray:
    """(m,) the longest step towards a limit at the distance d >= 0 (m,), after which steps may shrink by at most a each.

    Within d* = a / share^2 the step is share * d, which shrinks by share^2 d <= a. Further out, with s* = a / share, steps
    s* + a, s* + 2 a, ... lead one to the next from D_m = d* + m s* + a m (m + 1) / 2 down to d*; between them the step is
    interpolated, which keeps the decrease at exactly a.

    Args:
        distance: m. share: in (0, 1], of the distance that a step may take. a: m, > 0 or infinite.
    """
    if math.isinf(a):
        return np.asarray(share * distance)
    first = a / share
    beyond = np.clip(distance - first / share, 0.0, np.finfo(np.float64).max)
    half = first + 0.5 * a
    m = np.floor((np.sqrt(half * half + 2.0 * a * beyond) - half) / a)
    rest = beyond - m * first - 0.5 * a * m * (m + 1.0)
    braking = first + m * a + a * rest / (first + (m + 1.0) * a)
    step: FloatArray = np.where(beyond > 0.0, np.where(np.isinf(distance), math.inf, braking), share * distance)
    return step


def margin_of(value: object, owner: str) -> float:
    """A margin in m, finite and >= 0."""
    number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    if not number or not 0.0 <= float(value) < math.inf:  # type: ignore[arg-type]
        raise SettingError(f"the margin of {owner!r} is {value!r}; it must be a finite number >= 0, in m.")
    return float(value)  # type: ignore[arg-type]


def _positive(value: object, what: str) -> float:
    if isinstance(value, int | float | np.number) and not isinstance(value, bool) and float(value) == math.inf:
        return math.inf
    return positive_number(value, what)
