"""Why hard rows cannot all be met: which of them contradict each other, in words, by how much, and what would help."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from hqp_rp.core.diagnostics import norm, one_sided, row_norms
from hqp_rp.core.nonnegative import nonnegative_least_squares
from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.core.row_names import row_names
from hqp_rp.core.tolerances import FARKAS_WEIGHT, MEETS
from hqp_rp.core.verify import Contradiction, proven_contradiction


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
            missed alike. units: "rad/s or m/s" for instance, the unit of each, "" where nobody said.
        remedies: what alone, moved from the hard rows to a level, would make the others feasible: names of limits, or of rows
            where nobody named limits; empty where no single one does.
    """

    rows: tuple[int, ...]
    sides: tuple[str, ...]
    names: tuple[str, ...]
    gap: float
    remedies: tuple[str, ...]
    misses: tuple[float, ...]
    units: tuple[str, ...]

    def __str__(self) -> str:
        stated = any(self.units) and self.gap != math.inf
        told = [
            f"{name} (by {miss:.3g} {unit})" if unit else name
            for name, miss, unit in zip(self.names, self.misses, self.units, strict=True)
        ]
        what = "; ".join((told if stated else self.names)[:6]) + ("; ..." if len(self.names) > 6 else "")
        how = "no x moves this row" if self.gap == math.inf else f"they miss each other by {self.gap:.3g}"
        if stated:
            how = "at best they are missed alike, by these amounts"
        if not self.remedies:
            return f"{what}: {how}; no single limit moved to a level makes the rest feasible."
        some = " or ".join(repr(remedy) for remedy in self.remedies)
        return f"{what}: {how}; moving {some} to a level makes the rest feasible."


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
    named = row_names(problem)
    rows = found.rows.tolist()
    sides = ["upper" if side > 0 else "lower" for side in found.sides]
    groups = [name.group or name.row for name in named]
    suspects = dict.fromkeys(groups[row] for row in rows)
    remedies = [suspect for suspect in suspects if _feasible(hard, [group != suspect for group in groups])]
    return Conflict(
        rows=tuple(rows),
        sides=tuple(sides),
        names=tuple(f"{named[row]} {side}" for row, side in zip(rows, sides, strict=True)),
        gap=found.gap,
        remedies=tuple(remedies),
        misses=tuple((found.gap * row_norms(hard.A[rows])).tolist())
        if found.gap < math.inf
        else (math.inf,) * len(rows),
        units=tuple(named[row].unit for row in rows),
    )


def _proof(hard: Level, x: FloatArray | None) -> Contradiction | None:
    starts = [np.zeros(hard.n)] if x is None else [x, np.zeros(hard.n)]
    # Nearer to the rows: the least-squares point of their nearest bounds.
    target = np.clip(hard.A @ starts[0], hard.lower, hard.upper)
    starts.append(np.asarray(np.linalg.lstsq(hard.A, target, rcond=None)[0], dtype=np.float64))
    for start in starts:
        found = proven_contradiction(hard, start)
        if found is not None:
            fewest = _fewest(hard, start, found)
            order = np.argsort(-fewest.weights, kind="stable")
            return Contradiction(fewest.rows[order], fewest.sides[order], fewest.weights[order], fewest.gap)
    return None


def _fewest(hard: Level, x: FloatArray, found: Contradiction) -> Contradiction:
    """As few of the rows found as still contradict each other: each is left out in turn, the lightest first.

    Of the rows that are left the weights are unique but for their scale, so that the gap is the least largest miss itself.

    Source: Chinneck and Dravnieks 1991, the deletion filter.
    """
    for row, side in np.stack((found.rows, found.sides), axis=1)[np.argsort(found.weights, kind="stable")]:
        others = (found.rows != row) | (found.sides != side)
        rows, sides = found.rows[others], found.sides[others]
        if len(rows) == len(found.rows) or not len(rows):  # gone with an earlier one, or alone
            continue
        lower = np.where(sides < 0, hard.lower[rows], -np.inf)
        upper = np.where(sides > 0, hard.upper[rows], np.inf)
        fewer = proven_contradiction(Level(hard.A[rows], lower, upper), x)
        if fewer is None:
            continue
        fewer = fewer._replace(rows=rows[fewer.rows])
        # What meets far away only is a proof of contradiction too, but not one of which a row may be left out.
        signed = fewer.sides * fewer.weights / row_norms(hard.A[fewer.rows])
        if norm(signed @ hard.A[fewer.rows]) <= FARKAS_WEIGHT * float(fewer.weights.sum()):
            found = fewer
    return found


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
