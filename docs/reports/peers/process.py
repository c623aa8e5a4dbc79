"""A peer in a process of its own interpreter: asked a JSON line at a time, ended when it does not answer."""

from __future__ import annotations

import json
import os
import selectors
import subprocess
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

WORKERS = Path(__file__).parent / "workers"
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1") | {
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false",
    "PYTHONWARNINGS": "ignore",
}


def surroundings() -> dict[str, str]:
    """The environment variables of a worker: one thread, and nothing of this interpreter's packages."""
    return {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")} | ONE_THREAD


class Process:
    """`ask` answers with a dict; {"error": sentence} where the worker fails, {"ended": why} where its process did."""

    def __init__(self, python: Path, worker: str) -> None:
        self._command = [str(python), str(WORKERS / worker)]
        self._process: subprocess.Popen[str] | None = None

    def _start(self) -> subprocess.Popen[str]:
        return subprocess.Popen(
            self._command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=surroundings(),
        )

    def ask(self, message: Mapping[str, Any], *, seconds: float = 30.0) -> dict[str, Any]:
        if self._process is None or self._process.poll() is not None:
            self._process = self._start()
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            process.stdin.write(json.dumps(message) + "\n")
            process.stdin.flush()
            with selectors.DefaultSelector() as ready:
                ready.register(process.stdout, selectors.EVENT_READ)
                if not ready.select(seconds):
                    self.close()
                    return {"ended": f"no answer within {seconds:g} s"}
            line = process.stdout.readline()
        except BrokenPipeError:
            line = ""
        if not line:
            code = process.wait(timeout=30)
            self.close()
            return {"ended": f"the process ended (code {code})"}
        return dict(json.loads(line))

    def cold(self, asked: Path) -> float:
        """Seconds from the start of the interpreter to the first answer."""
        begin = time.perf_counter()
        done = subprocess.run(
            [*self._command, "--cold", str(asked)],
            capture_output=True,
            text=True,
            env=surroundings(),
            check=False,
        )
        taken = time.perf_counter() - begin
        if '"done"' not in done.stdout:
            raise SystemExit(f"{self._command[-1]} gave no first answer: {done.stderr[-400:]}")
        return taken

    def close(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait(timeout=30)
            for pipe in (self._process.stdin, self._process.stdout):
                if pipe is not None:
                    pipe.close()
            self._process = None


_TOOLS = ("pip", "setuptools", "_distutils_hack", "pkg_resources", "distutils-precedence")


def megabytes(python: Path, only: tuple[str, ...] = ("",)) -> float:
    """What the environment's packages (those whose folders begin with `only`) take, without pip, setuptools and byte code, in
    MB (10^6 bytes)."""
    total = 0
    for packages in sorted(python.parent.parent.glob("lib/python*/site-packages")):
        for path in packages.rglob("*"):
            part = path.relative_to(packages).parts[0]
            counts = part.startswith(only) and not part.startswith(_TOOLS) and "__pycache__" not in path.parts
            if counts and path.is_file() and not path.is_symlink():
                total += path.stat().st_size
    return total / 1e6
