"""Problems as files, so that any case can be replayed: plain .npz, no pickle, with a format version."""

from __future__ import annotations

import contextlib
import io
import json
import os
import pathlib
import uuid
import zipfile
from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np

from hqp_rp.core.damping import LevelDamping, NoDamping, damping_of
from hqp_rp.core.errors import FileError, ProblemError, SettingError
from hqp_rp.core.paths import user_path
from hqp_rp.core.problem import Level, Problem
from hqp_rp.core.row_names import (
    LEVEL_ROW_NAMES,
    ROW_NAMES,
    RowName,
    has_row_names,
    level_row_names,
    row_names,
    state_row_names,
)

FORMAT = "hqp_rp problem"
VERSION = 3
"""1 had no damping, 2 no metric; a problem is written as the least version that can hold it."""

PathLike: TypeAlias = str | os.PathLike[str]


def arrays_of(problem: Problem) -> dict[str, Any]:
    """The arrays of a problem's file by name, all but the metadata; see `save_problem`."""
    arrays: dict[str, Any] = {
        "format": np.array(FORMAT),
        "version": np.array(version_of(problem)),
        "matrix": problem.matrix,
        "lower": problem.lower,
        "upper": problem.upper,
        "offsets": problem.offsets,
        "names": np.array(problem.names, dtype=np.str_),
    }
    if problem.hard is not None:
        hard = problem.hard
        arrays |= {
            "hard_A": hard.A,
            "hard_lower": hard.lower,
            "hard_upper": hard.upper,
            "hard_name": np.array(hard.name),
        }
    if problem.damping is not None:
        policies = [policy or NoDamping() for policy in problem.damping]
        arrays["damping_kind"] = np.array([policy.kind for policy in policies])
        arrays["damping_parameters"] = np.array([policy.parameters for policy in policies])
    if problem.metric is not None:
        arrays["metric"] = problem.metric
    return arrays


def save_problem(problem: Problem, path: PathLike, **metadata: Any) -> pathlib.Path:
    """Write `problem` to `path` and return the path. The file appears whole or not at all.

    The .npz holds `format`, `version`, `matrix` (M, n), `lower`, `upper` (M,), `offsets` (p + 1,), `names` (p,), when
    there are hard rows `hard_A`, `hard_lower`, `hard_upper`, `hard_name`, where a level is damped `damping_kind` (p,) and
    `damping_parameters` (p, 2), where there is one `metric` (n, n), where hard rows or rows of levels have names `row_names`
    and `level_row_names`, a JSON list of the fields of a `hqp_rp.core.row_names.RowName` for each row, and `metadata`, a JSON
    object. Every float comes back to the last bit, and `Solution.conflict` of a problem read again speaks the same names.

    Args:
        problem: the problem.
        path: where to write; an existing file is replaced.
        metadata: what else to keep (seed, solver, origin ...): numbers, strings, None, lists, dicts, arrays.

    Raises:
        ProblemError: a problem that is none, None for instance.
        FileError: the file cannot be written; the message names it.
        SettingError: a metadata value that JSON cannot hold.
    """
    if not isinstance(problem, Problem):
        raise ProblemError(
            f"problem is a {type(problem).__name__}; give a Problem, such as stack.problem(...), solution.problem, or "
            "runner.problem of a MotionRunner, which is there in every mode once a problem was made."
        )
    arrays = arrays_of(problem) | {"metadata": np.array(_encoded(metadata))}
    if has_row_names(problem):
        arrays["row_names"] = np.array(json.dumps(row_names(problem)))
    if LEVEL_ROW_NAMES in (problem.kept or {}) or any(level.row_names for level in problem.levels):
        arrays["level_row_names"] = np.array(json.dumps(level_row_names(problem)))
    return write_arrays(path, arrays, "problem")


def write_arrays(path: PathLike, arrays: Mapping[str, Any], what: str, *, compressed: bool = False) -> pathlib.Path:
    """Write arrays to a .npz without pickles, which appears whole or not at all, and return its path.

    Raises `FileError`, which names the file and `what` it would be, where that cannot be.
    """
    target = user_path(path)
    partial = target.with_name(f".{target.name}.{os.getpid()}-{uuid.uuid4().hex[:8]}.part")
    try:
        with partial.open("xb") as file:
            (np.savez_compressed if compressed else np.savez)(file, allow_pickle=False, **arrays)
        partial.replace(target)
    except OSError as error:
        with contextlib.suppress(OSError):
            partial.unlink()
        raise FileError(f"{target}: the {what} cannot be written ({error.strerror or error}).") from error
    return target


def read_arrays(path: PathLike, what: str, writer: str) -> tuple[pathlib.Path, dict[str, Any]]:
    """The path and the arrays of a .npz without pickles.

    Raises `FileError`, which names the file, where it is missing or damaged; what: it should be. writer: of such files.
    """
    source = user_path(path)
    try:
        data = source.read_bytes()
    except FileNotFoundError:
        raise FileError(f"{source}: there is no such file.") from None
    except OSError as error:
        raise FileError(f"{source}: not readable ({error.strerror or error}).") from error
    if not zipfile.is_zipfile(io.BytesIO(data)):
        raise FileError(f"{source}: not a .npz file, or damaged; {what}s are written by {writer}.")
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            return source, {name: archive[name] for name in archive.files}
    except Exception as error:  # whatever zip, zlib and numpy make of damaged bytes
        raise FileError(f"{source}: damaged, or not a {what} ({error}).") from error


def version_of(problem: Problem) -> int:
    """The format version that a file with this problem has."""
    if problem.metric is not None:
        return VERSION
    return 1 if problem.damping is None else 2


def load_problem(path: PathLike) -> Problem:
    """The problem in a file that `save_problem` wrote.

    Raises `FileError`, which names the file, when it is missing, is damaged, is no problem file, or is of a format
    version that this release does not know.
    """
    return _read(path)[0]


def load_metadata(path: PathLike) -> dict[str, Any]:
    """The metadata in a file that `save_problem` wrote; raises `FileError` as `load_problem` does."""
    return _read(path)[1]


def _read(path: PathLike) -> tuple[Problem, dict[str, Any]]:
    source, arrays = read_arrays(path, "problem file", "save_problem")
    return _assembled(source, arrays)


def _assembled(source: pathlib.Path, arrays: dict[str, Any]) -> tuple[Problem, dict[str, Any]]:
    if str(arrays.get("format")) != FORMAT:
        raise FileError(f"{source}: not a problem file (it holds {', '.join(sorted(arrays)) or 'nothing'}).")
    version = arrays.get("version")
    if (
        version is None
        or version.shape != ()
        or version.dtype.kind not in "iu"
        or int(version) not in range(1, VERSION + 1)
    ):
        raise FileError(f"{source}: format version {version}; this release of hqp_rp reads versions 1 to {VERSION}.")
    try:
        hard = None
        if "hard_A" in arrays:
            bounds = arrays["hard_lower"], arrays["hard_upper"]
            hard = Level(arrays["hard_A"], *bounds, name=str(arrays["hard_name"]))
        problem = Problem.from_stacked(
            arrays["matrix"],
            arrays["lower"],
            arrays["upper"],
            arrays["offsets"],
            names=[str(name) for name in np.atleast_1d(arrays["names"])],
            hard=hard,
            damping=_damping(arrays),
            metric=arrays.get("metric"),
        )
        for array, name, m in (
            ("row_names", ROW_NAMES, problem.hard_rows if hard is None else hard.m),
            ("level_row_names", LEVEL_ROW_NAMES, problem.rows),
        ):
            if array in arrays:
                state_row_names(problem, {name: _named(str(arrays[array]), m, array)})
        metadata = json.loads(str(arrays["metadata"]))
    except KeyError as error:
        raise FileError(f"{source}: the array {error.args[0]!r} is missing.") from error
    except (ProblemError, SettingError) as error:
        raise FileError(f"{source}: {error}") from error
    except ValueError as error:
        raise FileError(f"{source}: its metadata is not a JSON object ({error}).") from error
    if not isinstance(metadata, dict):
        raise FileError(f"{source}: its metadata is a {type(metadata).__name__}, not a JSON object.")
    return problem, metadata


def _named(text: str, m: int, array: str) -> list[RowName]:
    """The names of m rows; raises `ProblemError` where they are none."""
    try:
        names = [RowName(*fields) for fields in json.loads(text)]
    except (TypeError, ValueError) as error:
        raise ProblemError(f"the array {array!r} holds no names of rows ({error}).") from error
    if len(names) != m:
        raise ProblemError(f"the array {array!r} names {len(names)} rows; there are {m}.")
    return names


def _damping(arrays: dict[str, Any]) -> list[LevelDamping | None] | None:
    if "damping_kind" not in arrays:
        return None
    kinds, parameters = arrays["damping_kind"].tolist(), arrays["damping_parameters"].tolist()
    return [damping_of(kind, tuple(pair)) for kind, pair in zip(kinds, parameters, strict=True)]


def _encoded(metadata: dict[str, Any]) -> str:
    def plain(value: object) -> object:
        if isinstance(value, np.ndarray | np.generic):
            return value.tolist()
        raise TypeError(f"a {type(value).__name__}")

    try:
        return json.dumps(metadata, default=plain)
    except (TypeError, ValueError) as error:
        raise SettingError(
            f"The metadata cannot be kept: {error}; give numbers, strings, None, lists, dicts or arrays."
        ) from error
