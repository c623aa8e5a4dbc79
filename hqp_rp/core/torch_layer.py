"""The answer to a prioritized problem as a differentiable function of PyTorch tensors.

Forward any solver of the library, backward `hqp_rp.core.derivative`; both in double precision on the CPU, whatever the
tensors are. Needs the extra `torch`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hqp_rp.core.derivative import TOLERANCE
from hqp_rp.core.errors import ProblemError
from hqp_rp.core.extras import require
from hqp_rp.core.layer import Data, answers_of, bounds_of, gradients_of, offsets_of, solutions_of
from hqp_rp.core.solver import Solver, get_solver

require("hqp_rp.core.torch_layer", "torch")

import torch  # noqa: E402  # pyright: ignore[reportMissingImports]
from torch.autograd.function import once_differentiable  # noqa: E402  # pyright: ignore[reportMissingImports]


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
    """x (..., n), a tensor that `backward` goes through, once.

    Args:
        levels: most important first, each (A, b) for A x = b or (A, lower, upper); A (..., m, n), bounds (..., m) or one number
            for all rows. Leading dimensions broadcast among all arguments: one problem for each.
        solver: a name or a solver object, as in `hqp_rp.solve`.
        hard: (A, b) or (A, lower, upper) of rows that no answer may violate, or None.
        secondary: (..., n) or None. metric: (..., n, n), symmetric positive definite, or None.
        constant_rank, tolerance: as in `SolutionDerivative`; where no matrix takes part in the derivative, ranks do not matter.

    The dtype and the device are those of the first A.

    Raises:
        ProblemError: arguments that are no problem. NoSolutionError: one that the solver gives no answer to.
        In the backward pass, NotDifferentiableError: an answer without a derivative.
    """
    if not len(levels):
        raise ProblemError("levels is empty; give at least one level (A, b).")
    stated = [bounds_of(level, f"levels[{k}]") for k, level in enumerate(levels)]
    first = torch.as_tensor(stated[0][0])
    if not first.is_floating_point():
        first = first.to(torch.float64)
    n = first.shape[-1]
    rows = [_tensors(level, first) for level in stated]
    top = [] if hard is None else [_tensors(bounds_of(hard, "hard"), first)]
    zeta = None if secondary is None else _tensor(secondary, first)
    W = None if metric is None else _tensor(metric, first)
    shapes = [A.shape[:-2] for A, _, _ in rows + top]
    shapes += [bound.shape[:-1] for _, *bounds in rows + top for bound in bounds]
    shapes += [] if zeta is None else [zeta.shape[:-1]]
    shapes += [] if W is None else [W.shape[:-2]]
    try:
        batch = torch.broadcast_shapes(*shapes)
        empty = first.new_zeros((*batch, 0, n)), first.new_zeros((*batch, 0)), first.new_zeros((*batch, 0))
        data = Data(
            *_stacked(rows, batch),
            *(_stacked(top, batch) if top else empty),
            first.new_zeros((*batch, 0)) if zeta is None else zeta.expand(*batch, n),
            first.new_zeros((*batch, 0, 0)) if W is None else W.expand(*batch, n, n),
        )
    except RuntimeError as error:
        raise ProblemError(f"The arguments of solve do not fit together: {error}") from error
    offsets = offsets_of([A.shape[-2] for A, _, _ in rows])
    return _Solve.apply(
        offsets, get_solver(solver) if isinstance(solver, str) else solver, constant_rank, tolerance, *data
    )


def _backward(ctx: Any, x_bar: Any) -> tuple[Any, ...]:
    needed = Data(*ctx.needs_input_grad[4:])
    x_bar = x_bar.detach().to("cpu", torch.float64).numpy()
    constant_rank = ctx.constant_rank or not (needed.matrix or needed.hard_matrix)
    found = gradients_of(ctx.solutions, x_bar, ctx.data, constant_rank, ctx.tolerance)
    gradients = (torch.from_numpy(one).to(ctx.like) if own else None for own, one in zip(needed, found, strict=True))
    return None, None, None, None, *gradients


class _Solve(torch.autograd.Function):  # type: ignore[misc]
    @staticmethod
    def forward(ctx: Any, offsets: Any, solver: Solver, constant_rank: bool, tolerance: float, *tensors: Any) -> Any:
        data = Data(*(tensor.detach().to("cpu", torch.float64).numpy() for tensor in tensors))
        ctx.solutions = solutions_of(data, offsets, solver)
        ctx.data, ctx.constant_rank, ctx.tolerance, ctx.like = data, constant_rank, tolerance, tensors[0].detach()
        x = answers_of(ctx.solutions, data.matrix.shape[:-2], data.matrix.shape[-1])
        return torch.from_numpy(x).to(tensors[0])

    backward = staticmethod(once_differentiable(_backward))


def _tensor(given: Any, like: Any) -> Any:
    return torch.as_tensor(given, dtype=like.dtype, device=like.device)


def _tensors(level: tuple[Any, Any, Any], like: Any) -> list[Any]:
    A, *bounds = (_tensor(given, like) for given in level)
    return [A, *(bound.expand(A.shape[-2]) if not bound.ndim else bound for bound in bounds)]


def _stacked(rows: list[list[Any]], batch: Any) -> tuple[Any, Any, Any]:
    A = torch.cat([A.expand(*batch, *A.shape[-2:]) for A, _, _ in rows], dim=-2)
    lower, upper = (
        torch.cat([level[side].expand(*batch, level[0].shape[-2]) for level in rows], dim=-1) for side in (1, 2)
    )
    return A, lower, upper
