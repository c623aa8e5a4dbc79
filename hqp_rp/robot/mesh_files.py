"""The mesh files that a robot model names: where they are, which of them MuJoCo can have, and a model without the others."""

from __future__ import annotations

import os
import pathlib
import re
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Literal, TypeAlias

from hqp_rp.core.errors import RobotError, SettingError
from hqp_rp.core.paths import user_path
from hqp_rp.core.warned import warn

if TYPE_CHECKING:
    import mujoco

Meshes: TypeAlias = bool | Literal["if found"]
"""True: every mesh file has to be there. False: none is read. "if found": those that are not there, or not of a kind that
MuJoCo reads, are left out, and one warning says so."""

READ = (".stl", ".obj", ".msh")
"""The kinds of mesh files that MuJoCo reads."""

_URI = re.compile(r"(package|model)://+(?P<package>[^/]+)/(?P<rest>.+)")


def checked_meshes(meshes: object) -> None:
    """Raises `SettingError` for what is none of `Meshes`."""
    if not (isinstance(meshes, bool) or meshes == "if found"):
        raise SettingError(f'meshes is {meshes!r}; it must be True, False or "if found".')


def checked_folders(package_paths: Iterable[str | os.PathLike[str]]) -> tuple[pathlib.Path, ...]:
    """The folders of packages, `~` expanded. Raises `SettingError` for one that is no folder."""
    if isinstance(package_paths, str | os.PathLike):
        raise SettingError(f"package_paths is {os.fspath(package_paths)!r}; give a list of folders.")
    folders = tuple(user_path(path) for path in package_paths)
    for folder in folders:
        if not folder.is_dir():
            raise SettingError(
                f"package_paths holds {os.fspath(folder)!r}, which is no folder; give the folder that holds the packages."
            )
    return folders


def resolved(uri: str, model: pathlib.Path, package_paths: Sequence[pathlib.Path] = ()) -> pathlib.Path | None:
    """The file that a `package://PACKAGE/REST`, `model://...` or `file://...` of the model file stands for; None: not found.

    PACKAGE is looked for in `package_paths`, in the folders above the model file, and where ROS_PACKAGE_PATH and
    AMENT_PREFIX_PATH say; each of these folders may hold the package, or be it (under whatever name it was copied).
    """
    if uri.startswith("file://"):
        return _existing([pathlib.Path(uri.removeprefix("file://"))])
    match = _URI.fullmatch(uri)
    if match is None:
        return _existing([pathlib.Path(uri)])
    places = list(_places(model, package_paths))
    held = [place / match["package"] / match["rest"] for place in places]
    return _existing([*held, *(place / match["rest"] for place in places)])


def _places(model: pathlib.Path, package_paths: Sequence[pathlib.Path]) -> Iterator[pathlib.Path]:
    yield from package_paths
    yield from model.absolute().parents
    for folder in filter(None, os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)):
        yield pathlib.Path(folder)
    for folder in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        yield pathlib.Path(folder) / "share"


def _existing(paths: Iterable[pathlib.Path]) -> pathlib.Path | None:
    return next((path for path in paths if path.is_file()), None)


def settle_meshes(
    spec: mujoco.MjSpec, model: pathlib.Path, meshes: Meshes, package_paths: Sequence[pathlib.Path]
) -> None:
    """Give every mesh of `spec` the file that its URI stands for, and leave out what `meshes` says.

    Raises `RobotError` for a mesh that is needed and not found behind a package:// URI; MuJoCo itself names other files.
    Warns, in one sentence, of what is left out with "if found".
    """
    if meshes is False:
        drop_meshes(spec, model, [mesh.name for mesh in spec.meshes])
        return
    absent, unread = [], []
    for mesh in spec.meshes:
        if not mesh.file:  # vertices in the model itself
            continue
        found = _file_of(spec, mesh.file, model, package_paths)
        if found is None:
            absent.append(mesh)
        elif found.suffix.lower() not in READ:
            unread.append(mesh)
        elif "://" in mesh.file:
            mesh.file = os.fspath(found.absolute())
    if meshes is True:
        lost = next((mesh.file for mesh in absent if _URI.fullmatch(mesh.file)), None)
        if lost is not None:
            raise RobotError(
                f"The mesh file {lost!r} of {os.fspath(model)!r} is not found: give package_paths=[FOLDER], the folder that "
                f"holds the package {_URI.fullmatch(lost)['package']!r}, or leave mesh files out with meshes=False."  # type: ignore[index]
            )
        return
    if absent or unread:
        count = len([mesh for mesh in spec.meshes if mesh.file])
        warn_of_lost(model, count, [mesh.file for mesh in absent], [mesh.file for mesh in unread])
        drop_meshes(spec, model, [mesh.name for mesh in (*absent, *unread)])


def warn_of_lost(model: pathlib.Path, count: int, absent: Sequence[str], unread: Sequence[str]) -> None:
    """One sentence on what is left out of `count` mesh files."""
    told, remedy = [], []
    if absent:
        told.append(f"{len(absent)} not found ({absent[0]!r}{' ...' if len(absent) > 1 else ''})")
        uri = next(filter(None, map(_URI.fullmatch, absent)), None)
        where = (
            f"package_paths=[FOLDER], the folder that holds {uri['package']!r}" if uri else "them where the file says"
        )
        remedy.append(f"give {where}")
    if unread:
        kinds = ", ".join(sorted({pathlib.PurePath(file).suffix.lower() or "no suffix" for file in unread}))
        told.append(f"{len(unread)} of a kind that MuJoCo does not read ({kinds})")
    remedy.append("meshes=False leaves all out and says nothing")
    warn(
        f"{os.fspath(model)!r}: {len(absent) + len(unread)} of {count} mesh files are left out, {' and '.join(told)}; "
        f"{'; '.join(remedy)}. Only collision distances need them."
    )


def _file_of(
    spec: mujoco.MjSpec, file: str, model: pathlib.Path, package_paths: Sequence[pathlib.Path]
) -> pathlib.Path | None:
    if "://" in file:
        return resolved(file, model, package_paths)
    name = pathlib.PurePath(file).name if spec.strippath else file
    return _existing([model.parent / (spec.meshdir or "") / name])


def drop_meshes(spec: mujoco.MjSpec, model: pathlib.Path, names: Iterable[str]) -> None:
    """Delete these meshes and the geoms that need them. Raises `RobotError` where a body takes its inertia from one."""
    import mujoco

    dropped = set(names)
    every = dropped == {mesh.name for mesh in spec.meshes}
    kinds = (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_SDF)
    from_geometry = spec.compiler.inertiafromgeom != mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    for geom in list(spec.geoms):
        if geom.meshname not in dropped and not (every and geom.type in kinds):
            continue
        body = geom.parent
        if from_geometry and body.name != "world" and not body.explicitinertial and geom.mass != 0.0 and geom.density:
            raise RobotError(
                f"The body {body.name!r} of {os.fspath(model)!r} takes its inertia from the mesh {geom.meshname!r}: "
                "the model cannot be loaded without that file."
            )
        spec.delete(geom)
    for mesh in [mesh for mesh in spec.meshes if mesh.name in dropped]:
        spec.delete(mesh)
