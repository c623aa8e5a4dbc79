"""Inverse dynamics as prioritized problems: accelerations of the Sawyer with its torques within limits as hard rows."""

from __future__ import annotations

from collections.abc import Iterator

from hqp_rp.core.problem import Level, Problem
from hqp_rp.problems.recipe import Draw, Recipe
from hqp_rp.problems.robots import TORQUE_STATES, load_snapshot

NAMES = ("tool position", "tool orientation", "posture")


def torque() -> Iterator[Recipe]:
    """Position, orientation and posture by accelerations (3+3+7), torques free or within limits that cut into the answer."""
    for i in range(TORQUE_STATES):
        for kind, words in (
            ("free", "torques not limited"),
            ("limits", "|M v-dot + h| within limits as hard rows, which some joints need more than"),
        ):
            yield Recipe(
                "torque",
                f"sawyer_3-3-7_{kind}_s{i}",
                15_000 + 10 * i,
                f"The Sawyer's TorqueStack at random state {i}: unknown is v-dot, rad/s^2; tool position, tool orientation, "
                f"posture; {words}. "
                "The seed draws nothing: rows and targets are kept as the stack made them.",
                lambda draw, i=i, kind=kind: _problem(draw, i, kind),  # type: ignore[misc]
            )


def _problem(draw: Draw, i: int, kind: str) -> Problem:
    arrays = load_snapshot()
    A, b = arrays[f"torque/{i}/matrix"], arrays[f"torque/{i}/target"]
    levels = [
        Level.equality(A[a:e], b[a:e], name=name) for name, a, e in zip(NAMES, (0, 3, 6), (3, 6, 13), strict=True)
    ]
    if kind == "free":
        return Problem(levels)
    rows, lower, upper = (arrays[f"torque/{i}/{what}"] for what in ("torque_rows", "torque_lower", "torque_upper"))
    return Problem(levels, hard=Level(rows, lower, upper, name="torques"))
