"""A recorded run as a value and as a file: every step of one or two solvers, the robot and the stack that they ran on."""

from __future__ import annotations

import dataclasses
import json
import os
import pathlib
import zipfile
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hqp_rp.compare.play.arm import ArmState
from hqp_rp.control.command import Mode
from hqp_rp.core.errors import FileError, HqpError, SettingError
from hqp_rp.core.io import read_arrays, write_arrays
from hqp_rp.core.paths import user_path
from hqp_rp.core.problem import FloatArray
from hqp_rp.robot.robot_source import RobotSource

if TYPE_CHECKING:
    from hqp_rp.compare.play.loop import Step

FORMAT = "hqp_rp play recording"
VERSION = 1

MOST_STEPS = 200_000
"""A recording ends by itself here: more than half an hour at 100 Hz, some 60 MB for an arm."""

_MODES = tuple(mode.name for mode in Mode)
_PER_LEVEL = ("error", "residual", "rank", "rows", "sigma_min")
_PER_ARM = ("speed", "share", "bounded", "solve_time")
_WORDS = ("solver", "status", "reason", "limits")


@dataclasses.dataclass(frozen=True, eq=False)
class Recording:
    """S steps of a run with a arms (1, or 2 with a ghost), on p levels and h targets.

    Attributes:
        robot: the attributes of the `RobotSource`. stack: the stack file's text.
        levels: (p) names. targets: (h) names.
        dt: s, the control period.
        time: (S,) s.
        q: (S, a, nq). place: (S, h, 7) position and quaternion (w, x, y, z) of each target, nan in the half it does not have.
        driving: (S,) bool, whether the arms were driven to a configuration and not moved by their solvers.
        error, residual, rank, rows, sigma_min: (S, a, p), as in `ArmState`.
        speed, share, bounded, solve_time: (S, a), as in `ArmState`.
        mode: (S, a) position in `hqp_rp.control.command.Mode`, -1 where there was no such arm.
        solver, status, reason, limits: (S, a) positions in `words`: `Arm.label` and the words of `ArmState`, limits
            joined by "; ".
        words: every text that occurs.

    Where a step had no ghost its numbers are nan.
    """

    robot: dict[str, Any]
    stack: str
    levels: tuple[str, ...]
    targets: tuple[str, ...]
    dt: float
    time: FloatArray
    q: FloatArray
    place: FloatArray
    driving: NDArray[np.bool_]
    error: FloatArray
    residual: FloatArray
    rank: FloatArray
    rows: FloatArray
    sigma_min: FloatArray
    speed: FloatArray
    share: FloatArray
    bounded: FloatArray
    solve_time: FloatArray
    mode: NDArray[np.int64]
    solver: NDArray[np.int64]
    status: NDArray[np.int64]
    reason: NDArray[np.int64]
    limits: NDArray[np.int64]
    words: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.time)

    @property
    def arms(self) -> int:
        """How many arms there were at most."""
        return int(self.q.shape[1])

    def solver_of(self, step: int, arm: int = 0) -> str:
        """What the solver of this arm was called at this step (`Arm.label`)."""
        return self.words[int(self.solver[step, arm])]

    def state(self, step: int, arm: int = 0) -> ArmState | None:
        """What this arm did at this step; None where there was no such arm."""
        if self.mode[step, arm] < 0:
            return None
        limits = self.words[int(self.limits[step, arm])]
        return ArmState(
            q=self.q[step, arm],
            mode=tuple(Mode)[int(self.mode[step, arm])],
            status=self.words[int(self.status[step, arm])],
            reason=self.words[int(self.reason[step, arm])],
            limits=tuple(limits.split("; ")) if limits else (),
            speed=float(self.speed[step, arm]),
            share=float(self.share[step, arm]),
            bounded=int(self.bounded[step, arm]),
            solve_time=float(self.solve_time[step, arm]),
            **{name: getattr(self, name)[step, arm] for name in _PER_LEVEL},
        )

    def source(self) -> RobotSource:
        """Where the robot came from. Errors as `RobotSource`."""
        return RobotSource.of(self.robot)

    def save(self, path: str | os.PathLike[str]) -> pathlib.Path:
        """Write a compressed .npz without pickles and return its path. Raises `FileError` where that cannot be."""
        arrays: dict[str, Any] = {"format": np.array(FORMAT), "version": np.array(VERSION)}
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            arrays[field.name] = np.array(json.dumps(value)) if field.name in _AS_JSON else np.asarray(value)
        return write_arrays(path, arrays, "recording", compressed=True)

    def __repr__(self) -> str:
        seconds = self.dt * len(self)
        return f"Recording({len(self)} steps, {seconds:g} s, {self.arms} solver(s), {' > '.join(self.levels)})"


_AS_JSON = ("robot", "stack", "levels", "targets", "words")


def load_recording(path: str | os.PathLike[str]) -> Recording:
    """The recording in a file that `Recording.save` wrote.

    Raises `FileError`, which names the file, where it is missing, damaged, something else, or of a version not known here.
    """
    source, arrays = read_arrays(path, "recording", "hqp-rp play")
    if str(arrays.get("format")) != FORMAT:
        raise FileError(f"{source}: not a recording of hqp-rp play.")
    if str(arrays.get("version")) != str(VERSION):
        raise FileError(
            f"{source}: format version {arrays.get('version')}; this release of hqp_rp reads version {VERSION}."
        )
    try:
        values = {
            field.name: json.loads(str(arrays[field.name])) if field.name in _AS_JSON else arrays[field.name]
            for field in dataclasses.fields(Recording)
        }
        for name in ("levels", "targets", "words"):
            values[name] = tuple(values[name])
        values["dt"] = float(values["dt"])
        found = Recording(**values)
        _require_fit(found)
    except KeyError as error:
        raise FileError(f"{source}: the array {error.args[0]!r} is missing.") from error
    except (ValueError, TypeError, IndexError, HqpError) as error:
        raise FileError(f"{source}: damaged ({error}).") from error
    return found


def is_recording(path: str | os.PathLike[str]) -> bool:
    """Whether the file says that it is a recording; False for any other file, and where there is none."""
    try:
        with zipfile.ZipFile(user_path(path)) as archive, archive.open("format.npy") as file:
            return str(np.lib.format.read_array(file, allow_pickle=False)) == FORMAT
    except (OSError, KeyError, ValueError, zipfile.BadZipFile):
        return False


def _require_fit(recording: Recording) -> None:
    """Raises `ValueError` where sizes or texts do not fit together."""
    steps, arms, p = len(recording.time), recording.arms, len(recording.levels)
    shapes: dict[str, tuple[int, ...]] = dict.fromkeys(_PER_LEVEL, (steps, arms, p))
    shapes |= dict.fromkeys((*_PER_ARM, *_WORDS, "mode"), (steps, arms))
    shapes |= {"place": (steps, len(recording.targets), 7), "driving": (steps,)}
    for name, shape in shapes.items():
        if getattr(recording, name).shape != shape:
            raise ValueError(f"{name} has shape {getattr(recording, name).shape}, not {shape}")
    for name in _WORDS:
        numbers = getattr(recording, name)
        if numbers.size and not (numbers.min() >= 0 and numbers.max() < len(recording.words)):
            raise ValueError(f"{name} names a text that is not there")
    if recording.mode.size and not (recording.mode.min() >= -1 and recording.mode.max() < len(_MODES)):
        raise ValueError("mode is none that is known")


class Recorder:
    """Collects steps until it is closed, `MOST_STEPS` at most.

    Args:
        source: of the robot. stack: the file's text. levels, targets: names. dt: s.
    """

    def __init__(
        self, source: RobotSource, stack: str, levels: Sequence[str], targets: Sequence[str], dt: float
    ) -> None:
        self.open = True
        self._robot = {"model": source.model, **source.changed}
        self._stack, self._levels, self._targets, self._dt = stack, tuple(levels), tuple(targets), dt
        self._steps: list[tuple[Step, tuple[str, ...]]] = []

    def __len__(self) -> int:
        return len(self._steps)

    def add(self, step: Step, solvers: Sequence[str]) -> None:
        """One more step, with what the solver of each arm is called."""
        self._steps.append((step, tuple(solvers)))
        self.open = len(self._steps) < MOST_STEPS

    def recording(self) -> Recording:
        """What was collected. Raises `SettingError` where that is nothing."""
        if not self._steps:
            raise SettingError("the recording has no step yet; let the loop run before it is ended.")
        count, arms = len(self._steps), max(len(step.arms) for step, _ in self._steps)
        words: dict[str, int] = {"": 0}
        states = [arm for step, _ in self._steps for arm in step.arms]
        numbers: dict[str, Any] = {name: np.full((count, arms, len(self._levels)), np.nan) for name in _PER_LEVEL}
        numbers |= {name: np.full((count, arms), np.nan) for name in _PER_ARM}
        numbers |= {name: np.zeros((count, arms), dtype=np.int64) for name in _WORDS}
        numbers["mode"] = np.full((count, arms), -1, dtype=np.int64)
        numbers["q"] = np.full((count, arms, len(states[0].q)), np.nan)
        for i, (step, solvers) in enumerate(self._steps):
            for j, (state, solver) in enumerate(zip(step.arms, solvers, strict=True)):
                for name in (*_PER_LEVEL, *_PER_ARM, "q"):
                    numbers[name][i, j] = getattr(state, name)
                numbers["mode"][i, j] = _MODES.index(state.mode.name)
                texts = (solver, state.status, state.reason, "; ".join(state.limits))
                for name, text in zip(_WORDS, texts, strict=True):
                    numbers[name][i, j] = words.setdefault(text, len(words))
        return Recording(
            robot=self._robot,
            stack=self._stack,
            levels=self._levels,
            targets=self._targets,
            dt=self._dt,
            time=np.array([step.time for step, _ in self._steps]),
            place=np.array([step.targets for step, _ in self._steps]),
            driving=np.array([step.driving for step, _ in self._steps]),
            words=tuple(words),
            **numbers,
        )
