"""pink: a problem's rows as tasks, limits and constraints of its `solve_ik` on n sliders; its own tasks for whole steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pink
import pinocchio
from pink.limits import Limit
from rows import VARIANTS, cannot, one_sided, promise, split
from serve import Answer, Given, Worker, costs, serve

DT = 1.0
SOLVER = "daqp"


class RowsTask(pink.Task):
    """A x = b as pink's first-order task: J = A, e = -b."""

    def __init__(self, A: Any, b: Any, cost: float) -> None:
        super().__init__(cost=np.full(len(A), cost))
        self.A, self.e = A, -b

    def compute_error(self, configuration: Any) -> Any:
        return self.e

    def compute_jacobian(self, configuration: Any) -> Any:
        return self.A

    def __repr__(self) -> str:
        return f"RowsTask({len(self.A)} rows)"


class RowsLimit(Limit):
    def __init__(self, G: Any, h: Any) -> None:
        self.rows = G, h

    def compute_qp_inequalities(self, configuration: Any, dt: float) -> Any:
        return self.rows


def slides(n: int) -> Any:
    """A model with n velocities, whatever the rows say about them."""
    model = pinocchio.Model()
    for i in range(n):
        model.addJoint(i, pinocchio.JointModelPZ(), pinocchio.SE3.Identity(), f"joint{i}")
    return model


def prepare(given: Given, variant: str) -> Callable[[], Any]:
    parts = split(given, variant)
    model = slides(given.n)
    configuration = pink.Configuration(model, model.createData(), np.zeros(given.n))
    tasks = [RowsTask(*row) for row in parts.soft]
    limits = [RowsLimit(*one_sided(parts.limits))] if parts.limits is not None else []
    constraints = [RowsTask(*parts.equalities, 1.0)] if parts.equalities else None
    return lambda: pink.solve_ik(
        configuration, tasks, DT, SOLVER, limits=limits, constraints=constraints, safety_break=False
    )


def read(found: Any, given: Given, variant: str) -> Answer:
    return Answer(found, found is not None, "returned", promise(given, variant))


def step(asked: Mapping[str, Any]) -> Callable[[Any], Any]:
    model = pinocchio.buildModelFromXML(asked["urdf"])
    configuration = pink.Configuration(model, model.createData(), np.array(asked["neutral"]))
    gain, weights = asked["gain"] * asked["dt"], costs(3)
    tasks = [
        pink.FrameTask("tool", position_cost=weights[0], orientation_cost=0.0, gain=gain),
        pink.FrameTask("tool", position_cost=0.0, orientation_cost=weights[1], gain=gain),
        pink.PostureTask(cost=weights[2], gain=gain),
    ]
    for task in tasks:
        task.set_target_from_configuration(configuration)

    def call(q: Any) -> Any:
        configuration.update(q)
        return pink.solve_ik(configuration, tasks, asked["dt"], SOLVER, limits=[])

    return call


if __name__ == "__main__":
    call = f"solve_ik(configuration, tasks, dt, {SOLVER!r}, limits=..., constraints=...), damping 1e-12; "
    words = f"update(q); solve_ik(..., {SOLVER!r}, limits=[]): FrameTask, FrameTask, PostureTask, costs 1e2, 1, 1e-2"
    serve(Worker("pin-pink", {k: call + v for k, v in VARIANTS.items()}, cannot, prepare, read, step, words))
