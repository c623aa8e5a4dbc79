"""
The native core of hqp_rp: closed forms, active set, saturation, rows of tasks and batches, compiled from C++.
"""



from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Sides = NDArray[np.int8]

class Problem:
    """The native half of `hqp_rp.Problem`: its arrays, and a view of them."""

    def __init__(self, matrix: object, lower: object, upper: object, offsets: object, names: object, hard_rows: int, hard: object | None, is_equality: bool, damping: object | None = None, metric: object | None = None) -> None:
        """
        Takes arrays as they are, hard rows on top of the levels' rows (hard_rows of them) or apart (hard, a Level). TypeError and ValueError for arrays that do not fit.
        """

    @property
    def n(self) -> int:
        """Number of unknowns."""

    @property
    def p(self) -> int:
        """Number of levels."""

    @property
    def rows(self) -> int:
        """Rows of all levels, M."""

    @property
    def hard_rows(self) -> int:
        """How many rows are hard."""

    @property
    def is_equality(self) -> bool:
        """Whether every row of every level is an equality."""

    @property
    def names(self) -> tuple[str, ...]:
        """One name for each level."""

    @property
    def given(self) -> FloatArray:
        """The matrix as it was given, with hard rows on top where `on_top`."""

    @property
    def given_lower(self) -> FloatArray: ...

    @property
    def given_upper(self) -> FloatArray: ...

    @property
    def given_offsets(self) -> IntArray: ...

    @property
    def given_hard(self) -> Any:
        """The hard rows that were given apart, or None."""

    @property
    def damping(self) -> tuple[Any, ...] | None:
        """One policy or None for each level, or None where no level is damped."""

    @property
    def metric(self) -> FloatArray | None:
        """W (n, n) of the norm of the unknown, or None for the plain one."""

    @property
    def on_top(self) -> bool:
        """Whether hard rows stand on top of the levels' rows in `given`."""

    kept: Any

class Solution:
    """The native half of `hqp_rp.Solution`."""

    def __init__(self, problem: object, x: object | None, status: object, iterations: int = 0, message: object = '', secondary: object | None = None) -> None: ...

    problem: Any

    x: Any

    status: Any

    @property
    def iterations(self) -> int: ...

    @iterations.setter
    def iterations(self, arg: int, /) -> None: ...

    message: Any

    secondary: Any

    held: Any

    kept: Any

def register_solution(solution: object, statuses: tuple[Any, ...]) -> None:
    """Say which class solvers return, and the members of `Status` in their order."""

def metric_root(metric: object) -> tuple[FloatArray, FloatArray] | None:
    """
    R and its inverse, upper triangular, of W = R^T R; None where W (n, n) is not positive definite.
    """

def damped_least_squares(A: object, b: object, eta: float) -> FloatArray:
    """x (n,) of min ||A x - b||^2 + ||eta x||^2 for A (m, n)."""

def is_finite(array: object) -> bool:
    """Whether every number of an array of any shape is finite."""

def finite_numbers(given: object, size: int) -> FloatArray | None:
    """The same numbers as a C-contiguous float64 vector (size,), the object itself where it is one; None where they are not so many finite ones that float64 holds without loss."""

def take_configuration(q: object | None, out: object, quaternions: object, least: float) -> bool:
    """
    Copy a configuration if it is finite and of the length of `out`, and the squared norm of every quaternion, beginning at these places,
    is above `least`; whether it was.
    """

def instruction_set() -> str:
    """For which instruction set the kernels in use were compiled."""

def workspace_allocations() -> int:
    """
    How many blocks of memory this thread's workspace has allocated so far.
    """

class ClosedForm:
    """A closed form on equality levels, with its settings."""

    def solve(self, problem: object, secondary: object | None) -> Any: ...

    def solve_many(self, matrix: object, rhs: object, offsets: object, secondary: object, x: object, codes: object) -> None:
        """
        Solve N problems of one shape: (N, M, n), (N, M), (p + 1,), (N or 1, n); fills x (N, n) and codes (N,) uint8.
        """

    def loop(self, matrix: object, rhs: object, offsets: object, x: object, repeats: int) -> None:
        """
        Solve (N, M, n), (N, M), (p + 1,) one by one into x (N, n), so many times: for benchmarks.
        """

def reverse_priority(rank_tolerance: float, kind: int, first: float, second: float) -> ClosedForm:
    """Reverse priority (23)-(29), damped in T_k."""

def null_space(rank_tolerance: float, kind: int, first: float, second: float) -> ClosedForm:
    """Null-space priority (9)-(11) as an orthogonal cascade."""

class ActiveSet:
    """The hierarchical active set with its settings and its warm starts."""

    def __init__(self, rank_tolerance: float, max_iterations: int, warm_start: bool, least_violation: bool) -> None:
        """max_iterations: working sets factored, -1 for 200 + 10 per row."""

    def solve(self, problem: object, secondary: object | None) -> Any: ...

    def reset(self) -> None:
        """Forget warm starts."""

def proven_optimal(problem: object, x: object, zeta: object, accept: float, rank_tolerance: float) -> bool:
    """
    Whether x (n,) is proven to be the lexicographic optimum nearest to zeta (n,); False proves nothing.
    """

def active_set(
    problem: object, secondary: object | None, rank_tolerance: float, limit: int, least_violation: bool, x: object, side: object
) -> tuple[int, int]:
    """One search from x (n,) and side (hard rows and rows,) int64, both overwritten: (position in Status, iterations)."""

def polish(M: object, c: object, rows: object, lower: object, upper: object, soft: int, t: object, y: object) -> None:
    """
    Refine t (n,) and y (m,), an answer to min ||M t - c||^2 / 2 + ||s||^2 / 2 under lower <= rows t + [s; 0] <= upper, in place.
    """

class QPCascade:
    """
    The stages of a cascade of QPs for problems of one shape; not to be shared between threads.
    """

    def __init__(self, unknowns: int, hard_rows: int, offsets: object) -> None: ...

    def begin(
        self, problem: object, secondary: object | None, accept: float, rank_tolerance: float, polish: bool
    ) -> tuple[int, int, int, int, bool]: ...

    def answer(self, t: object | None, y: object | None) -> tuple[int, int, int, int, bool]: ...

    def go_on(self) -> tuple[int, int, int, int, bool]: ...

    @property
    def views(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """(hessian, gradient, rows, slack_rows, lower, upper, start, y) of the QP that is asked for, as views."""

    @property
    def x(self) -> FloatArray: ...

    @property
    def least(self) -> FloatArray: ...

    @property
    def side(self) -> Sides: ...

    @property
    def stage(self) -> int:
        """
        The stage that asked: 0 the hard rows, 1 ... p the levels, p + 1 the last one.
        """

class Kinematics:
    """Poses and Jacobians of frames, read out of MuJoCo's own memory."""

    def __init__(
        self, frames: object, chains: list[list[int]], dofs: object, bodies: object, mass: float, state: dict[str, Any]
    ) -> None: ...

    def read(self, rotations: object, origins: object, jacobians: object) -> None:
        """
        Fill (F, 3, 3), (F, 3) and (F, 6, nv); what is always zero is left as it is.
        """

    def motion(self, v: object, twists: object, biases: object) -> None:
        """Fill J v (F, 6) and Jdot v (F, 6), linear over angular, for v (nv,)."""

class Rows:
    """The rows of a stack's own tasks and limits on one robot."""

    def __init__(self, items: object, index: object, numbers: object, values: object, rotations: object, origins: object, jacobians: object, kinematics: object | None, q: object | None, time: int) -> None: ...

    def place(self) -> None:
        """Take up the table of items again."""

    def fill(self, matrix: object, lower: object, upper: object | None, dt: float, plain: bool) -> bool:
        """
        Fill the rows of all items in (M, n), (M,) and (M,) or None, and judge all M rows: whether they are sound.
        """

    def fill_acceleration(self, matrix: object, lower: object, upper: object | None, dt: float, v: object, rates: object, gains: object, biases: object) -> bool:
        """The same on accelerations, for the velocity v (nv,)."""

    def fill_many(self, rotations: object, origins: object, jacobians: object, values: object, matrices: object, lowers: object) -> int:
        """
        The same at N configurations, equalities alone: the first that is not sound, or -1.
        """

def serial_arm(q: object, d: object, a: object, cos_alpha: object, sin_alpha: object, frame: int, rotations: object, origins: object, jacobians: object) -> None:
    """Pose and Jacobian of a frame of an arm at q (N, n)."""

def rotation_vector(R: object) -> FloatArray:
    """log R (3,), of a rotation (3, 3)."""

def allowed_step(distance: float, gain: float, a: float) -> float:
    """The signed step towards a limit at a signed distance; a = A dt^2."""

def stop_change(u: float, c: float, a: float, j: float) -> float:
    """
    The next change of the velocity u while it stops, after the change c; a = A dt, j = J dt^2.
    """

def stop_rise(u: float, c: float, a: float, j: float) -> float:
    """
    How far above its place the position, over dt, comes to lie while u stops; arguments of `stop_change`, j finite.
    """

def torque_within(map: object, x: object, offset: object, limit: object) -> FloatArray | None:
    """map x + offset, cut to +-limit, read-only; None where x or the torques are not finite."""

class TorqueRows:
    """The rows of a torque stack on one robot."""

    def __init__(self, arrays: dict[str, Any], forces: int, unit: float) -> None: ...

    def place(self, cones: object, cone_lower: object, cone_upper: object, places: object, motion_place: int, total: int) -> None:
        """
        Say where rows stand, and which the cones are; arrays of which nothing changes later.
        """

    def rows(self, given: object, given_lower: object, given_upper: object) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray] | None:
        """All rows but those of tasks on forces: matrix, lower, upper, map, offset, Jacobian of the points; None where M or h is not finite."""

    def points(self) -> FloatArray:
        """The Jacobian of the points alone."""

def saturation_null_space(problem: object, secondary: object | None, rank_tolerance: float, optimal: bool) -> tuple[Any, ...]:
    """(x, scale of each level, finite, tried, unfinished level, missed level), -1 for no level, or two rows in conflict."""
