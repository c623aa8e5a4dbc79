"""Who takes part in a comparison: solvers with settings, a short stable label for each, and the group it is drawn in."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence

import numpy as np

from hqp_rp.compare.settings_text import parse_contestant
from hqp_rp.core.errors import SettingError, unknown_name
from hqp_rp.core.problem import Level, Problem
from hqp_rp.core.solver import Solver, all_solvers, get_solver
from hqp_rp.core.variant import DAMPED, EXACT, GROUPS, QP, LineUp


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


def default_contestants(
    *, limits: bool = True, torques: bool = True, transitions: bool = True
) -> tuple[Contestant, ...]:
    """Every solver in the solvers folder: the variants that it declares, or its defaults when it declares none.

    Without `limits`, those that differ from others only where there are hard rows are left out; without `torques`, those that
    speak of inertia; without `transitions`, those that differ from others only while priorities change.

    Raises:
        SettingError: two solvers declare variants of one label.
    """
    occasions = {"limits": limits, "torques": torques, "transitions": transitions, None: True}
    known = [(_line_up(solver), name) for name, solver in all_solvers().items()]
    order = sorted((line_up.place, name) for line_up, name in known if occasions[line_up.only_with])
    return _lined_up(contestant for _, name in order for contestant in variants(name))


def variants(name: str) -> tuple[Contestant, ...]:
    """The contestants of one solver; `UnknownNameError` when there is no such solver."""
    if name not in all_solvers():
        raise unknown_name("solver", name, all_solvers())
    declared = _line_up(all_solvers()[name]).variants
    if not declared:
        solver = get_solver(name)
        return (Contestant(name.replace("_", " "), solver, group_of(solver)),)
    return tuple(
        Contestant(variant.label, get_solver(name, **variant.settings), variant.group, variant.why)
        for variant in declared
    )


def _line_up(solver: type[Solver]) -> LineUp:
    """What the class itself declares: variants of the class that it derives from are not its own."""
    declared = vars(solver).get("variants", LineUp())
    if not isinstance(declared, LineUp):
        raise SettingError(f"{solver.__name__}.variants is {declared!r}; declare a hqp_rp.core.variant.LineUp.")
    return declared


def _lined_up(contestants: Iterable[Contestant]) -> tuple[Contestant, ...]:
    """By group, each once; an error when a label would mean two."""
    chosen: dict[str, Contestant] = {}
    for contestant in contestants:
        known = chosen.setdefault(contestant.label, contestant)
        if repr(known.solver) != repr(contestant.solver):
            raise SettingError(
                f"Two different contestants are labelled {contestant.label!r}: {known.solver!r} and "
                f"{contestant.solver!r}; give each Contestant a label of its own."
            )
    return tuple(sorted(chosen.values(), key=lambda contestant: GROUPS.index(contestant.group)))


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
    return _lined_up(contestant for item in solvers for contestant in _contestants(item))


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
    groups = {variant.group for variant in _line_up(type(solver)).variants}
    return groups.pop() if len(groups) == 1 else group_of(solver)
