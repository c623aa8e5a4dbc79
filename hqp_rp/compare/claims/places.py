"""Where the arm starts: regular postures drawn at random, and places beside algorithmic singularities, found by search."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hqp_rp.control.singularities import search_singularities
from hqp_rp.control.stack import Stack
from hqp_rp.control.twist_task import TwistTask
from hqp_rp.core.diagnostics import norm
from hqp_rp.core.errors import SettingError
from hqp_rp.robot.arms import sawyer
from hqp_rp.robot.mujoco_robot import MujocoRobot
from hqp_rp.scenarios._interaction import REGULAR, SINGULAR, Place

ROOM = 0.5
"""rad, that every posture keeps from every joint limit."""
LEAST_SIGMA = 0.15
"""A posture is regular when no singular value of the tool's Jacobian, m and rad mixed, is below this."""
_DRAWS = 100_000
_STARTS = (128, 512, 2048)
_SHOULDER = (0.0, 0.0, 0.317)  # m


def regular_places(count: int, seed: int = 0) -> list[Place]:
    """The neutral posture and count - 1 others, uniform over the joint ranges, of those that are regular.

    `direction` leads away from the shoulder in the plane of y and z: what the conflict's target moves along.
    """
    arm = sawyer()
    rng = np.random.default_rng(seed)
    lower, upper = np.array(arm.lower) + ROOM, np.array(arm.upper) - ROOM
    found = [np.array(arm.neutral)]
    for _ in range(_DRAWS):
        if len(found) == count:
            break
        q = rng.uniform(lower, upper)
        if np.linalg.svd(arm.jacobian(q, "tool"), compute_uv=False)[-1] >= LEAST_SIGMA:
            found.append(q)
    places = []
    for q in found[:count]:
        away = (arm.pose(q, "tool")[1] - np.array(_SHOULDER))[1:]
        places.append(Place(REGULAR, q, direction=away / norm(away)))
    return places


def singular_places(
    levels: Sequence[Sequence[str]], count: int, distance: float, *, edges: bool = False
) -> list[Place]:
    """Places beside `count` different singularities at which the second of two levels of the tool loses a direction.

    Of all that the search finds at least `ROOM` from every joint limit, the ones farthest from a kinematic singularity.

    Args:
        levels: axes of the first and the second level. count: how many. distance: rad, along the approach.
        edges: only those from which the lost singular value grows in both directions.

    Raises:
        SettingError: the search found fewer.
    """
    arm = sawyer()
    robot = MujocoRobot.from_arm(arm)
    stack = Stack([TwistTask("tool", axes=tuple(axes)) for axes in levels])
    lower, upper = np.array(arm.lower) + ROOM, np.array(arm.upper) - ROOM
    found = []
    for starts in _STARTS:
        found = [
            place
            for place in search_singularities(robot, stack, level=1, starts=starts, seed=0)
            if ((place.q >= lower) & (place.q <= upper)).all() and (place.is_edge or not edges)
        ]
        if len(found) >= count:
            break
    if len(found) < count:
        raise SettingError(f"The search finds {len(found)} singularities beside {levels[0]}; {count} are asked for.")
    found.sort(key=lambda place: -min(place.own_sigma, place.earlier_sigma))
    return [Place(SINGULAR, p.q, p.approach, p.task_direction, distance) for p in found[:count]]
