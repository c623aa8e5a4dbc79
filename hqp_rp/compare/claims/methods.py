"""Who takes part: the paper's method, the classical ones, and every damped one over a sweep of its damping."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

from hqp_rp.core.damping import ConstantDamping, VariableDamping
from hqp_rp.core.solver import Solver, get_solver

REVERSE = "reverse priority"
NULL_SPACE = "null space"
CLASSICAL = "pseudo-inverse"
CASCADE = "QP cascade"
WEIGHTED = "weighted"
ROBUST = "singularity robust"
REVERSE_DAMPED, REVERSE_VARIABLE = "reverse T_k damped", "reverse T_k variable"
REVERSE_EVERYWHERE = "reverse all damped"
DLS, DLS_VARIABLE = "DLS", "DLS variable"
NULL_DAMPED, NULL_VARIABLE = "null space damped", "null space variable"
UNILATERAL, ACTIVE_SET, SATURATION = "reverse unilateral", "active set", "saturation"

DAMPINGS = (0.01, 0.03, 0.1, 0.3)
"""The sweep: eta of a constant damping; delta and lambda_max of a variable one."""
FIRST_DAMPING = 0.1
"""What is taken where nothing is swept."""


@dataclasses.dataclass(frozen=True, slots=True)
class Method:
    """A family of solvers, with the damping of this member; 0 for families without.

    Attributes:
        label: of the family. solver: with its settings. damping: see `DAMPINGS`.
    """

    label: str
    solver: Solver
    damping: float = 0.0


def _reverse(damping: float, **settings: str) -> Solver:
    return get_solver("reverse_priority", damping=ConstantDamping(damping), **settings)


SWEPT: dict[str, Callable[[float], Solver]] = {
    REVERSE_DAMPED: _reverse,
    REVERSE_VARIABLE: lambda d: get_solver("reverse_priority", damping=VariableDamping(d, d)),
    REVERSE_EVERYWHERE: lambda d: _reverse(d, damp="everywhere"),
    DLS: lambda d: get_solver("damped_least_squares", damping=ConstantDamping(d)),
    DLS_VARIABLE: lambda d: get_solver("damped_least_squares", damping=VariableDamping(d, d)),
    NULL_DAMPED: lambda d: get_solver("null_space", damping=ConstantDamping(d)),
    NULL_VARIABLE: lambda d: get_solver("null_space", damping=VariableDamping(d, d)),
}
"""Family -> the solver with a damping."""

# The variable ones set in near a singularity alone, where the smallest of the sweep is as good as none.
_SWEEPS = {
    REVERSE_VARIABLE: DAMPINGS[1:],
    DLS_VARIABLE: DAMPINGS[1:],
    NULL_VARIABLE: DAMPINGS[1:],
    REVERSE_EVERYWHERE: DAMPINGS[1:3],
}

FIXED: dict[str, Callable[[], Solver]] = {
    REVERSE: lambda: get_solver("reverse_priority"),
    NULL_SPACE: lambda: get_solver("null_space"),
    CLASSICAL: lambda: get_solver("pseudo_inverse"),
    CASCADE: lambda: get_solver("qp_cascade", backend="proxqp"),
    ROBUST: lambda: get_solver("singularity_robust"),
    WEIGHTED: lambda: get_solver("weighted"),
    UNILATERAL: lambda: get_solver("reverse_priority_unilateral"),
    ACTIVE_SET: lambda: get_solver("hierarchical_active_set"),
    SATURATION: lambda: get_solver("saturation_null_space"),
}
"""Family -> the solver, for families without a damping."""

WITHIN_LIMITS = (UNILATERAL, ACTIVE_SET, SATURATION)
"""Those that take hard velocity limits."""
CLASSICAL_METHODS = (CLASSICAL, DLS, DLS_VARIABLE)
"""Without priority: what the paper calls classical or Jacobian based."""
WITH_PRIORITY = (NULL_SPACE, NULL_DAMPED, NULL_VARIABLE, CASCADE, ROBUST)
"""The rivals with strict priorities."""


def method(label: str, damping: float = FIRST_DAMPING) -> Method:
    """One member of a family; the damping is ignored where the family has none."""
    if label in SWEPT:
        return Method(label, SWEPT[label](damping), damping)
    return Method(label, FIXED[label]())


def line_up() -> list[Method]:
    """Every method without hard limits, each damped one over its sweep."""
    fixed = [method(label) for label in FIXED if label not in WITHIN_LIMITS]
    return fixed + [method(label, damping) for label in SWEPT for damping in _SWEEPS.get(label, DAMPINGS)]


def solvers() -> list[Solver]:
    """One of every family, those within hard limits too."""
    return [method(label).solver for label in (*FIXED, *SWEPT)]
