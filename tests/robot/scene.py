"""One URDF scene of shapes that fly freely, for both libraries, and robots of it."""

from __future__ import annotations

import pathlib

from hqp_rp.robot import MujocoRobot, PinocchioRobot

SHAPES = {
    "sphere": '<sphere radius="0.1"/>',
    "capsule": '<capsule radius="0.08" length="0.4"/>',
    "box": '<box size="0.2 0.4 0.3"/>',
    "cylinder": '<cylinder radius="0.1" length="0.4"/>',
}
INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
_AXES = [(kind, axis) for kind in ("prismatic", "revolute") for axis in ("1 0 0", "0 1 0", "0 0 1")]


def link(name: str, geometry: str = "", origin: str = 'xyz="0 0 0"', collision: str = "") -> str:
    named = f' name="{collision}"' if collision else ""
    shape = f"<collision{named}><origin {origin}/><geometry>{geometry}</geometry></collision>" if geometry else ""
    return f'<link name="{name}">{INERTIAL}{shape}</link>'


def joint(name: str, parent: str, child: str, kind: str = "revolute", axis: str = "0 0 1", xyz: str = "0 0 0") -> str:
    limit = '<limit lower="-9" upper="9" velocity="2" effort="1"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
        f'<origin xyz="{xyz}"/>{limit}</joint>'
    )


def flying(*shapes: str) -> str:
    """URDF: each shape, off the centre of its link, on three slides and three hinges from the world."""
    text = '<robot name="scene"><link name="world"/>'
    for s, shape in enumerate(shapes):
        parent = "world"
        for i, (kind, axis) in enumerate(_AXES):
            child = f"body{s}" if i == 5 else f"body{s}_{i}"
            own = {"geometry": shape, "origin": 'xyz=".1 0 .05" rpy=".1 .2 .3"', "collision": f"shape{s}"}
            text += link(child, **own) if i == 5 else link(child)
            text += joint(f"joint{s}_{i}", parent, child, kind, axis)
            parent = child
    return text + "</robot>"


def both(path: pathlib.Path, urdf: str) -> tuple[MujocoRobot, PinocchioRobot]:
    """The robots of a URDF in either library, MuJoCo's distances as exact as they get."""
    path.write_text(urdf)
    robots = MujocoRobot.from_file(path), PinocchioRobot.from_file(path)
    robots[0].model.opt.ccd_tolerance, robots[0].model.opt.ccd_iterations = 1e-10, 200
    return robots
