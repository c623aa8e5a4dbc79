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
    """The unit of each velocity: "rad/s" or "m/s" where the model tells hinges from slides, else "rad/s or m/s"."""
    units = _units_of(getattr(robot, "model", None))
    return units if len(units) == robot.nv else ["rad/s or m/s"] * robot.nv


def _units_of(model: Any) -> list[str]:
    """What a model of MuJoCo or Pinocchio tells of its velocities; nothing where it does not tell hinges from slides."""
    kinds = getattr(model, "jnt_type", None)
    if kinds is not None:  # free, ball, slide, hinge
        units = (["m/s"] * 3 + ["rad/s"] * 3, ["rad/s"] * 3, ["m/s"], ["rad/s"])
        return [unit for kind in kinds.tolist() for unit in units[kind]]
    # Pinocchio's joints by the first letter of what they are
    joints = [joint.shortname() for joint in list(getattr(model, "joints", ()))[1:] if hasattr(joint, "shortname")]
    if any(not name.startswith(("JointModelR", "JointModelP")) or "Planar" in name for name in joints):
        return []
    return ["m/s" if name.startswith("JointModelP") else "rad/s" for name in joints]


def per_second(unit: str) -> str:
    """The unit over s: "rad/s or m/s" becomes "rad/s^2 or m/s^2"."""
    parts = unit.split(" or ") if unit else []
    return " or ".join(f"{part}^2" if part.endswith("/s") else f"{part}/s" for part in parts)
