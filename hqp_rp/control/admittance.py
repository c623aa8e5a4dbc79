"""The linear law behind force, impedance and hybrid control, and its exact solution over a control period."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import positive_number, real_array
from hqp_rp.core.errors import SettingError
from hqp_rp.core.extras import require
from hqp_rp.core.problem import FloatArray

SYMMETRY_TOLERANCE = 1e-9
"""How far M - M^T may be from zero, relative to the largest entry of M."""

DEFINITE_TOLERANCE = 1e-12
"""An eigenvalue counts as zero when it is at most this times the largest one."""

_CACHED_PERIODS = 16


class AdmittanceLaw:
    """A mass with damper and spring on m axes: `M_d e'' + B_d e' + K_d e = f`.

    e is a deviation (m or rad), f a force (N or N m) held constant during the period dt. The solution at the end of the
    period is exact: with g = f - K_d e, the force that is not balanced at its beginning,
    ::

        mean velocity  (e(dt) - e(0)) / dt = A e'(0) + C g
        velocity                    e'(dt) = E e'(0) + D g

    with A, C, D, E (m, m) from one matrix exponential for each dt, which is kept. So the result does not depend on how a
    given time is cut into periods, it is stable for every dt, and the energy e'^T M_d e' / 2 + e^T K_d e / 2 never grows
    while f = 0. Where f varies during the period, holding its value at the beginning makes an error of first order in dt
    (it acts as a delay of dt / 2); holding its value at mid-period, of second order.

    Args:
        size: m, the number of axes.
        inertia: M_d, positive definite: kg on linear axes, kg m^2 on rotational ones. A number or (m,) numbers stand for
            a diagonal; (m, m) is a symmetric matrix.
        damping: B_d, positive semidefinite, in the same three ways: N s/m and N m s/rad.
        stiffness: K_d, positive semidefinite, in the same three ways: N/m and N m/rad; default 0, no spring.
        owner: what errors call the law.

    Raises:
        SettingError: a matrix of the wrong shape, not finite, not symmetric or not positive (semi)definite.

    Source: equations (35), (43) of the paper; Van Loan 1978 for the exponential with a held input.
    """

    __slots__ = ("_B", "_K", "_M", "_factor", "_periods", "_size")

    def __init__(
        self,
        size: int,
        inertia: ArrayLike,
        damping: ArrayLike,
        stiffness: ArrayLike = 0.0,
        *,
        owner: str = "the law",
    ) -> None:
        self._size = size
        self._M = _checked(inertia, size, f"M_d of {owner}", definite=True)
        self._B = _checked(damping, size, f"B_d of {owner}", definite=False)
        self._K = _checked(stiffness, size, f"K_d of {owner}", definite=False)
        self._factor = np.linalg.cholesky(self._M)
        self._periods: dict[float, FloatArray] = {}

    @property
    def size(self) -> int:
        """m, the number of axes."""
        return self._size

    @property
    def inertia(self) -> FloatArray:
        """(m, m) M_d, read-only."""
        return self._M

    @property
    def damping(self) -> FloatArray:
        """(m, m) B_d, read-only."""
        return self._B

    @property
    def stiffness(self) -> FloatArray:
        """(m, m) K_d, read-only."""
        return self._K

    def advance(
        self, deviation: FloatArray, velocity: FloatArray, force: FloatArray, dt: float
    ) -> tuple[FloatArray, FloatArray]:
        """Mean velocity during the period and velocity at its end, both (m,), from e(0), e'(0) and f, all (m,).

        The deviation at the end is e(0) + dt * mean velocity.

        Raises:
            SettingError: dt that is not a finite number > 0, or so long that the exponential overflows.
        """
        matrix = self._periods.get(dt)
        if matrix is None:
            matrix = self._period(dt)
        m = self._size
        start = np.empty(2 * m)
        start[:m] = velocity
        start[m:] = force - self._K.dot(deviation)
        end: FloatArray = matrix.dot(start)
        return end[:m], end[m:]

    def acceleration(self, deviation: FloatArray, velocity: FloatArray, force: FloatArray) -> FloatArray:
        """e'' (m,) from e, e' and f, all (m,): M_d^-1 (f - B_d e' - K_d e), what a torque loop is asked for."""
        rest = force - self._B @ velocity - self._K @ deviation
        return np.asarray(np.linalg.solve(self._M, rest), dtype=np.float64)

    def energy(self, deviation: FloatArray, velocity: FloatArray) -> float:
        """Kinetic and spring energy `e'^T M_d e' / 2 + e^T K_d e / 2` in J."""
        return 0.5 * float(velocity @ self._M @ velocity + deviation @ self._K @ deviation)

    def _period(self, dt: float) -> FloatArray:
        """(2 m, 2 m) the matrix [A, C; E, D] of the class's docstring."""
        require("An admittance law", "scipy")
        from scipy.linalg import expm, solve_triangular

        dt = positive_number(dt, "dt")
        m, L = self._size, self._factor
        # In the coordinates y = L^T e (M_d = L L^T) and with time counted in periods, the exponent has no units and
        # keeps the symmetry of B_d and K_d.
        B, K = (
            solve_triangular(L, solve_triangular(L, matrix, lower=True).T, lower=True) for matrix in (self._B, self._K)
        )
        exponent = np.zeros((3 * m, 3 * m))
        exponent[:m, m : 2 * m] = exponent[m : 2 * m, 2 * m :] = np.eye(m)
        exponent[m : 2 * m, :m] = -(dt * dt) * K
        exponent[m : 2 * m, m : 2 * m] = -dt * B
        with np.errstate(all="ignore"):
            solution = expm(exponent) if np.isfinite(exponent).all() else exponent
            left = solve_triangular(L, np.eye(m), lower=True).T
            moved = [left @ solution[rows, m : 2 * m] @ L.T for rows in (slice(0, m), slice(m, 2 * m))]
            pushed = [dt * (left @ solution[rows, 2 * m :] @ left.T) for rows in (slice(0, m), slice(m, 2 * m))]
            matrix = np.block([[moved[0], pushed[0]], [moved[1], pushed[1]]])
        if not np.isfinite(matrix).all():
            raise SettingError(f"dt is {dt:g} s; for this law the motion over so long a period overflows. Shorten dt.")
        if len(self._periods) >= _CACHED_PERIODS:
            self._periods.clear()
        self._periods[dt] = matrix
        return matrix

    def __repr__(self) -> str:
        return f"AdmittanceLaw({self._size} axes)"


def _checked(value: ArrayLike, size: int, what: str, *, definite: bool) -> FloatArray:
    """A symmetric positive (semi)definite matrix (size, size), read-only."""
    array = real_array(value, what)
    if array.ndim == 0 or array.shape == (size,):
        matrix = np.diag(np.broadcast_to(array, (size,))).copy()
    elif array.shape == (size, size):
        matrix = array
    else:
        raise SettingError(
            f"{what} has shape {array.shape}; for {size} axes give one number, the {size} numbers of a diagonal, or a "
            f"symmetric matrix ({size}, {size})."
        )
    largest = float(np.abs(matrix).max())
    if not math.isfinite(largest):
        raise SettingError(f"{what} is {matrix.tolist()}; every entry must be finite.")
    skewness = np.abs(matrix - matrix.T)
    if skewness.max() > SYMMETRY_TOLERANCE * largest:
        i, j = (int(k) for k in np.argwhere(skewness == skewness.max())[0])
        raise SettingError(
            f"{what} is not symmetric: entry [{i}, {j}] is {matrix[i, j]:g} and entry [{j}, {i}] is {matrix[j, i]:g}. "
            "Give (A + A^T) / 2."
        )
    matrix = 0.5 * (matrix + matrix.T)
    smallest = float(np.linalg.eigvalsh(matrix)[0])
    if definite and smallest <= DEFINITE_TOLERANCE * largest:
        raise SettingError(
            f"{what} must be positive definite: every eigenvalue > 0, and its smallest is {smallest:g} "
            f"(the largest entry is {largest:g}). An axis without inertia cannot be integrated; leave it out of `axes`."
        )
    if smallest < -DEFINITE_TOLERANCE * largest:
        raise SettingError(
            f"{what} must be positive semidefinite: every eigenvalue >= 0, and its smallest is {smallest:g}. "
            "A negative one would feed energy into the motion."
        )
    matrix.flags.writeable = False
    return matrix
