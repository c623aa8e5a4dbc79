"""An output folder that can be resumed: finished units as Parquet parts, and a manifest that says which run it is."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import pathlib
import shutil
import uuid
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from hqp_rp.core.errors import FileError
from hqp_rp.core.extras import require
from hqp_rp.core.paths import user_path

if TYPE_CHECKING:
    import polars as pl

MANIFEST = "run.json"
PARTS = "parts"


def digest(*texts: str) -> str:
    """16 hexadecimal digits that stand for these texts."""
    together = hashlib.sha256()
    for text in texts:
        together.update(text.encode())
        together.update(b"\0")
    return together.hexdigest()[:16]


def write_atomically(path: pathlib.Path, content: bytes) -> None:
    """Write `content` to `path`; the file appears whole or not at all. Raises `FileError` when it cannot."""
    partial = path.with_name(f".{path.name}.{os.getpid()}-{uuid.uuid4().hex[:8]}.part")
    try:
        partial.write_bytes(content)
        partial.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            partial.unlink()
        raise FileError(f"{path}: cannot be written ({error.strerror or error}).") from error


def write_parquet(frame: pl.DataFrame, path: pathlib.Path) -> None:
    """Write `frame` as Parquet; the file appears whole or not at all."""
    partial = path.with_name(f".{path.name}.{os.getpid()}-{uuid.uuid4().hex[:8]}.part")
    try:
        frame.write_parquet(partial, compression="zstd")
        partial.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            partial.unlink()
        raise FileError(f"{path}: cannot be written ({error.strerror or error}).") from error


class RunFolder:
    """One output folder of one run.

    A run is described by a JSON-able dictionary (settings and versions). Opening a folder that holds the same run goes on
    with it; opening one that holds another run, or files that no run wrote, is an error, so that no result is ever mixed
    or lost. A part is one finished unit of work, under the digest of what it is.

    Args:
        path: the folder; it is made when it does not exist.
        description: what the run is; two runs are the same when their descriptions are equal.
        files: names of the files and folders that the run will write here, so that another run may replace them.
        overwrite: replace what another run of hqp_rp left there. A folder with other files is refused all the same.

    Raises:
        FileError: the folder is of another run, holds other files, or cannot be written.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        description: Mapping[str, Any],
        *,
        files: Iterable[str] = (),
        overwrite: bool = False,
    ) -> None:
        self.path = user_path(path)
        self.files = tuple(files)
        self.description = json.loads(json.dumps(description))
        if self.path.exists() and not self.path.is_dir():
            raise FileError(f"{self.path}: is a file; give a folder for the report.")
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            self._claim(overwrite)
            (self.path / PARTS).mkdir(exist_ok=True)
        except OSError as error:
            raise FileError(
                f"{self.path}: cannot be used as the report's folder ({error.strerror or error})."
            ) from error

    def _claim(self, overwrite: bool) -> None:
        manifest = self.path / MANIFEST
        if manifest.exists():
            before = _manifest(manifest)
            if before["run"] == self.description:
                return
            if not overwrite:
                raise FileError(
                    f"{self.path}: holds the report of another run ({_difference(before['run'], self.description)}). "
                    "Give another --output, or --overwrite to replace it."
                )
            names = {pathlib.PurePath(name).name for name in before["files"]}  # never outside the folder
            for name in names - {MANIFEST}:  # kept to the end: a folder without one is nobody's
                target = self.path / name
                if target.is_dir():
                    shutil.rmtree(target)
                else:
                    target.unlink(missing_ok=True)
        elif any(self.path.iterdir()):
            raise FileError(
                f"{self.path}: holds files that hqp-rp did not write; give an empty or a new folder as --output."
            )
        content = {"format": "hqp_rp run", "run": self.description, "files": sorted({MANIFEST, PARTS, *self.files})}
        write_atomically(manifest, (json.dumps(content, indent=2, ensure_ascii=False) + "\n").encode())

    def part(self, key: str) -> pathlib.Path:
        """Where the part with this digest lies, or will lie."""
        return self.path / PARTS / f"{key}.parquet"

    def has(self, key: str) -> bool:
        """Whether the unit with this digest is finished."""
        return self.part(key).exists()

    def save(self, key: str, frame: pl.DataFrame) -> None:
        """Keep a finished unit."""
        write_parquet(frame, self.part(key))

    def load(self, keys: Iterable[str]) -> pl.DataFrame:
        """The rows of these units, one after the other.

        Raises `FileError` when a part is missing or damaged; a damaged one is to be deleted and made again.
        """
        require("A folder of rows", "polars")
        import polars as pl

        frames = []
        for key in keys:
            path = self.part(key)
            try:
                frames.append(pl.read_parquet(path))
            except (OSError, pl.exceptions.PolarsError) as error:
                raise FileError(
                    f"{path}: not a readable part ({error}); delete it and run the command again."
                ) from error
        return pl.concat(frames)


def _manifest(path: pathlib.Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text())
        if content["format"] == "hqp_rp run" and isinstance(content["files"], list) and "run" in content:
            return dict(content)
    except (OSError, ValueError, KeyError, TypeError):
        pass
    raise FileError(f"{path}: not the manifest of a run; give an empty or a new folder as --output.")


def _difference(before: Any, now: Any) -> str:
    """Which entries of the description differ, in a few words."""
    if not isinstance(before, dict) or not isinstance(now, dict):
        return "another kind of run"
    names = [name for name in {**before, **now} if before.get(name) != now.get(name)]
    return "it differs in " + ", ".join(names)
