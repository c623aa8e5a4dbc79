"""Robot model files: which format a file is, what a URDF says, and one call that loads either into a robot."""

from __future__ import annotations

import contextlib
import math
import os
import re
from collections.abc import Iterable, Mapping
from typing import Literal
from xml.etree import ElementTree

from numpy.typing import ArrayLike

from hqp_rp.core import warned
from hqp_rp.core.errors import RobotError, unknown_name
from hqp_rp.core.extras import require
from hqp_rp.core.paths import user_path
from hqp_rp.robot.coupling import Coupling
from hqp_rp.robot.mesh_files import Meshes
from hqp_rp.robot.robot import Robot

Path = str | os.PathLike[str]

_SCALAR = ("revolute", "prismatic", "continuous")


def load_robot(
    path: Path,
    library: str = "mujoco",
    *,
    floating_base: bool = False,
    meshes: Meshes = True,
    package_paths: Iterable[Path] = (),
    repair_inertias: bool = False,
    velocity_limit: ArrayLike | Mapping[str, float] | None = None,
    neutral: ArrayLike | str | None = None,
) -> Robot:
    """The robot of an MJCF or URDF file, computed by MuJoCo or Pinocchio.

    Args:
        path: the file; its root element (`<mujoco>` or `<robot>`) says which format it is.
        library: "mujoco" or "pinocchio".
        floating_base, meshes, package_paths, repair_inertias, velocity_limit, neutral: as in `MujocoRobot.from_file`.

    Raises:
        RobotError: no such file, a file that the library does not read (with its message), or an argument that does not
            fit the robot.
        SettingError: `meshes` or `package_paths` that are none. UnknownNameError: another library.
        MissingExtraError: the library is not installed, or MuJoCo for an MJCF file in Pinocchio.
    """
    if library not in ("mujoco", "pinocchio"):
        raise unknown_name("robot library", library, ("mujoco", "pinocchio"))
    if library == "mujoco":
        require("load_robot", "mujoco")
        from hqp_rp.robot.mujoco_robot import MujocoRobot as Adapter
    else:
        require('load_robot(..., library="pinocchio")', "pinocchio")
        from hqp_rp.robot.pinocchio_robot import PinocchioRobot as Adapter  # type: ignore[assignment]
    return Adapter.from_file(
        path,
        floating_base=floating_base,
        meshes=meshes,
        package_paths=package_paths,
        repair_inertias=repair_inertias,
        velocity_limit=velocity_limit,
        neutral=neutral,
    )


def file_format(path: Path) -> Literal["mjcf", "urdf"]:
    """Which of the two formats the file is, by its root element. Raises `RobotError` when it is neither, or absent."""
    try:
        with open(user_path(path), "rb") as file:
            text = file.read().decode("utf-8", errors="replace")
    except OSError as error:
        raise RobotError(f"The robot file {os.fspath(path)!r} cannot be read: {error.strerror}.") from error
    text = re.sub(r"<!--.*?-->|<\?.*?\?>|<!DOCTYPE[^>]*>", "", text, flags=re.DOTALL)
    root = re.match(r"\s*\ufeff?\s*<\s*([\w:.-]+)", text)
    if root and root[1] == "mujoco":
        return "mjcf"
    if root and root[1] == "robot":
        return "urdf"
    found = f"its root element is <{root[1]}>" if root else "it does not begin with an XML element"
    raise RobotError(
        f"The file {os.fspath(path)!r} is no robot model: {found}; an MJCF file begins with <mujoco>, a URDF file with "
        "<robot>."
    )


def urdf_velocity_limits(path: Path, *, warn: bool = True) -> dict[str, float]:
    """Joint name -> velocity limit (rad/s or m/s) of a URDF file, for the joints that can move and state one.

    Raises `RobotError` for a negative one; warns of those that are 0, unless told not to.
    """
    limits = {}
    for joint in parse_urdf(path).iterfind("joint"):
        limit = joint.find("limit")
        value = None if limit is None else limit.get("velocity")
        if value is not None and joint.get("type") != "fixed":
            name = joint.get("name", "")
            limits[name] = _number(path, name, "velocity limit", value)
            if limits[name] < 0.0:
                raise RobotError(
                    f"The URDF file {os.fspath(path)!r}: joint {name!r} has the velocity limit {value}; it must be >= 0; "
                    "mend the file."
                )
    still = [repr(name) for name, limit in limits.items() if limit == 0.0]
    if still and warn:
        one = len(still) == 1
        warned.warn(
            f"The URDF file {os.fspath(path)!r}: {'joint' if one else 'joints'} {', '.join(still)} {'has' if one else 'have'} "
            f"the velocity limit 0, so {'it' if one else 'they'} may not move; give velocity_limit where that is not meant."
        )
    return limits


def urdf_effort_limits(path: Path) -> dict[str, float]:
    """Joint name -> effort limit (N m or N) of a URDF file, for the joints that can move and state one that is > 0."""
    limits = {}
    for joint in parse_urdf(path).iterfind("joint"):
        limit = joint.find("limit")
        value = None if limit is None else limit.get("effort")
        if value is not None and joint.get("type") != "fixed":
            effort = _number(path, joint.get("name", ""), "effort limit", value)
            if effort > 0.0:
                limits[joint.get("name", "")] = effort
    return limits


def urdf_position_limits(path: Path) -> dict[str, tuple[float, float]]:
    """Joint name -> lower and upper, rad or m, of the revolute and prismatic joints of a URDF that state a limit.

    Of a joint that states one of the two the other is 0, as URDF has it. A joint that states neither, or one as 0 and not
    the other, is taken for one without limits; of the latter, one warns. Raises `RobotError` for lower > upper.
    """
    limits, vague = {}, []
    for joint in parse_urdf(path).iterfind("joint"):
        limit = joint.find("limit")
        if limit is None or joint.get("type") not in ("revolute", "prismatic"):
            continue
        low, high, name = limit.get("lower"), limit.get("upper"), joint.get("name", "")
        if low is None and high is None:
            continue
        lower = _number(path, name, "lower limit", low or "0")
        upper = _number(path, name, "upper limit", high or "0")
        if lower > upper:
            left_out = "" if low and high else " (0 where it states none)"
            raise RobotError(
                f"The URDF file {os.fspath(path)!r}: joint {name!r} has lower {lower:g} > upper {upper:g}{left_out}; mend "
                "the file."
            )
        if lower == upper and (low is None or high is None):
            vague.append(name)
        else:
            limits[name] = (lower, upper)
    if vague:
        warned.warn(
            f"The URDF file {os.fspath(path)!r}: {', '.join(map(repr, vague))} state one of lower and upper, as 0, and not the "
            "other; taken for joints without limits. State both to lock them at 0."
        )
    return limits


def urdf_mimics(path: Path) -> tuple[Coupling, ...]:
    """What the `<mimic>` elements of a URDF file say of joints that can move; a fixed joint that they follow is at 0.

    Warns of those that follow a joint that the file does not have, or one that is not a hinge or slide: they are not kept.
    """
    joints = {joint.get("name", ""): joint for joint in parse_urdf(path).iterfind("joint")}
    kinds = {name: "scalar" if joint.get("type") in _SCALAR else joint.get("type") for name, joint in joints.items()}
    found, lost = [], []
    for name, joint in joints.items():
        mimic = joint.find("mimic")
        if mimic is None or kinds[name] == "fixed":
            continue
        offset = _number(path, name, "mimic offset", mimic.get("offset", "0"))
        multiplier = _number(path, name, "mimic multiplier", mimic.get("multiplier", "1"))
        source = mimic.get("joint", "")
        if kinds[name] != "scalar" or source == name or kinds.get(source) not in ("scalar", "fixed"):
            lost.append(f"joint {name!r} mimics {source!r}")
        elif kinds[source] == "fixed":
            found.append(Coupling(name, None, (offset,)))
        else:
            found.append(Coupling(name, source, (offset, multiplier)))
    if lost:
        warned.warn(
            f"The URDF file {os.fspath(path)!r}: {', '.join(lost)}, which is no other hinge or slide of the file, so that is "
            "not kept; mend the file."
        )
    return tuple(found)


def _number(path: Path, joint: str, what: str, value: str) -> float:
    with contextlib.suppress(ValueError):
        if not math.isnan(number := float(value)):
            return number
    raise RobotError(
        f"The URDF file {os.fspath(path)!r}: joint {joint!r} has the {what} {value!r}; it must be a number."
    )


def parse_urdf(path: Path) -> ElementTree.Element:
    """The root element of a URDF file. Raises `RobotError` where it has no link or is not well-formed XML (with line)."""
    try:
        root = ElementTree.parse(user_path(path)).getroot()
    except ElementTree.ParseError as error:
        raise RobotError(f"The URDF file {os.fspath(path)!r} is not well-formed XML: {error}.") from error
    if root.find("link") is None:
        raise RobotError(
            f"The URDF file {os.fspath(path)!r} has no <link>, so it is no robot; of a xacro file, give "
            "what `xacro FILE` prints."
        )
    return root


def require_floatable(path: Path) -> None:
    """Raises `RobotError` where the root link of a URDF is the world, which cannot float."""
    root = parse_urdf(path)
    children = {child.get("link") for child in root.iterfind("joint/child")}
    if "world" in {link.get("name") for link in root.iterfind("link")} - children:
        raise RobotError(
            f"The root link of {os.fspath(path)!r} is 'world', to which the robot is fixed: it cannot have a floating base."
        )


def one_line(error: Exception) -> str:
    """The message of a library's error on one line, ended by a full stop."""
    text = " ".join(str(error).split())
    return text if text.endswith(".") else text + "."
