"""mink: a problem's rows as tasks, limits and constraints of its `solve_ik` on n slides; its own tasks for whole steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import mink
import mujoco
import numpy as np
from mink.limits import Constraint, Limit
from rows import VARIANTS, cannot, one_sided, promise, split
from serve import Answer, Given, Worker, costs, serve

DT = 1.0
SOLVER = "daqp"


class RowsTask(mink.Task):
    """A x = b as mink's first-order task: J = A, e = -b."""

    def __init__(self, A: Any, b: Any, cost: float) -> None:
        super().__init__(cost=np.full(len(A), cost))
        self.A, self.e = A, -b

    def compute_error(self, configuration: Any) -> Any:
        return self.e

    def compute_jacobian(self, configuration: Any) -> Any:
        return self.A


class RowsLimit(Limit):
    def __init__(self, G: Any, h: Any) -> None:
        self.constraint = Constraint(G, h)

    def compute_qp_inequalities(self, configuration: Any, dt: float) -> Any:
        return self.constraint


def slides(n: int) -> Any:
    """A model with n velocities, whatever the rows say about them."""
    body = '<body><joint type="slide" axis="0 0 1"/><geom size=".1"/>' * n
    return mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}{'</body>' * n}</worldbody></mujoco>")


def prepare(given: Given, variant: str) -> Callable[[], Any]:
    parts = split(given, variant)
    configuration = mink.Configuration(slides(given.n))
    tasks = [RowsTask(*row) for row in parts.soft]
    limits = [RowsLimit(*one_sided(parts.limits))] if parts.limits is not None else []
    constraints = [RowsTask(*parts.equalities, 1.0)] if parts.equalities else None
    return lambda: mink.solve_ik(configuration, tasks, DT, SOLVER, limits=limits, constraints=constraints)


def read(found: Any, given: Given, variant: str) -> Answer:
    return Answer(found, found is not None, "returned", promise(given, variant))


def step(asked: Mapping[str, Any]) -> Callable[[Any], Any]:
    model = mujoco.MjModel.from_xml_string(asked["mjcf"])
    configuration = mink.Configuration(model, np.array(asked["neutral"]))
    gain, weights = asked["gain"] * asked["dt"], costs(3)
    tasks = [
        mink.FrameTask("tool", "site", weights[0], 0.0, gain=gain),
        mink.FrameTask("tool", "site", 0.0, weights[1], gain=gain),
        mink.PostureTask(model, weights[2], gain=gain),
    ]
    for task in tasks:
        task.set_target_from_configuration(configuration)

    def call(q: Any) -> Any:
        configuration.update(q)
        return mink.solve_ik(configuration, tasks, asked["dt"], SOLVER, limits=[])

    return call


if __name__ == "__main__":
    call = f"solve_ik(configuration, tasks, dt, {SOLVER!r}, limits=..., constraints=...), damping 1e-12; "
    words = f"update(q); solve_ik(..., {SOLVER!r}, limits=[]): FrameTask, FrameTask, PostureTask, costs 1e2, 1, 1e-2"
    serve(Worker("mink", {k: call + v for k, v in VARIANTS.items()}, cannot, prepare, read, step, words))
