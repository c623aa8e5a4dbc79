"""C and C++ sources of the benchmark: compiled by the machine's own compiler when there is one, loaded, and called in loops."""

from __future__ import annotations

import ctypes
import os
import pathlib
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from hqp_rp.core.problem import FloatArray, IntArray, Problem

NATIVE = pathlib.Path(__file__).with_name("native")
"""Where the sources are."""

FLAGS = ("-O3", "-march=native", "-shared", "-fPIC")
"""What both compilers are told."""

_COMPILERS = {"c": ("CC", "cc"), "c++": ("CXX", "c++")}

Loop = Callable[[int], FloatArray]
"""Solves every instance as many times as it is told, without Python in between; the answers (N, n)."""


class NotBuilt(Exception):
    """There is no compiler, or it refused; the message is a sentence."""


def build(source: str, language: str, *flags: str) -> ctypes.CDLL:
    """Compile a file of `NATIVE` with `FLAGS` and `flags` into a temporary folder, and load it.

    Args:
        source: its name. language: "c" or "c++"; the compiler is that of CC or CXX, else cc or c++.

    Raises `NotBuilt` with a sentence that says why there is no library.
    """
    variable, usual = _COMPILERS[language]
    command = shlex.split(os.environ.get(variable, "")) or [usual]
    if shutil.which(command[0]) is None:
        raise NotBuilt(
            f"there is no {language.upper()} compiler {command[0]!r} here (install one, or name it in {variable})"
        )
    with tempfile.TemporaryDirectory() as folder:
        library = pathlib.Path(folder) / "native.so"
        done = subprocess.run(
            [*command, *FLAGS, *flags, str(NATIVE / source), "-o", str(library), "-lm"],
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            said = done.stderr.splitlines() or ["no word"]
            fault = next((line for line in said if "error" in line), said[0])
            raise NotBuilt(f"{command[0]} did not compile {source}: {fault.strip()}")
        return ctypes.CDLL(str(library))  # stays loaded when the folder is gone


def stacked(problems: Sequence[Problem]) -> tuple[FloatArray, FloatArray, IntArray]:
    """(A (N, M, n), b (N, M), offsets (p + 1,)) of problems of one shape that hold equalities only."""
    matrices, rhs = zip(*(problem.stacked[:2] for problem in problems), strict=True)
    return np.array(matrices), np.array(rhs), problems[0].stacked[3].copy()


def caller(function: Any, *arguments: Any) -> Callable[[int], None]:
    """Calls a C function on how many repeats, then `arguments`; it returns 0 when all is well.

    Arrays are passed by address and kept alive with the call, integers as long, floats as double. The call raises
    `RuntimeError` when the function returns anything else.
    """
    kinds = {float: ctypes.c_double, int: ctypes.c_long}
    prepared = [
        ctypes.c_void_p(item.ctypes.data) if isinstance(item, np.ndarray) else kinds[type(item)](item)
        for item in arguments
    ]
    function.restype = ctypes.c_int

    def call(repeats: int, kept: Sequence[Any] = arguments) -> None:
        if function(ctypes.c_long(repeats), *prepared):
            raise RuntimeError(f"{function.__name__} failed: out of memory, or its solver gave up")

    return call
