"""The rows of a stack in words: which limit or task, which joint or axis, in what unit, and what made each bound."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hqp_rp.control._approach import Approach
from hqp_rp.control._displacement import DisplacementLimit
from hqp_rp.control._native_rows import NativeLimit
from hqp_rp.control._row_names import effort_units, per_second, row_names, velocity_names, velocity_units
from hqp_rp.control.contact import Contact
from hqp_rp.control.joint_limit import JointLimit
from hqp_rp.control.limit import VelocityLimit
from hqp_rp.core.problem import FloatArray, IntArray
from hqp_rp.core.row_names import RowName
from hqp_rp.robot.robot import Robot


def rows_in_words(
    robot: Robot,
    items: Sequence[tuple[int, Any]],
    counts: Sequence[int],
    of_velocities: bool,
    dt: float | None = None,
    v: FloatArray | None = None,
    lower: FloatArray | None = None,
    upper: FloatArray | None = None,
) -> list[RowName]:
    """One for each row of these items; items that share a name are told apart by a number.

    Args:
        robot: that the rows were made on. items: kind and item of each. counts: how many rows each has, and others after them.
        of_velocities: whether the unknown is v; else it is v-dot.
        dt, v: the step that the rows were made for, s, and the velocity (nv,) before it, or None. lower, upper: bounds of these
            rows, or of more that begin with them. To tell what made bounds; without, nobody says.
    """
    told, at = [], 0
    for name, (_, item), count in zip(_apart(items), items, counts, strict=False):
        units = _units(item, robot, count, of_velocities)
        causes = [("", "")] * count
        boxed = count == robot.nv and of_velocities
        if isinstance(item, JointLimit | VelocityLimit) and boxed and dt is not None:
            assert lower is not None
            assert upper is not None
            causes = item.bound_causes(robot, dt, v, lower[at : at + count], upper[at : at + count])
        approach = getattr(item, "_approach", None)
        brakes, returns = (
            (approach.brakes(name), approach.returns(name)) if isinstance(approach, Approach) else ("", "")
        )
        keep = isinstance(item, NativeLimit) or (isinstance(item, DisplacementLimit) and bool(item.row_names(robot)))
        for i, row in enumerate(row_names(item, robot, count)):
            turned = isinstance(item, DisplacementLimit) and row.startswith("-")
            row = row[1:] if turned else row
            lower_from, upper_from = causes[i]
            told.append(RowName(name, row, units[i], lower_from, upper_from, brakes, returns, keep, turned))
        at += count
    return told


def torque_rows_in_words(
    robot: Robot,
    passive: IntArray,
    limited: IntArray,
    contacts: Sequence[Contact],
    force_unit: float,
    items: Sequence[tuple[int, Any]],
    counts: Sequence[int],
) -> list[RowName]:
    """One for each hard row of a `TorqueStack`, in the order in which it has them.

    Args:
        robot, items, counts: as of `rows_in_words`, of the limits. passive, limited: velocity indices that are not driven, and
            those with a torque limit. contacts: all of them. force_unit: N, what forces among the unknowns count in.
    """
    names, efforts = velocity_names(robot), effort_units(robot)
    told = [RowName("equation of motion", names[i], efforts[i], fixed=True) for i in passive]
    told += [RowName("joint torque", names[i], efforts[i], fixed=True) for i in limited]
    force = "N" if force_unit == 1.0 else f"x {force_unit:g} N"  # rows on f / force_unit
    for contact in contacts:
        faces = [*(f"side {i + 1}" for i in range(len(contact.cone_rows()[1]) - 1)), "normal"]
        told += [
            RowName(contact.name, f"point {i + 1} {face}", force, fixed=True)
            for i in range(len(contact.points))
            for face in faces
        ]
    return told + rows_in_words(robot, items, counts, False)


def _apart(items: Sequence[tuple[int, Any]]) -> list[str]:
    """The names of the items, with a number where several share one."""
    names = [str(item.name) for _, item in items]
    return [f"{name} ({names[: i + 1].count(name)})" if names.count(name) > 1 else name for i, name in enumerate(names)]


def _units(item: Any, robot: Robot, count: int, of_velocities: bool) -> list[str]:
    """The unit of each row of an item, "" where it does not say."""
    units = [str(getattr(item, "row_unit", ""))] * count
    own = getattr(item, "row_units", None)
    if isinstance(item, NativeLimit):
        units = velocity_units(robot) if count == robot.nv else units
    elif own is not None:
        units = [*own(robot), *units][:count]
    # Rows on v are rows on v-dot after a division by dt, where they did not bound accelerations all along.
    as_they_are = of_velocities or getattr(item, "bounds_accelerations", False)
    return units if as_they_are else [per_second(unit) for unit in units]
