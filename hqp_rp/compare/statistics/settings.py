"""A method's own setting moved down and up, so that a verdict on the method is none on the number that was chosen for it."""

from __future__ import annotations

import dataclasses
from typing import Any

from hqp_rp.compare.contestants import Contestant
from hqp_rp.core.damping import NoDamping
from hqp_rp.core.solver import Solver

FACTOR = 3.0
"""Settings and thresholds are moved down and up by this factor."""
FACTORS = (1.0 / FACTOR, 1.0, FACTOR)
_PLAIN = ("gamma", "gamma_max", "largest_step", "ratio")


def moved(solver: Solver, factor: float) -> Solver | None:
    """The solver with its damping policy, or the one number that bounds its steps, times `factor`; None where it has neither.

    Of a policy with a threshold and a size both are moved, since one stands for the other.
    """
    damping: Any = getattr(solver, "damping", None)
    if damping is not None and not isinstance(damping, NoDamping | int | float):
        numbers = {field.name: factor * getattr(damping, field.name) for field in dataclasses.fields(damping)}
        return dataclasses.replace(solver, damping=dataclasses.replace(damping, **numbers))  # type: ignore[call-arg]
    for name in _PLAIN:
        if hasattr(solver, name):
            return dataclasses.replace(solver, **{name: factor * getattr(solver, name)})
    return None


def setting_of(solver: Solver) -> str:
    """What `moved` would move, in words; empty where there is nothing."""
    damping: Any = getattr(solver, "damping", None)
    if damping is not None and not isinstance(damping, NoDamping | int | float):
        return repr(damping)
    return next((f"{name} {getattr(solver, name):.3g}" for name in _PLAIN if hasattr(solver, name)), "")


def variants_of(contestant: Contestant) -> list[tuple[float, Solver]]:
    """(factor, solver): as it is, and with its setting moved where it has one."""
    others = [(factor, moved(contestant.solver, factor)) for factor in FACTORS if factor != 1.0]
    return [(1.0, contestant.solver), *((factor, solver) for factor, solver in others if solver is not None)]
