"""The answer to a prioritized problem as a differentiable function of JAX arrays.

Forward any solver of the library, backward `hqp_rp.core.derivative`; both on the host, through `jax.pure_callback`, in double
precision whatever the arrays are. It goes through `jit`, `grad` and `vmap`. Needs the extra `jax`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hqp_rp.core.derivative import TOLERANCE
from hqp_rp.core.errors import ProblemError
from hqp_rp.core.extras import require
from hqp_rp.core.layer import Data, answers_of, bounds_of, gradients_of, offsets_of, solutions_of
from hqp_rp.core.solver import Solver, get_solver

require("hqp_rp.core.jax_layer", "jax")

import jax  # noqa: E402  # pyright: ignore[reportMissingImports]
import jax.numpy as jnp  # noqa: E402  # pyright: ignore[reportMissingImports]


def solve(
    levels: Sequence[Sequence[Any]],
    solver: str | Solver,
    *,
    hard: Sequence[Any] | None = None,
    secondary: Any = None,
    metric: Any = None,
    constant_rank: bool = False,
    tolerance: float = TOLERANCE,
) -> Any:
    """x (n,), of the dtype of the first A; many problems by `jax.vmap`.

    Args:
        levels: most important first, each (A, b) for A x = b or (A, lower, upper); A (m, n), bounds (m,) or one number for all
            rows.
        solver: a name or a solver object, as in `hqp_rp.solve`.
        hard: (A, b) or (A, lower, upper) of rows that no answer may violate, or None.
        secondary: (n,) or None. metric: (n, n), symmetric positive definite, or None.
        constant_rank, tolerance: as in `SolutionDerivative`. JAX does not say which arguments are differentiated: for bounds
            alone, give constant_rank=True.

    Reverse mode only (`grad`, `vjp`, `jacrev`), once. Without `jax.config.update("jax_enable_x64", True)` arrays are float32,
    and rows that should be dependent are so to 1e-7 only: the rank rule counts them as independent.

    Raises:
        ProblemError: arguments that do not fit together. What is found out on the host (no answer, no derivative) ends the
        computation with JAX's own error, which has the library's sentence in it.
    """
    if not len(levels):
        raise ProblemError("levels is empty; give at least one level (A, b).")
    stated = [bounds_of(level, f"levels[{k}]") for k, level in enumerate(levels)]
    dtype = jnp.result_type(stated[0][0], jnp.float32)
    n = np.shape(stated[0][0])[-1]
    rows = [_arrays(level, n, dtype, f"levels[{k}]") for k, level in enumerate(stated)]
    hard_A, hard_lower, hard_upper = _arrays(
        (np.zeros((0, n)), 0.0, 0.0) if hard is None else bounds_of(hard, "hard"), n, dtype, "hard"
    )
    A, lower, upper = (jnp.concatenate(parts) for parts in zip(*rows, strict=True))
    zeta = jnp.zeros(0, dtype) if secondary is None else _shaped(secondary, (n,), dtype, "secondary")
    W = jnp.zeros((0, 0), dtype) if metric is None else _shaped(metric, (n, n), dtype, "metric")
    data = Data(A, lower, upper, hard_A, hard_lower, hard_upper, zeta, W)
    chosen = get_solver(solver) if isinstance(solver, str) else solver
    settings = _Settings(tuple(len(A) for A, _, _ in rows), chosen, constant_rank, tolerance)
    return _solve(settings, data)


class _Settings:
    """What is no array; compared by identity, since solver objects need not be hashable."""

    def __init__(self, rows: tuple[int, ...], solver: Solver, constant_rank: bool, tolerance: float) -> None:
        self.rows, self.solver, self.constant_rank, self.tolerance = rows, solver, constant_rank, tolerance

    def forward(self, data: Data) -> NDArray[Any]:
        """x (..., n) of all problems."""
        arrays = Data(*(np.asarray(array) for array in data))
        solutions = solutions_of(arrays, offsets_of(self.rows), self.solver)
        *batch, _, n = arrays.matrix.shape
        return answers_of(solutions, tuple(batch), n).astype(arrays.matrix.dtype)

    def backward(self, data: Data, x_bar: NDArray[Any]) -> Data:
        """The gradients of all problems' data."""
        arrays = Data(*(np.asarray(array) for array in data))
        solutions = solutions_of(arrays, offsets_of(self.rows), self.solver)
        found = gradients_of(solutions, np.asarray(x_bar), arrays, self.constant_rank, self.tolerance)
        return Data(*(one.astype(like.dtype) for one, like in zip(found, arrays, strict=True)))


def _host(settings: _Settings, data: Data) -> Any:
    shape = jax.ShapeDtypeStruct(data.matrix.shape[-1:], data.matrix.dtype)
    return jax.pure_callback(settings.forward, shape, data, vmap_method="broadcast_all")


_solve: Any = jax.custom_vjp(_host, nondiff_argnums=(0,))


def _forward(settings: _Settings, data: Data) -> tuple[Any, Data]:
    return _solve(settings, data), data


def _backward(settings: _Settings, data: Data, x_bar: Any) -> tuple[Data]:
    shapes = Data(*(jax.ShapeDtypeStruct(array.shape, array.dtype) for array in data))
    return (jax.pure_callback(settings.backward, shapes, data, x_bar, vmap_method="broadcast_all"),)


_solve.defvjp(_forward, _backward)


def _arrays(level: tuple[Any, Any, Any], n: int, dtype: Any, what: str) -> list[Any]:
    A = jnp.asarray(level[0], dtype)
    if A.ndim != 2 or A.shape[1] != n:
        raise ProblemError(f"{what}: A has shape {A.shape}; it must be (m, {n}). Many problems go by jax.vmap.")
    m = A.shape[0]
    return [A, *(_shaped(bound, (m,), dtype, f"{what}: a bound") for bound in level[1:])]


def _shaped(given: Any, shape: tuple[int, ...], dtype: Any, what: str) -> Any:
    array = jnp.asarray(given, dtype)
    if array.ndim and array.shape != shape:
        raise ProblemError(f"{what} has shape {array.shape}; it must be {shape}.")
    return jnp.broadcast_to(array, shape)
