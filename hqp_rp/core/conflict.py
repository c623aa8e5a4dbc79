"""Why hard rows cannot all be met: which of them contradict each other, in words, by how much, and what would help."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np

from hqp_rp.core.diagnostics import norm, one_sided, row_norms
from hqp_rp.core.nonnegative import nonnegative_least_squares
from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.core.row_names import RowName, row_names
from hqp_rp.core.tolerances import MEETS
from hqp_rp.core.verify import Contradiction, fewest_rows, proven_contradiction
from hqp_rp.core.words import listing

_SHOWN = 6
_MANY = 6  # limits of which every set is tried


@dataclasses.dataclass(frozen=True, slots=True)
class Conflict:
    """Hard rows that contradict each other; without any one of them the others can be met.

    Attributes:
        rows: their numbers among the hard rows, those that weigh most first. sides: "lower" or "upper", the bound of each that
            takes part.
        names: each in words, such as "joint limits: j4 upper".
        gap: the least that x can miss the worst of them by, in units of the length of its row; infinite for a row of zeros.
            Where other rows contradict each other too, all hard rows together may miss by more.
        misses: the same in each row's own unit, gap ||a_i||: by how much each of these rows is missed where all of them are
            missed alike. units: "rad/s" for instance, the unit of each, "" where nobody said.
        bounds: the bound of each that takes part, in its unit. causes: what made it, such as "acceleration 2 rad/s^2 x dt", ""
            where nobody said.
        asks: which of these rows asks for what the others forbid: the heaviest that is no bound of a single joint and no law of
            physics.
        possible: how near a_i x comes to that row's bound where the other rows of the conflict are met, in its unit; nan for a
            row of zeros.
        remedies: what alone, moved from the hard rows to a level, would make the others feasible: names of limits, or of rows
            where nobody named limits; limits on joint velocities last; empty where no single one does.
        together: where no single limit but one on joint velocities does, the names of the fewest others that do together (of
            up to 6 limits; of more, some of which none can be spared); empty otherwise.
        joint_limits: those of `remedies` that are limits on joint velocities: keep them hard, for what x asks of the robot
            then has no bound.
        advice: what to change in limits so that it does not come to this, sentences; empty where nobody knows.
    """

    rows: tuple[int, ...]
    sides: tuple[str, ...]
    names: tuple[str, ...]
    gap: float
    remedies: tuple[str, ...]
    misses: tuple[float, ...]
    units: tuple[str, ...]
    bounds: tuple[float, ...]
    causes: tuple[str, ...]
    asks: int
    possible: float
    together: tuple[str, ...]
    joint_limits: tuple[str, ...]
    advice: tuple[str, ...]
    _words: str = dataclasses.field(repr=False)

    def __str__(self) -> str:
        return self._words


def conflict_of(problem: Problem, x: FloatArray | None) -> Conflict | None:
    """The conflict among the hard rows of `problem`, or None where none is proven.

    Args:
        x: (n,) a point that meets them nearly, which makes the proof sharper; None where there is none.
    """
    hard = problem.hard
    if hard is None or not hard.m:
        return None
    found = _proof(hard, x)
    if found is None:
        return None
    names = row_names(problem)
    rows = found.rows.tolist()
    named = [names[row] for row in rows]
    groups = [name.group or name.row for name in names]
    kept = {group for group, name in zip(groups, names, strict=True) if name.keep}
    fixed = {group for group, name in zip(groups, names, strict=True) if name.fixed}
    suspects = sorted(
        dict.fromkeys(groups[row] for row in rows if groups[row] not in fixed), key=lambda group: group in kept
    )
    remedies = [suspect for suspect in suspects if _feasible_without(hard, groups, {suspect})]
    together: tuple[str, ...] = ()
    if all(remedy in kept for remedy in remedies):
        together = _fewest_limits(hard, groups, kept | fixed)
    conflict = Conflict(
        rows=tuple(rows),
        sides=tuple(name.side(side > 0) for name, side in zip(named, found.sides.tolist(), strict=True)),
        names=tuple(f"{name} {name.side(side > 0)}" for name, side in zip(named, found.sides.tolist(), strict=True)),
        gap=found.gap,
        remedies=tuple(remedies),
        misses=tuple((found.gap * row_norms(hard.A)[rows]).tolist())
        if found.gap < math.inf
        else (math.inf,) * len(rows),
        units=tuple(name.unit for name in named),
        bounds=tuple(
            (-1.0 if name.turned else 1.0) * float((hard.upper if side > 0 else hard.lower)[row]) + 0.0
            for name, row, side in zip(named, rows, found.sides.tolist(), strict=True)
        ),
        causes=tuple(
            name.upper_from if side > 0 else name.lower_from
            for name, side in zip(named, found.sides.tolist(), strict=True)
        ),
        asks=min(range(len(named)), key=lambda i: (named[i].fixed, named[i].keep)),
        possible=math.nan,
        together=together,
        joint_limits=tuple(remedy for remedy in remedies if remedy in kept),
        advice=(),
        _words="",
    )
    conflict = dataclasses.replace(conflict, possible=_possible(hard, found, named, conflict.asks))
    conflict = dataclasses.replace(conflict, advice=_advice(conflict, named))
    return dataclasses.replace(conflict, _words=_in_words(conflict, named))


def _possible(hard: Level, found: Contradiction, named: list[RowName], k: int) -> float:
    """How near row k comes to its bound where the others are met.

    With g_i . y <= h_i the one-sided rows of length one and w their weights, sum_i w_i g_i = 0: for the others
    g_k . y >= -sum_{i != k} w_i h_i / w_k, and as they are independent some y meets all of them there.
    """
    if found.gap == math.inf:
        return math.nan
    bound = np.where(found.sides > 0, hard.upper[found.rows], hard.lower[found.rows])
    lengths = row_norms(hard.A)[found.rows]
    h = found.sides * bound / lengths
    others = np.arange(len(h)) != k
    least = -float(found.weights[others] @ h[others]) / float(found.weights[k])
    turned = -1.0 if named[k].turned else 1.0
    return turned * float(found.sides[k]) * float(lengths[k]) * least + 0.0


def _advice(conflict: Conflict, named: list[RowName]) -> tuple[str, ...]:
    """What limits beside joint limits could do earlier, or more slowly, and what laws of physics leave to change."""
    if any(name.fixed for name in named):
        return (
            "Torques, contacts and the equation of motion cannot make way: give joint limits an acceleration= that they can "
            "deliver, or damping= to the level that drives there.",
        )
    if not any(name.keep for name in named):
        return ()
    if all(name.keep for name in named) and len({name.group for name in named}) > 1:
        return ("Give these bounds to one JointLimit, whose box for each joint is never empty.",)
    reached = conflict.possible if conflict.sides[conflict.asks] == "lower" else -conflict.possible
    moving = reached < 0.0 and any(cause.startswith("acceleration") for cause in conflict.causes)
    told = []
    for i, name in enumerate(named):
        bound = conflict.bounds[i] if conflict.sides[i] == "lower" else -conflict.bounds[i]
        if name.returns and bound > 0.0 and not moving and not name.unit.endswith("^2"):
            told.append(f"To ask for a slower way back, {name.returns}.")
        elif name.brakes:
            told.append(f"To brake in time, {name.brakes}.")
    return tuple(dict.fromkeys(told))


def _in_words(conflict: Conflict, named: list[RowName]) -> str:
    k = conflict.asks
    asked, possible = _apart(conflict.bounds[k], conflict.possible)
    unit = f" {conflict.units[k]}" if conflict.units[k] else ""
    more, most = ("at most", "at least") if conflict.sides[k] == "upper" else ("at least", "at most")
    told = [f"{named[k]} asks for {more} {asked}{unit}"]
    if conflict.gap == math.inf:
        told[0] += ", and no x moves this row."
    else:
        others = [i for i in range(len(named)) if i != k]
        groups = dict.fromkeys(named[i].group or named[i].row for i in others)
        within = listing([f"the other rows of {g!r}" if g == named[k].group else repr(g) for g in groups])
        told[0] += f"; within {within} {most} {possible}{unit} is possible."
        shown = [_bound_in_words(conflict, named, i) for i in others[:_SHOWN]]
        told.append(f"In the way: {'; '.join(shown)}{'; ...' if len(others) > _SHOWN else ''}.")
    told += conflict.advice
    limits = [remedy for remedy in conflict.remedies if remedy not in conflict.joint_limits]
    if limits:
        told.append(
            f"Moving {listing(map(repr, limits), 'or')} to a level makes the rest feasible; x may then miss it."
        )
    elif conflict.together:
        alone = " but joint limits" if conflict.joint_limits else ""
        told.append(
            f"No single limit{alone} moved to a level makes the rest feasible; {listing(map(repr, conflict.together))} "
            "together do; x may then miss them."
        )
    elif not conflict.joint_limits:
        told.append("No single limit moved to a level makes the rest feasible.")
    if conflict.joint_limits:
        what = listing(map(repr, conflict.joint_limits), "or")
        does = "does" if limits or conflict.together else "to a level makes the rest feasible"
        told.append(f"Last of all, moving {what} {does}: x may then exceed them.")
    return " ".join(told)


def _bound_in_words(conflict: Conflict, named: list[RowName], i: int) -> str:
    sign = "<=" if conflict.sides[i] == "upper" else ">="
    unit = f" {conflict.units[i]}" if conflict.units[i] else ""
    cause = f" ({conflict.causes[i]})" if conflict.causes[i] else ""
    return f"{named[i]} {sign} {conflict.bounds[i]:.3g}{unit}{cause}"


def _apart(a: float, b: float) -> tuple[str, str]:
    """Both with as many digits, three or more, as tell them apart."""
    told = "", ""
    for digits in range(3, 16):
        told = f"{a:.{digits}g}", f"{b:.{digits}g}"
        if told[0] != told[1]:
            break
    return told


def _fewest_limits(hard: Level, groups: list[str], kept: set[str]) -> tuple[str, ...]:
    """The fewest limits but those `kept` without which the rest is feasible; empty where all of them do not help."""
    others = [group for group in dict.fromkeys(groups) if group not in kept]
    if not others or not _feasible_without(hard, groups, set(others)):
        return ()
    if len(others) <= _MANY:
        for count in range(2, len(others) + 1):
            for chosen in itertools.combinations(others, count):
                if _feasible_without(hard, groups, set(chosen)):
                    return chosen
    chosen_set = set(others)
    for group in others:
        if _feasible_without(hard, groups, chosen_set - {group}):
            chosen_set.discard(group)
    return tuple(group for group in others if group in chosen_set)


def _proof(hard: Level, x: FloatArray | None) -> Contradiction | None:
    starts = [np.zeros(hard.n)] if x is None else [x, np.zeros(hard.n)]
    # Nearer to the rows: the least-squares point of their nearest bounds.
    target = np.clip(hard.A @ starts[0], hard.lower, hard.upper)
    starts.append(np.asarray(np.linalg.lstsq(hard.A, target, rcond=None)[0], dtype=np.float64))
    for start in starts:
        found = proven_contradiction(hard, start)
        if found is not None:
            fewest = fewest_rows(hard, start, found)
            order = np.argsort(-fewest.weights, kind="stable")
            return Contradiction(fewest.rows[order], fewest.sides[order], fewest.weights[order], fewest.gap)
    return None


def _feasible_without(hard: Level, groups: list[str], without: set[str]) -> bool:
    return _feasible(hard, [group not in without for group in groups])


def _feasible(hard: Level, chosen: list[bool]) -> bool:
    """Whether these rows have a common point: the one nearest to 0, by the dual of the least distance problem, meets them.

    Source: Lawson and Hanson 1974, chapter 23, LDP.
    """
    A, lower, upper = hard.A[chosen], hard.lower[chosen], hard.upper[chosen]
    if ((lower > 0.0) | (upper < 0.0))[row_norms(A) == 0.0].any():
        return False
    G, h, _, _ = one_sided(A, lower, upper)
    if not (h < 0.0).any():
        return True
    unit = float(np.abs(h).max())
    target = np.zeros(hard.n + 1)
    target[-1] = 1.0
    # min ||y|| subject to -G y >= -h.
    _, rest = nonnegative_least_squares(np.vstack((-G.T, -h / unit)), target)
    if not rest[-1] > 0.0:
        return False
    y = -unit * rest[:-1] / rest[-1]
    return bool((G @ y <= h + MEETS * (norm(y) + np.abs(h))).all())
