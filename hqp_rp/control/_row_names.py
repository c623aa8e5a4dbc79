"""The rows of a limit in words, for whoever asks why they cannot all be met."""

from __future__ import annotations

from typing import Any

from hqp_rp.robot.robot import Robot


def row_names(item: Any, robot: Robot, count: int) -> list[str]:
    """One name for each of an item's `count` rows: its own `row_names(robot)` where it has as many, else numbers."""
    own = getattr(item, "row_names", None)
    if own is not None:
        names = [str(name) for name in own(robot)]
        if len(names) == count:
            return names
    return ["its row"] if count == 1 else [f"row {i}" for i in range(count)]


def velocity_names(robot: Robot) -> list[str]:
    """The joint of each velocity; those of free and ball joints with a number."""
    names = robot.joint_names
    widths = getattr(robot, "joint_widths", (1,) * len(names))
    if sum(widths) != robot.nv:
        return [f"velocity {i}" for i in range(robot.nv)]
    return [
        name if width == 1 else f"{name}[{i}]" for name, width in zip(names, widths, strict=True) for i in range(width)
    ]


def velocity_units(robot: Robot) -> list[str]:
    """The unit of each velocity: "rad/s" or "m/s" where the model tells turning from sliding, else "rad/s or m/s"."""
    units = _units_of(getattr(robot, "model", None))
    return units if len(units) == robot.nv else ["rad/s or m/s"] * robot.nv


def _units_of(model: Any) -> list[str]:
    """What a model of MuJoCo or Pinocchio tells of its velocities; nothing where it is neither."""
    kinds = getattr(model, "jnt_type", None)
    if kinds is not None:  # free, ball, slide, hinge
        units = (["m/s"] * 3 + ["rad/s"] * 3, ["rad/s"] * 3, ["m/s"], ["rad/s"])
        return [unit for kind in kinds.tolist() for unit in units[kind]]
    return [unit for joint in list(getattr(model, "joints", ()))[1:] for unit in _units_of_joint(joint)]


def _units_of_joint(joint: Any) -> list[str]:
    """The unit of each velocity of a joint of Pinocchio."""
    kind = str(joint.shortname()).removeprefix("JointModel") if hasattr(joint, "shortname") else ""
    count = int(getattr(joint, "nv", 0))
    linear = {"FreeFlyer": 3, "Planar": 2, "Translation": 3}  # of these the first so many
    if kind not in linear and not kind.startswith(("Prismatic", "PX", "PY", "PZ", "R", "H", "Spherical", "Universal")):
        return ["rad/s or m/s"] * count
    first = linear.get(kind, count if kind.startswith("P") else 0)
    return ["m/s" if i < first else "rad/s" for i in range(count)]


def effort_units(robot: Robot) -> list[str]:
    """The unit of the generalized force along each velocity: "N m", "N", or "N m or N" where the model does not tell."""
    efforts = {"rad/s": "N m", "m/s": "N"}
    return [efforts.get(unit, "N m or N") for unit in velocity_units(robot)]


def per_second(unit: str) -> str:
    """The unit over s: "rad/s or m/s" becomes "rad/s^2 or m/s^2"."""
    parts = unit.split(" or ") if unit else []
    return " or ".join(f"{part}^2" if part.endswith("/s") else f"{part}/s" for part in parts)
