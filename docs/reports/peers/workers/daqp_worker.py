"""DAQP's hierarchical mode: `daqp.solve` with break points."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import daqp
import numpy as np
from serve import Answer, Given, Worker, serve

CALL = "daqp.solve(None, None, A, upper, lower, sense, break_points{})"
SETTINGS: dict[str, dict[str, float]] = {
    "defaults": {},
    "tight": {"primal_tol": 1e-9, "rho_soft": 1e-6, "iter_limit": 10_000},
}
RHO, SHORTEST = 1e-6, 1e-4
VARIANTS = {
    name: CALL.format("".join(f", {key}={value}" for key, value in settings.items()))
    for name, settings in SETTINGS.items()
}
VARIANTS["soft weights"] = (
    "a kept daqp.Model, H = I, rows of length one, soft_weights 1e-6 (longest row of the level / row's own length)^2, "
    "primal_tol 1e-9: a level's rows then weigh as the problem says; update, soft_weights, solve"
)
EQUALITY = 5


def cannot(given: Given, variant: str) -> str:
    return ""


def prepare(given: Given, variant: str) -> Callable[[], Any]:
    A, lower, upper = given.stacked
    ends = np.concatenate(([0], given.ends))
    if given.hard is not None:
        A, lower = np.vstack((given.hard.A, A)), np.concatenate((given.hard.lower, lower))
        upper, ends = np.concatenate((given.hard.upper, upper)), ends + len(given.hard.A)
    A, lower, upper = np.ascontiguousarray(A), lower.copy(), upper.copy()
    sense, ends = np.where(lower == upper, EQUALITY, 0).astype(np.int32), ends.astype(np.int32)
    if variant == "soft weights":
        return _weighted(A, lower, upper, sense, ends)
    settings = SETTINGS[variant]
    return lambda: daqp.solve(None, None, A, upper, lower, sense, ends, **settings)


def _weighted(A: Any, lower: Any, upper: Any, sense: Any, ends: Any) -> Callable[[], Any]:
    lengths = np.linalg.norm(A, axis=1)
    safe = np.where(lengths > 0.0, lengths, 1.0)
    A, lower, upper, softness = A / safe[:, None], lower / safe, upper / safe, np.full(len(A), RHO)
    for begin, end in zip([0, *ends[:-1]], ends, strict=True):
        longest = lengths[begin:end].max(initial=0.0)
        if longest > 0.0:
            softness[begin:end] = RHO / np.maximum(lengths[begin:end] / longest, SHORTEST) ** 2
    model = daqp.Model()
    model.settings = {"primal_tol": 1e-9, "iter_limit": 10_000}
    flag = model.setup(np.eye(A.shape[1]), None, A, upper, lower, sense, ends)[0]
    if flag < 0:
        return lambda: (None, None, flag, None)

    def call() -> Any:
        flag = model.update(A=A, bupper=upper, blower=lower, sense=sense)
        if flag < 0:
            return None, None, flag, None
        model.soft_weights(softness, softness)
        return model.solve()

    return call


def read(found: Any, given: Given, variant: str) -> Answer:
    x, _, flag, _ = found
    # Rows are scaled to length one inside: levels that cannot be met minimise the sum of squares of those.
    promise = None if variant == "soft weights" else {"unit_rows": True}
    return Answer(x if flag > 0 else None, flag in (1, 2), f"exit flag {flag}", promise)


if __name__ == "__main__":
    serve(Worker("daqp", VARIANTS, cannot, prepare, read))
