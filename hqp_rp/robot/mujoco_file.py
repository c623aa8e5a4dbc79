"""What MuJoCo makes of an MJCF or URDF file."""

from __future__ import annotations

import contextlib
import os
import pathlib
import re
from collections.abc import Iterable, Iterator

import mujoco

from hqp_rp.core.errors import RobotError
from hqp_rp.core.paths import user_path
from hqp_rp.core.warned import warn
from hqp_rp.robot.inertia import repair
from hqp_rp.robot.mesh_files import Meshes, checked_folders, checked_meshes, drop_meshes, settle_meshes
from hqp_rp.robot.model_file import (
    Path,
    file_format,
    one_line,
    parse_urdf,
    require_floatable,
    urdf_mimics,
    urdf_position_limits,
)

# What MuJoCo says of a URDF and this library does otherwise.
_SEEN_TO = re.compile(r"^<mimic> on joint|has equal lower and upper limits, limit ignored")
_INERTIA = re.compile(r"inertia (must|of moving bodies)")


def mujoco_spec(
    path: Path,
    *,
    floating_base: bool = False,
    meshes: Meshes = True,
    package_paths: Iterable[Path] = (),
    repair_inertias: bool = False,
) -> mujoco.MjSpec:
    """The editable MuJoCo model of an MJCF or URDF file, with every link of a URDF kept as a body of its own.

    Args as `MujocoRobot.from_file`. Raises `RobotError`.
    """
    checked_meshes(meshes)
    path, folders = user_path(path), checked_folders(package_paths)
    urdf = file_format(path) == "urdf"
    if floating_base and not urdf:
        raise RobotError(
            f"floating_base is for URDF files; the MJCF file {os.fspath(path)!r} says with <freejoint/> what floats."
        )
    if urdf:
        parse_urdf(path)
    if path.suffix not in (".xml", ".urdf"):
        raise RobotError(f"MuJoCo reads only files whose name ends in .xml or .urdf: rename {os.fspath(path)!r}.")
    try:
        with _without_known_warnings():
            spec = mujoco.MjSpec.from_file(os.fspath(path))
    except ValueError as error:
        raise RobotError(f"MuJoCo does not read {os.fspath(path)!r}: {one_line(error)}") from error
    if urdf:
        # MuJoCo merges links behind fixed joints into their parents by default; their frames (tools) would be lost.
        spec.compiler.fusestatic = False
        # It also gives a link without <inertial> the mass of its geometry as if of water; the file says none.
        spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
        for coupling in urdf_mimics(path):
            if coupling.source is None:  # MuJoCo leaves out what follows a fixed joint
                held = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1=coupling.joint)
                held.data[:5] = (*coupling.coefficients, 0.0, 0.0, 0.0, 0.0)
    if floating_base:
        require_floatable(path)
        for body in spec.worldbody.bodies:
            body.add_freejoint(name="root_joint")
    settle_meshes(spec, path, meshes, folders)
    if repair_inertias:
        repair(spec)
    return spec


def mujoco_model(
    path: Path,
    *,
    floating_base: bool = False,
    meshes: Meshes = True,
    package_paths: Iterable[Path] = (),
    repair_inertias: bool = False,
) -> mujoco.MjModel:
    """The compiled MuJoCo model of an MJCF or URDF file. Args as `MujocoRobot.from_file`. Raises `RobotError`."""
    path = user_path(path)
    spec = mujoco_spec(
        path,
        floating_base=floating_base,
        meshes=meshes,
        package_paths=package_paths,
        repair_inertias=repair_inertias,
    )
    try:
        with _without_known_warnings():
            model = _compiled(spec, path) if meshes == "if found" else spec.compile()
    except ValueError as error:
        hint = ""
        if _INERTIA.search(str(error)) and not repair_inertias:
            hint = " repair_inertias=True makes the least change that MuJoCo accepts."
        elif meshes and spec.meshes:
            hint = " Its mesh files can be left out with meshes=False."
        raise RobotError(f"MuJoCo does not compile {os.fspath(path)!r}: {one_line(error)}{hint}") from error
    if file_format(path) == "urdf":  # MuJoCo takes equal limits for none, and one of two for none
        for name, limits in urdf_position_limits(path).items():
            joint = model.joint(name).id
            if not model.jnt_limited[joint]:
                model.jnt_range[joint], model.jnt_limited[joint] = limits, 1
    return model


def _compiled(spec: mujoco.MjSpec, path: pathlib.Path) -> mujoco.MjModel:
    """The model, without any mesh where MuJoCo cannot use one of those that are there, which is said."""
    files = [mesh.file for mesh in spec.meshes if mesh.file]
    try:
        return spec.compile()
    except ValueError as error:
        if not files:
            raise
        first = one_line(error)
    drop_meshes(spec, path, [mesh.name for mesh in spec.meshes])
    model = spec.compile()
    warn(
        f"{os.fspath(path)!r}: MuJoCo cannot use one of the mesh files ({first.removesuffix('.')}), so that none of the "
        f"{len(files)} is read; only collision distances need them."
    )
    return model


@contextlib.contextmanager
def _without_known_warnings() -> Iterator[None]:
    """What MuJoCo would write to the terminal, as warnings of Python; not what `urdf_mimics` and the limits see to."""
    if not hasattr(mujoco, "set_mju_user_warning"):
        yield
        return
    told: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(told.append)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)
    for message in told:
        if not _SEEN_TO.search(message):
            warn(f"MuJoCo: {message}")
