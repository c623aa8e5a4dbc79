"""What a stack warns of: what a model says and no item holds, speeds that nothing bounds, limits that contradict each other for
good."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from hqp_rp.control._displacement import DisplacementLimit
from hqp_rp.control._row_names import velocity_names
from hqp_rp.control.joint_coupling import JointCoupling
from hqp_rp.control.joint_limit import JointLimit
from hqp_rp.control.limit import VelocityLimit
from hqp_rp.control.locked_joints import LockedJoints
from hqp_rp.control.torque_limit import TorqueLimit
from hqp_rp.core.problem import IntArray
from hqp_rp.core.warned import warn
from hqp_rp.core.words import listing
from hqp_rp.robot.robot import Robot

_NAMED = 5


def at_once(limits: Iterable[Any]) -> JointLimit | None:
    """The first of these limits that asks a joint to stop, or to come back, within one step; None where none does."""
    return next((limit for limit in limits if isinstance(limit, JointLimit) and limit.stops_at_once), None)


def at_once_on(limits: Iterable[Any], robot: Robot, limited: IntArray) -> tuple[JointLimit, list[str]] | None:
    """The first such limit on this robot and the joints, of those with a torque limit, that it asks so; None for none."""
    names = velocity_names(robot)
    torques = set(limited.tolist())
    for limit in limits:
        if isinstance(limit, JointLimit):
            joints = [names[i] for i in limit.stopped_at_once(robot) if i in torques]
            if joints:
                return limit, joints
    return None


def warn_of_brakes(limit: JointLimit, joints: Sequence[str] = ()) -> None:
    """Say that this limit asks more than limited torques may give; joints: whose, where that is known."""
    whose = _quoted(joints) if joints else "joints"
    warn(
        f"{limit.name!r} asks {whose} to stop at a position limit, or to come back to it, within one step, and their torques "
        "are limited: where they cannot, the problem is INFEASIBLE at every step, at rest too. Give "
        "JointLimit(acceleration=...) what the torques can deliver, or list it as the first level."
    )


def warn_of_hard_torques(hard: Sequence[Any]) -> None:
    """Hard joint limits that look ahead to no brakes, beside hard torque limits."""
    unbraked = at_once(hard) if any(isinstance(item, TorqueLimit) for item in hard) else None
    if unbraked is not None:
        warn_of_brakes(unbraked)


def warn_of_hard_torques_on(hard: Sequence[Any], robot: Robot) -> None:
    """The same once the robot is known, where it was not said before: joints that lack the brakes which others are given."""
    torques = [item.limited(robot) for item in hard if isinstance(item, TorqueLimit)]
    if not torques or at_once(hard) is not None:
        return
    found = at_once_on(hard, robot, np.concatenate(torques))
    if found is not None:
        warn_of_brakes(*found)


def warn_of_couplings(items: Sequence[Any], robot: Robot) -> None:
    """What the model says of its joints and no item holds is said, in one warning."""
    told = []
    holding = [item.couplings for item in items if isinstance(item, JointCoupling)]
    held = {(coupling.joint, coupling.source) for own in holding for coupling in own or ()}
    couplings = () if None in holding else getattr(robot, "couplings", ())
    locked = {name for item in items if isinstance(item, LockedJoints) for name in item.row_names(robot)}
    loose = [
        coupling.joint
        for coupling in couplings
        if (coupling.joint, coupling.source) not in held and not {coupling.joint, coupling.source} <= locked
    ]
    if loose:
        told.append(
            f"The robot's model says that the joints {_quoted(loose)} follow others, which this stack does not hold; add "
            "JointCoupling() to its limits."
        )
    loops = getattr(robot, "loops", ())
    if loops:
        told.append(
            f"The robot's model has the equality constraints {_quoted(loops)} (loops), which no stack holds: the answers "
            "may break them."
        )
    if told:
        warn(" ".join(told))


def warn_of_speeds(items: Sequence[Any], robot: Robot) -> None:
    """Joint limits that take speeds from a model that says none, which no other item bounds."""
    for item in items:
        loose = item.unlimited_speeds(robot) if isinstance(item, JointLimit) else []
        if loose:
            bounded = {name for other in items for name in _bounded_speeds(other, robot)}
            loose = [name for name in loose if name not in bounded]
        if loose:
            warn(
                f"{item.name!r} bounds no speed of {_quoted(loose)}: the robot's model says no velocity limits, and none "
                "are given. Give JointLimit(velocity=...), or velocity_limit=... when the robot is loaded; "
                "JointLimit(velocity=np.inf) where none is what you mean."
            )
            return


def _bounded_speeds(item: Any, robot: Robot) -> list[str]:
    """The joints whose speed, or what it changes by in a step, an item bounds wherever they are: what bounds positions, an
    obstacle or a frame does not."""
    if isinstance(item, JointLimit | VelocityLimit | DisplacementLimit):
        return item.bounded_speeds(robot)
    return item.row_names(robot) if isinstance(item, LockedJoints) else []


def _quoted(names: Sequence[str]) -> str:
    return listing(map(repr, names), most=_NAMED)
