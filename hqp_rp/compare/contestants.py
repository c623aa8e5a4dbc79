"""Who takes part in a comparison: solvers with settings, a short stable label for each, and the group it is drawn in."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from hqp_rp.compare.settings_text import parse_contestant
from hqp_rp.core.damping import (
    ConstantDamping,
    ManipulabilityDamping,
    NumericalFiltering,
    Truncation,
    VariableDamping,
)
from hqp_rp.core.errors import SettingError, unknown_name
from hqp_rp.core.problem import Level, Problem
from hqp_rp.core.solver import Solver, all_solvers, get_solver

EXACT = "exact in theory"
DAMPED = "damped or robust priority"
BOUNDED = "priority with bounded steps"
SOFT = "no strict priority"
QP = "QP cascade and active set"
WITHIN = "closed form within hard rows"
GROUPS = (EXACT, DAMPED, BOUNDED, SOFT, QP, WITHIN)
"""The groups, in the order in which figures and tables show them."""


@dataclasses.dataclass(frozen=True, slots=True)
class Contestant:
    """One solver with its settings.

    Attributes:
        label: short and stable; figures and tables speak of the contestant by it.
        solver: the solver; its repr is printed in the settings table.
        group: one of `GROUPS`: what it is drawn beside.
        why: what the variant is there to show.
    """

    label: str
    solver: Solver
    group: str
    why: str = ""

    @property
    def name(self) -> str:
        """The solver's name."""
        return type(self.solver).name


_CONSTANT = ConstantDamping(0.1)
_VARIABLE = VariableDamping(0.1, 0.1)

# Solver name -> its variants: label, settings, group, what the variant is there to show.
_VARIANTS: dict[str, tuple[tuple[str, dict[str, Any], str, str], ...]] = {
    "null_space": (
        ("null space", {}, EXACT, "the stable form: an orthonormal basis of the remaining null space"),
        ("null space textbook", {"variant": "projector"}, EXACT, "the recursion as textbooks print it"),
        ("null space constant", {"damping": _CONSTANT}, DAMPED, "damped everywhere along the path"),
        ("null space variable", {"damping": _VARIABLE}, DAMPED, "damped near singularities only, (18)-(19)"),
        ("null space truncated", {"damping": Truncation(0.01)}, DAMPED, "small singular values cut"),
        (
            "null space filtered",
            {"damping": NumericalFiltering(0.1, 0.1)},
            BOUNDED,
            "numerical filtering: the last singular direction alone is damped",
        ),
        (
            "null space manipulability",
            {"damping": ManipulabilityDamping(0.05, 0.1)},
            BOUNDED,
            "damped by the manipulability, as Nakamura and Hanafusa have it",
        ),
    ),
    "selectively_damped": (
        (
            "selectively damped",
            {"gamma_max": 3.0},
            BOUNDED,
            "Buss and Kim: each singular direction clamped, at most the arm's own 3 rad/s for each level",
        ),
    ),
    "jparse": (
        ("J-PARSE", {}, BOUNDED, "singular directions scaled, singular values held above a tenth of the largest"),
    ),
    "incremental_projector": (
        (
            "incremental projector",
            {"largest_step": 3.0},
            BOUNDED,
            "Baerlocher and Boulic: no level's step longer than the arm's own 3 rad/s",
        ),
    ),
    "reverse_priority": (
        ("reverse priority", {}, EXACT, "equation (29), undamped; lexicographic on two levels only"),
        ("reverse T_k constant", {"damping": _CONSTANT}, DAMPED, "damping in the pseudo-inverse that gives T_k only"),
        ("reverse T_k variable", {"damping": _VARIABLE}, DAMPED, "the same, near singularities only"),
        (
            "reverse all damped",
            {"damping": _CONSTANT, "damp": "everywhere"},
            DAMPED,
            "a plain reading of (15) in (32): every pseudo-inverse damped",
        ),
    ),
    "reverse_priority_in_order": (
        (
            "reverse in order",
            {"damping": _VARIABLE},
            BOUNDED,
            "ours: lower levels disturbed in their order, lexicographic away from singularities",
        ),
    ),
    "singularity_robust": (("singularity robust", {}, DAMPED, "Chiaverini's (13): bounded, inexact below level 1"),),
    "operational_space": (
        ("operational space", {}, EXACT, "Khatib and Sentis: null-space priority in the metric of the problem"),
        ("operational selective", {"singularity": "selective"}, DAMPED, "small eigenvalues of the task inertia damped"),
        (
            "operational blend",
            {"singularity": "blend"},
            DAMPED,
            "singular directions blended out, left to lower levels",
        ),
    ),
    "null_space_torque": (
        ("projected torques", {}, DAMPED, "augmented, dynamically consistent: exact on level 1 alone"),
        ("projected torques static", {"consistency": "static"}, DAMPED, "the same, statically consistent"),
        ("projected torques successive", {"projection": "successive"}, DAMPED, "the same, successive"),
    ),
    "pseudo_inverse": (("pseudo-inverse", {}, SOFT, "all levels as one: the classical solution without priority"),),
    "damped_least_squares": (
        ("DLS constant", {"damping": _CONSTANT}, SOFT, "all levels as one, damped everywhere"),
        ("DLS variable", {"damping": _VARIABLE}, SOFT, "all levels as one, damped near singularities"),
    ),
    "weighted": (("weighted", {}, SOFT, "soft weights instead of priorities, as mink and pink do"),),
    "qp_cascade": (
        ("QP ProxQP", {"backend": "proxqp"}, QP, "native interface, workspaces kept"),
        ("QP OSQP", {"backend": "osqp"}, QP, "native interface, workspaces kept"),
        ("QP DAQP", {"backend": "daqp"}, QP, "through qpsolvers"),
        ("QP quadprog", {"backend": "quadprog"}, QP, "through qpsolvers"),
    ),
    "hierarchical_active_set": (("active set", {}, QP, "one active set over the whole hierarchy, no QP back end"),),
    "daqp": (("DAQP hierarchy", {}, QP, "DAQP's own hierarchical mode"),),
    "reverse_priority_unilateral": (
        ("reverse priority unilateral", {}, WITHIN, "hard rows that are active enter as the level executed last"),
    ),
    "set_based": (("set-based tasks", {}, WITHIN, "two-sided rows active at a bound, the fewest first"),),
    "generalized_hierarchy": (
        (
            "generalized hierarchy",
            {},
            DAMPED,
            "strict priorities by generalized projectors: (13), and partly strict ones",
        ),
    ),
    "intermediate_desired_value": (
        (
            "intermediate desired value",
            {},
            EXACT,
            "null-space priority with levels present to a degree; here all present",
        ),
    ),
    "saturation_null_space": (
        ("saturation null space", {}, WITHIN, "SNS, basic: saturates unknowns at their bounds, then scales the task"),
        ("saturation optimal", {"variant": "optimal"}, WITHIN, "Opt-SNS: releases too; largest scale, then least norm"),
    ),
}

_FOR_LIMITS = ("reverse_priority_unilateral", "saturation_null_space", "set_based")
"""Without hard rows these are `reverse_priority` and `null_space`: they line up where a scenario has limits."""

_FOR_TRANSITIONS = ("generalized_hierarchy", "intermediate_desired_value")
"""With fixed strict priorities these are `singularity_robust` and `null_space`: they line up where they are asked for."""

_FOR_TORQUES = ("operational_space", "null_space_torque")
"""Without a metric the first is `null_space`: they line up where a scenario is about accelerations or torques."""


def default_contestants(
    *, limits: bool = True, torques: bool = True, transitions: bool = True
) -> tuple[Contestant, ...]:
    """Every solver in the solvers folder: its variants worth showing, or its defaults when none are listed here.

    Without `limits`, those that differ from others only where there are hard rows are left out; without `torques`, those that
    speak of inertia; without `transitions`, those that differ from others only while priorities change.
    """
    order = [*_VARIANTS, *(name for name in all_solvers() if name not in _VARIANTS)]
    if not transitions:
        order = [name for name in order if name not in _FOR_TRANSITIONS]
    if not limits:
        order = [name for name in order if name not in _FOR_LIMITS]
    if not torques:
        order = [name for name in order if name not in _FOR_TORQUES]
    found = [contestant for name in order if name in all_solvers() for contestant in variants(name)]
    return tuple(sorted(found, key=lambda contestant: GROUPS.index(contestant.group)))


def variants(name: str) -> tuple[Contestant, ...]:
    """The contestants of one solver; `UnknownNameError` when there is no such solver."""
    if name not in all_solvers():
        raise unknown_name("solver", name, all_solvers())
    if name not in _VARIANTS:
        solver = get_solver(name)
        return (Contestant(name.replace("_", " "), solver, group_of(solver)),)
    return tuple(
        Contestant(label, get_solver(name, **settings), group, why) for label, settings, group, why in _VARIANTS[name]
    )


def group_of(solver: Solver) -> str:
    """The group of a solver that nobody put into one, from what the solver declares."""
    if solver.takes_hard or solver.takes_inequalities:
        return QP
    row = np.ones((1, 2))
    if solver.is_lexicographic(Problem([Level.equality(row, [1.0]), Level.equality(row, [2.0])])):
        return EXACT
    return DAMPED


def choose_contestants(solvers: Sequence[str | Solver | Contestant] | None = None) -> tuple[Contestant, ...]:
    """The contestants that a user asked for; None means the default line-up.

    Args:
        solvers: each a solver's name (all its variants), `name:key=value,key=value` (that solver with these settings),
            `package.module:Class` with or without `:key=value`, a `Solver` or a `Contestant`.

    Raises:
        UnknownNameError: no such solver.
        SettingError: an unknown setting, a value it does not allow, or an empty list.
    """
    if solvers is None:
        return default_contestants()
    if isinstance(solvers, str) or not solvers:
        raise SettingError(f"solvers is {solvers!r}; give a list of solver names or Solvers, or None for all of them.")
    chosen: dict[str, Contestant] = {}
    for item in solvers:
        for contestant in _contestants(item):
            known = chosen.setdefault(contestant.label, contestant)
            if repr(known.solver) != repr(contestant.solver):
                raise SettingError(
                    f"Two different contestants are labelled {contestant.label!r}: {known.solver!r} and "
                    f"{contestant.solver!r}; give each Contestant a label of its own."
                )
    return tuple(sorted(chosen.values(), key=lambda contestant: GROUPS.index(contestant.group)))


def _contestants(item: str | Solver | Contestant) -> tuple[Contestant, ...]:
    if isinstance(item, Contestant):
        if item.group not in GROUPS:
            raise unknown_name("group of contestants", item.group, GROUPS)
        return (item,)
    if isinstance(item, str):
        if ":" not in item:
            return variants(item)
        solver = parse_contestant(item)
        return (_known(solver) or Contestant(item.replace(" ", ""), solver, _nearest_group(solver)),)
    if isinstance(item, Solver):
        return (_known(item) or Contestant(repr(item), item, _nearest_group(item)),)
    raise SettingError(f"A contestant is a {type(item).__name__}; give a solver's name, a Solver or a Contestant.")


def _known(solver: Solver) -> Contestant | None:
    """The variant of the default line-up that this solver is, if it is one."""
    known = variants(type(solver).name) if type(solver).name in all_solvers() else ()
    return next(
        (item for item in known if type(item.solver) is type(solver) and repr(item.solver) == repr(solver)), None
    )


def _nearest_group(solver: Solver) -> str:
    """Settings decide between exact and damped; a solver without strict priority stays without it."""
    listed = _VARIANTS.get(type(solver).name, ())
    groups = {group for _, _, group, _ in listed}
    return groups.pop() if len(groups) == 1 else group_of(solver)
