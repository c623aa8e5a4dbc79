"""Where a robot comes from and how it is to be loaded, as a value: what workers, stack files and the command line hand on."""

from __future__ import annotations

import dataclasses
import os
import pathlib
from collections.abc import Mapping
from typing import Any

from hqp_rp.core.errors import RobotError, SettingError, unknown_setting
from hqp_rp.core.paths import user_path
from hqp_rp.robot.mesh_files import Meshes
from hqp_rp.robot.named import is_named, named_robot
from hqp_rp.robot.robot import Robot


@dataclasses.dataclass(frozen=True)
class RobotSource:
    """A robot file, or the name of one of the library's robots, and the arguments of `load_robot`.

    Attributes:
        model: an MJCF or URDF file, or a name (see `named_robot`), which takes none of the others.
        library, floating_base, package_paths, repair_inertias: as in `load_robot`.
        meshes: as in `load_robot`, but "if found" by default.
        neutral: nq numbers, or the name of a keyframe. velocity_limit: a number, nv numbers, or (joint, limit) pairs.

    Raises:
        RobotError: no model, or an argument for a robot that is no file.
        SettingError: a value of the wrong kind.
    """

    model: str
    library: str = "mujoco"
    floating_base: bool = False
    meshes: Meshes = "if found"
    package_paths: tuple[str, ...] = ()
    repair_inertias: bool = False
    neutral: tuple[float, ...] | str | None = None
    velocity_limit: float | tuple[float, ...] | tuple[tuple[str, float], ...] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.model, str) or not self.model:
            raise RobotError(f"model is {self.model!r}; give an MJCF or URDF file, or the name of a robot.")
        for name in ("floating_base", "repair_inertias"):
            if not isinstance(getattr(self, name), bool):
                raise SettingError(f"{name} is {getattr(self, name)!r}; it must be true or false.")
        if self.is_named:
            if self.changed:
                raise RobotError(
                    f"{next(iter(self.changed))} is for robot files; {self.model!r} is one of the library's own."
                )
        else:
            object.__setattr__(self, "model", os.fspath(user_path(self.model)))

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> RobotSource:
        """The source that these arguments say, lists and tables as a TOML file has them. Errors as the class."""
        names = [field.name for field in dataclasses.fields(cls)]
        for key in values:
            if key not in names:
                raise unknown_setting("a robot", key, names)
        plain = {key: _hashable(value) for key, value in values.items()}
        paths = plain.get("package_paths", ())
        if not isinstance(paths, tuple) or not all(isinstance(path, str) for path in paths):
            raise SettingError(f"package_paths is {values['package_paths']!r}; give a list of folders.")
        return cls(**plain)

    @property
    def is_named(self) -> bool:
        """Whether the model is a name, not a file."""
        return is_named(self.model)

    @property
    def changed(self) -> dict[str, Any]:
        """The arguments that are not the default."""
        fields = dataclasses.fields(self)[1:]
        return {field.name: getattr(self, field.name) for field in fields if getattr(self, field.name) != field.default}

    def robot(self) -> Robot:
        """The robot, loaded anew. Errors and warnings as `load_robot`."""
        from hqp_rp.robot.model_file import load_robot

        if self.is_named or not os.path.exists(self.model):
            return named_robot(self.model)  # which says what there is
        limit: Any = self.velocity_limit
        if isinstance(limit, tuple) and any(isinstance(pair, tuple) for pair in limit):
            limit = dict(limit)
        return load_robot(
            self.model,
            self.library,
            floating_base=self.floating_base,
            meshes=self.meshes,
            package_paths=self.package_paths,
            repair_inertias=self.repair_inertias,
            velocity_limit=limit,
            neutral=self.neutral,
        )


def robot_table(values: Mapping[str, Any], folder: pathlib.Path) -> dict[str, Any]:
    """Arguments of a `RobotSource`, all or some, as a file in `folder` says them: relative paths begin there.

    Errors as `RobotSource.of`.
    """
    found = dict(values)
    if isinstance(found.get("model"), str) and not is_named(found["model"]):
        found["model"] = os.fspath(folder / user_path(found["model"]))
    if isinstance(found.get("package_paths"), list):
        paths = found["package_paths"]
        found["package_paths"] = [os.fspath(folder / user_path(p)) if isinstance(p, str) else p for p in paths]
    RobotSource.of({"model": "FILE"} | found)
    return found


def _hashable(value: Any) -> Any:
    if isinstance(value, list | tuple):
        return tuple(_hashable(item) for item in value)
    if isinstance(value, Mapping):
        return tuple((str(key), _hashable(item)) for key, item in value.items())
    return os.fspath(value) if isinstance(value, os.PathLike) else value
