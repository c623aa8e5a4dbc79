"""What a run was made with: versions, a digest of the library's own sources, the machine."""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import os
import pathlib
import platform

import hqp_rp

PACKAGES = ("numpy", "scipy", "osqp", "proxsuite", "qpsolvers", "daqp", "quadprog", "piqp", "mujoco", "pin")
"""The packages whose versions can change a result."""


@functools.cache
def source_digest() -> str:
    """12 hexadecimal digits of every Python file that a result depends on: all of hqp_rp but its reports."""
    root = pathlib.Path(hqp_rp.__file__).parent
    together = hashlib.sha256()
    for path in _sources(root):
        together.update(path.relative_to(root).as_posix().encode())
        together.update(path.read_bytes())
    return together.hexdigest()[:12]


def _sources(root: pathlib.Path) -> list[pathlib.Path]:
    folders = ("core", "robot", "control", "solvers", "scenarios")
    found = [path for folder in folders for path in sorted((root / folder).rglob("*.py"))]
    return [*found, *(root / "compare" / name for name in _JUDGES)]


_JUDGES = (
    "measure/metrics.py",
    "measure/reference.py",
    "measure/units.py",
    "stress/judge.py",
    "stress/levels.py",
    "stress/plan.py",
    "stress/rows.py",
    "workers.py",
)
"""Of `compare`, what runs and judges; a file that is not where it is said to be is an error."""


@functools.cache
def versions() -> dict[str, str]:
    """Name -> version of the library, of Python and of the packages whose versions can change a result."""
    found = {"hqp_rp": f"{hqp_rp.__version__} (sources {source_digest()})", "python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = "not installed"
    return found


def machine() -> dict[str, str]:
    """The machine: system, processor, cores that this process may use."""
    return {
        "system": f"{platform.system()} {platform.machine()}",
        "processor": _processor(),
        "cores": str(usable_cores()),
    }


def usable_cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _processor() -> str:
    try:
        for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or "unknown"
