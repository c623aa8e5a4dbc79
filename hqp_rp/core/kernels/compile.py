"""How every kernel is compiled: cached on disk, without the GIL, and recompiled when any kernel's source changes."""

from __future__ import annotations

import functools
import hashlib
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numba

Compiled = Callable[..., Any]
"""A kernel is compiled for the types that it is called with, so its parameters carry no annotations."""


def _digest() -> str:
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


SOURCES = _digest()


def inlined(function: Compiled) -> Compiled:
    """A small piece of a kernel, put into its callers as it stands: a call with many arrays would cost more than its work."""
    options: dict[str, Any] = {"inline": "always", "error_model": "numpy", "fastmath": {"reassoc", "contract"}}
    return cast(Compiled, numba.njit(**options)(function))


def kernel(function: Compiled) -> Compiled:
    """Compile `function` at its first call and cache the machine code.

    numba's cache watches a function's own file only, so a kernel that calls one in another file would go on running the
    old callee after an update. The name under which it is cached therefore carries a digest of all kernel sources.
    Sums may be reordered and multiply-adds fused ("reassoc", "contract"), so that loops vectorize; NaN and infinity keep
    their meaning. Where nothing can be written (a read-only installation of a user without a home), there is no cache: the
    kernel is compiled once in each process, and one warning says how to avoid it.
    """
    return _compiled(function, _nrt=True)


def lean(function: Compiled) -> Compiled:
    """A kernel that allocates nothing and returns no array, compiled without reference counts.

    Where arrays are passed about, numba counts references by atomic instructions in calls of their own; on seven unknowns they
    took five times as long as the arithmetic. What such a function may call: other lean ones, and kernels that return no array.
    `_nrt` is a private option of numba; a test holds that it still does what is said here.
    """
    return _compiled(function, _nrt=False)


def fixed(function: Compiled, signature: tuple[Any, ...]) -> Compiled:
    """A `kernel` for these types and no others: called with any others, it raises `TypeError`."""
    function.compile(signature)  # type: ignore[attr-defined]
    function.disable_compile()  # type: ignore[attr-defined]
    return function


def entry(function: Compiled, signature: tuple[Any, ...]) -> Compiled:
    """The machine code of a kernel for these types as a plain builtin: a call costs half of what the kernel's own does.

    It does not look at the types: only for numbers and arrays that the caller has made or checked.
    """
    function.compile(signature)  # type: ignore[attr-defined]
    return cast(Compiled, function.overloads[signature].entry_point)  # type: ignore[attr-defined]


def _compiled(function: Compiled, *, _nrt: bool) -> Compiled:
    function.__qualname__ = f"{function.__qualname__}_{SOURCES}"
    options: dict[str, Any] = {
        "cache": True,
        "nogil": True,
        "error_model": "numpy",
        "fastmath": {"reassoc", "contract"},
        "_nrt": _nrt,  # said in either case: what is not said is inherited from the caller that compiles it
    }
    try:
        return cast(Compiled, numba.njit(**options)(function))
    except RuntimeError:  # numba found no folder that it may write to
        _warn_once()
        options["cache"] = False
        return cast(Compiled, numba.njit(**options)(function))


@functools.cache
def _warn_once() -> None:
    warnings.warn(
        "hqp_rp cannot keep its compiled kernels: neither its own folder nor the user's cache folder can be written. They "
        "are compiled anew in every process, which takes some seconds; set NUMBA_CACHE_DIR to a folder that can be written.",
        RuntimeWarning,
        stacklevel=4,
    )
