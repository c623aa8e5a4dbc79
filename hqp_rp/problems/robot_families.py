"""Families from real robots: rows are Jacobians at a configuration, x is a joint velocity (rad/s; m/s for a floating base).

The Jacobians are read from `robots.npz`, so that the problems are the same on every machine.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from hqp_rp.core.problem import FloatArray, Level, Problem
from hqp_rp.problems.recipe import Draw, Recipe
from hqp_rp.problems.robots import SIGMAS, Snapshot, load_snapshot

Block = tuple[str, FloatArray, float]
"""A level's name, its Jacobian, and the power of two that its random rates stay within (m/s, rad/s)."""

_HINGE_LIMIT = 2.0  # rad/s, of every hinge of the humanoid: its model file states none; chosen here
_RATES = "rates uniform on multiples of 2^-20 within"


def sawyer() -> Iterator[Recipe]:
    """7 joints: tool position, orientation and posture in several stacks; near singularities; with velocity limits."""
    arrays = load_snapshot()
    posture: Block = ("posture", np.eye(7), 0.5)

    def blocks(where: str, size: float = 0.25) -> tuple[Block, Block, Block]:
        tool = arrays[f"sawyer/{where}/tool"]
        return ("tool position", tool[:3], size), ("tool orientation", tool[3:], size), ("tool pose", tool, size)

    for i in range(3):
        position, orientation, pose = blocks(str(i))
        speed = 2.0 if i % 2 == 0 else 1.0
        fast, turning, _ = blocks(str(i), speed)
        limit = ("joint velocity", arrays["sawyer/velocity_limit"])
        cases: list[tuple[str, str, list[Block], dict[str, tuple[str, FloatArray]]]] = [
            ("3-3", "Tool position, tool orientation", [position, orientation], {}),
            ("3-3-7", "Tool position, tool orientation, posture", [position, orientation, posture], {}),
            ("6-3-7", "Tool pose, tool position again with other rates, posture", [pose, position, posture], {}),
            ("3-3-7_limits", "Tool position, orientation and posture, hard velocity limits", [fast, turning, posture],
             {"hard": limit}),
            ("3-7-3_band", "Tool position; joint velocities softly within a tenth of their limits; tool orientation",
             [fast, turning], {"second": (limit[0], 0.1 * limit[1])}),
        ]  # fmt: skip
        for j, (label, words, levels, bounds) in enumerate(cases):
            yield _recipe(
                "sawyer", f"{label}_q{i}", 10_000 + 10 * i + j, f"{words}, at random configuration {i}.", levels, bounds
            )
    yield _recipe(
        "sawyer",
        "6-7_zero",
        10_100,
        "Tool pose and posture at q = 0, the arm stretched upwards with joint axes in line: the pose's rows have rank 4.",
        [blocks("zero")[2], posture],
    )
    for sigma in SIGMAS:
        position, orientation, _ = blocks(f"sigma{sigma:.0e}")
        yield _recipe(
            "sawyer",
            f"3-3-7_sigma{sigma:.0e}",
            10_200,
            f"Tool position, tool orientation, posture, at sigma_min = {sigma:.0e} (to first order, over ||A_2||) of the "
            "orientation rows beside the position rows: led to an algorithmic singularity of the real kinematics. One seed "
            "for all sigmas.",
            [position, orientation, posture],
            distance=sigma,
        )


def dual_arm() -> Iterator[Recipe]:
    """14 joints: two Sawyers side by side, absolute and relative poses."""
    arrays = load_snapshot()
    limit = ("joint velocity", np.tile(arrays["sawyer/velocity_limit"], 2))
    posture: Block = ("posture", np.eye(14), 0.5)
    for i in range(3):
        left, right, relative = (arrays[f"dual_arm/{i}/{what}"] for what in ("left", "right", "relative"))
        held: Block = ("relative pose", relative, 0.25)
        speed = 2.0 if i % 2 == 0 else 1.0
        cases: list[tuple[str, str, list[Block], dict[str, tuple[str, FloatArray]]]] = [
            ("6-3-14", "Relative pose, left tool position, posture", [held, ("left position", left[:3], 0.25), posture], {}),
            ("6-6-6", "Left pose, right pose, relative pose: dependent on both up to rounding, with rates that contradict them",
             [("left pose", left, 0.25), ("right pose", right, 0.25), held], {}),
            ("6-6-14_limits", "Relative pose, right pose, posture, hard velocity limits",
             [held, ("right pose", right, speed), posture], {"hard": limit}),
            ("6-14-6_band", "Left pose; joint velocities softly within a tenth of their limits; right pose",
             [("left pose", left, speed), ("right pose", right, speed)], {"second": (limit[0], 0.1 * limit[1])}),
        ]  # fmt: skip
        for j, (label, words, levels, bounds) in enumerate(cases):
            yield _recipe(
                "dual_arm",
                f"{label}_q{i}",
                11_000 + 10 * i + j,
                f"{words}, at random configuration {i}.",
                levels,
                bounds,
            )


def humanoid() -> Iterator[Recipe]:
    """Apptronik Apollo, 32 joints and a floating base (n = 38), five levels."""
    arrays = load_snapshot()
    posture: Block = ("posture", np.eye(38)[6:], 0.5)
    limit = ("joint velocity", np.append(np.full(6, np.inf), np.full(32, _HINGE_LIMIT)))
    for i in range(4):
        at: Snapshot = {
            name: arrays[f"humanoid/{i}/{name}"]
            for name in ("left_foot", "right_foot", "left_hand", "right_hand", "torso", "com")
        }
        feet: Block = ("feet", np.vstack([at["left_foot"], at["right_foot"]]), 0.0)
        com: Block = ("centre of mass", at["com"], 0.125)
        hands = np.vstack([at["left_hand"], at["right_hand"]])
        torso = at["torso"][3:]
        speed = 2.0 if i % 2 == 0 else 0.5
        pose = "the neutral pose" if i == 0 else f"random configuration {i}"
        cases: list[tuple[str, str, list[Block], dict[str, tuple[str, FloatArray]]]] = [
            ("12-3-6-3-32", "Feet at rest, centre of mass, right hand pose, left hand position, posture",
             [feet, com, ("right hand", at["right_hand"], 0.25), ("left hand", at["left_hand"][:3], 0.25), posture], {}),
            ("12-3-12-3-32", "Feet at rest, centre of mass, both hand poses, torso orientation, posture",
             [feet, com, ("hands", hands, 0.25), ("torso", torso, 0.25), posture], {}),
            ("12-3-12-3-32_limits", "Feet at rest, centre of mass, both hand poses, torso orientation, posture, hard "
             "velocity limits of 2 rad/s on the 32 joints",
             [feet, com, ("hands", hands, speed), ("torso", torso, 0.5), posture], {"hard": limit}),
            ("12-32-3-12-32_band", "Feet at rest; joint velocities softly within 0.25 rad/s; centre of mass, both hand poses, "
             "posture",
             [feet, com, ("hands", hands, speed), posture], {"second": (limit[0], 0.125 * limit[1])}),
        ]  # fmt: skip
        for j, (label, words, levels, bounds) in enumerate(cases):
            yield _recipe("humanoid", f"{label}_q{i}", 12_000 + 10 * i + j, f"{words}, in {pose}.", levels, bounds)


_TORQUE = {
    "free": "Tool position, tool orientation and posture as joint accelerations (rad/s^2) of a moving arm; the metric is the "
    "inertia matrix.",
    "limits": "Tool position, tool orientation and posture as joint accelerations of a moving arm; hard torque limits of 60 "
    "N m and joint limits.",
    "contact": "The tool rests on a surface: the contact at rest, tool orientation, posture; joint accelerations and the "
    "contact force (100 N) as unknowns; hard torque limits of 60 N m, friction and unilaterality.",
}


def torque() -> Iterator[Recipe]:
    """A Sawyer commanded by torques: inverse dynamics with the torques eliminated."""
    arrays = load_snapshot()
    for label, words in _TORQUE.items():
        for i in range(3):
            own = {
                name.rpartition("/")[2]: array
                for name, array in arrays.items()
                if name.startswith(f"torque/{label}_q{i}/")
            }
            yield Recipe(
                "torque",
                f"{label}_q{i}",
                400 + i,
                f"{words} At random configuration {i}, numbers kept in robots.npz.",
                lambda draw, own=own: _kept(own),  # type: ignore[misc]
                since="1.1",
            )


def _kept(arrays: Snapshot) -> Problem:
    """The problem of which the snapshot holds every number."""
    cuts = arrays["offsets"].astype(np.int64)
    levels = [
        Level(arrays["matrix"][a:b], arrays["lower"][a:b], arrays["upper"][a:b]) for a, b in itertools.pairwise(cuts)
    ]
    hard = Level(arrays["hard_A"], arrays["hard_lower"], arrays["hard_upper"], "limits") if "hard_A" in arrays else None
    return Problem(levels, hard, metric=arrays.get("metric"))


def _recipe(
    family: str,
    label: str,
    seed: int,
    made: str,
    blocks: Sequence[Block],
    bounds: dict[str, tuple[str, FloatArray]] | None = None,
    distance: float | None = None,
) -> Recipe:
    sizes = ", ".join(f"{size:g}" for _, _, size in blocks)
    made = f"{made} Targets: {_RATES} {sizes} m/s or rad/s."
    return Recipe(family, label, seed, made, lambda draw: _problem(draw, blocks, bounds or {}), distance)


def _problem(draw: Draw, blocks: Sequence[Block], bounds: dict[str, tuple[str, FloatArray]]) -> Problem:
    """`J_k x = rate_k`; "hard" bounds |x| as hard rows, "second" as the second level; rows without a bound are left out."""
    levels = [Level.equality(J, draw.grid(len(J)) * size, name=name) for name, J, size in blocks]
    if "second" in bounds:
        levels.insert(1, _bounded(*bounds["second"]))
    return Problem(levels, hard=_bounded(*bounds["hard"]) if "hard" in bounds else None)


def _bounded(name: str, limit: FloatArray) -> Level:
    finite = np.isfinite(limit)
    return Level(np.eye(len(limit))[finite], -limit[finite], limit[finite], name=name)
