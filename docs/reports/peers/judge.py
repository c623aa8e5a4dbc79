"""One verdict for one answer: the same code for every peer, from (problem, x) alone.

    right    certified as the lexicographic least-norm optimum to 1e-6, or within 1e-6 of the known answer;
             of a problem without an answer: not called a success, or hard rows violated by no more than 1e-6
    wrong    called a success, and not right
    refused  not called a success, an exception, no answer in time, the process ended
    cannot   the peer cannot state the problem

A wrong answer is `kept` when it is what the peer promises, to 1e-6: the least weighted sum under its hard rows, the right
answer after its own scaling of each level, or the right answer with rows scaled to length one. Of a weighted sum its value is
enough: the certificate asks each row in its own size, and what a weight of 1e-6 leaves of a task is promised to nobody.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from fresh import Fresh

import hqp_rp
from hqp_rp.core.errors import HqpError
from hqp_rp.problems import KnownProblem

TOLERANCE, TIGHT, LOOSE = 1e-6, 1e-9, 1e-3


def verdict(known: KnownProblem | Fresh, reply: Mapping[str, Any]) -> dict[str, Any]:
    """{"verdict", "said"} for a worker's reply; with "tight" (right to 1e-9) when right, "kept" and "loose" (right to 1e-3)
    when wrong."""
    if "cannot" in reply:
        return {"verdict": "cannot", "said": reply["cannot"]}
    if "x" not in reply:
        return {"verdict": "refused", "said": reply.get("ended") or reply.get("error", "nothing")}
    said = {"said": reply["said"]}
    x = None if reply["x"] is None else np.array(reply["x"])
    if not reply["success"] or x is None or not np.isfinite(x).all():
        good = not known.feasible and not reply["success"]
        return {"verdict": "right" if good else "refused", "tight": good, **said}
    if not known.feasible:
        broken = hqp_rp.certify(known.problem, x).relative_hard_violation
        loose, good, tight = (broken <= tolerance for tolerance in (LOOSE, TOLERANCE, TIGHT))
    else:
        loose, good, tight = (_right(known, x, tolerance) for tolerance in (LOOSE, TOLERANCE, TIGHT))
    if good:
        return {"verdict": "right", "tight": tight, **said}
    return {"verdict": "wrong", "kept": _kept(known.problem, x, reply.get("promise")), "loose": loose, **said}


def _right(known: KnownProblem | Fresh, x: Any, tolerance: float) -> bool:
    near = any(np.linalg.norm(x - answer.x) <= tolerance * (1.0 + np.linalg.norm(answer.x)) for answer in known.answers)
    return near or hqp_rp.certify(known.problem, x, tolerance=tolerance).ok


def _kept(problem: hqp_rp.Problem, x: Any, promise: Mapping[str, Any] | None) -> bool:
    if not promise:
        return False
    try:
        if "weights" in promise:
            promised = _weighted(problem, **promise)
            if _is_least(promised, x):
                return True
        else:
            promised = _unit_rows(problem) if "unit_rows" in promise else _scaled(problem, promise["scales"])
        found = hqp_rp.certify(promised, x, tolerance=TOLERANCE)
    except HqpError:
        return False
    return found.ok or found.fault == "least norm"


def _is_least(promised: hqp_rp.Problem, x: Any) -> bool:
    """Whether hard rows and the root of the sum of squares of the one level are within 1e-6 of what they can be at least."""
    (level,) = promised.levels
    if hqp_rp.certify(promised, x).relative_hard_violation > TOLERANCE:
        return False
    least = hqp_rp.solve(promised, "hierarchical_active_set").x
    if least is None:
        return False
    size = np.linalg.norm(level.A) * np.linalg.norm(x) + np.linalg.norm(np.clip(level.A @ x, level.lower, level.upper))
    return bool(_root_of_sum(level, x) <= _root_of_sum(level, least) + TOLERANCE * size)


def _root_of_sum(level: hqp_rp.Level, x: Any) -> float:
    value = level.A @ x
    return float(np.linalg.norm(value - np.clip(value, level.lower, level.upper)))


def _unit_rows(problem: hqp_rp.Problem) -> hqp_rp.Problem:
    """Every row divided by its length, so that a level's sum of squares is that of distances."""
    levels = []
    for level in problem.levels:
        lengths = np.linalg.norm(level.A, axis=1)
        lengths = np.where(lengths > 0.0, lengths, 1.0)
        levels.append(hqp_rp.Level(level.A / lengths[:, None], level.lower / lengths, level.upper / lengths))
    return hqp_rp.Problem(levels, hard=problem.hard)


def _scaled(problem: hqp_rp.Problem, scales: list[float]) -> hqp_rp.Problem:
    """Each level's target times its scale; a level of scale 0 is given up; a negative scale marks a least-error task."""
    levels = [
        hqp_rp.Level.equality(level.A, (scale if scale > 0.0 else 1.0) * level.lower, name=level.name)
        for level, scale in zip(problem.levels, scales, strict=True)
        if scale != 0.0
    ]
    return hqp_rp.Problem(levels or [hqp_rp.Level.equality(np.eye(problem.n), np.zeros(problem.n))], hard=problem.hard)


def _weighted(problem: hqp_rp.Problem, strict: int, weights: list[float]) -> hqp_rp.Problem:
    """The first levels as hard rows beside the problem's own, the others as one sum of weighted squares."""
    firm = list(problem.levels[:strict]) + ([problem.hard] if problem.hard is not None else [])
    soft = list(zip(problem.levels[strict:], weights, strict=True))
    sum_of = hqp_rp.Level(
        np.vstack([weight * level.A for level, weight in soft]),
        np.concatenate([weight * level.lower for level, weight in soft]),
        np.concatenate([weight * level.upper for level, weight in soft]),
    )
    hard = None
    if firm:
        hard = hqp_rp.Level(
            np.vstack([level.A for level in firm]),
            np.concatenate([level.lower for level in firm]),
            np.concatenate([level.upper for level in firm]),
        )
    return hqp_rp.Problem([sum_of], hard=hard)
