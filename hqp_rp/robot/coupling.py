"""What a model states beside its tree: joints that follow others, loops, ball joints with a range."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

from hqp_rp.core.errors import SettingError

if TYPE_CHECKING:
    import mujoco


@dataclasses.dataclass(frozen=True, slots=True)
class Coupling:
    """A joint that follows another: `q_joint - own = sum_i coefficients[i] (q_source - reference)^i`, rad or m.

    A URDF's `<mimic>` and a MuJoCo `<equality><joint>`; without a source the joint is held where the coefficient says.
    """

    joint: str
    source: str | None
    coefficients: tuple[float, ...]
    own: float = 0.0
    reference: float = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.joint, str) or not isinstance(self.source, str | None) or self.joint == self.source:
            raise SettingError(
                f"a coupling of {self.joint!r} to {self.source!r}: both must be names of joints, two different ones; the "
                "second may be None."
            )
        numbers = (*self.coefficients, self.own, self.reference) if isinstance(self.coefficients, tuple | list) else ()
        if not numbers or not all(isinstance(x, int | float) and math.isfinite(x) for x in numbers):
            raise SettingError(
                f"the coupling of {self.joint!r} has coefficients {self.coefficients!r}, own {self.own!r}, reference "
                f"{self.reference!r}; give finite numbers, such as coefficients (offset, multiplier)."
            )
        object.__setattr__(self, "coefficients", tuple(float(x) for x in self.coefficients))


def couplings_of(model: mujoco.MjModel) -> tuple[tuple[Coupling, ...], tuple[str, ...]]:
    """The active joint couplings of a model, and the names of its other active equality constraints (loops)."""
    import mujoco

    couplings, others = [], []
    for i in range(model.neq):
        if not model.eq_active0[i]:
            continue
        if model.eq_type[i] != mujoco.mjtEq.mjEQ_JOINT:
            others.append(model.equality(i).name or _unnamed(model, i))
            continue
        first, second = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
        name, own = _joint(model, first)
        source, reference = (None, 0.0) if second < 0 else _joint(model, second)
        couplings.append(Coupling(name, source, tuple(model.eq_data[i, :5].tolist()), own, reference))
    return tuple(couplings), tuple(others)


def limited_balls(model: mujoco.MjModel) -> tuple[str, ...]:
    """Names of the ball joints that have a range."""
    import mujoco

    balls = [j for j in range(model.njnt) if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_BALL and model.jnt_limited[j]]
    return tuple(_joint(model, j)[0] for j in balls)


def _unnamed(model: mujoco.MjModel, i: int) -> str:
    """What an equality constraint without a name is called: its type and what it ties, such as "connect of foot and crank"."""
    import mujoco

    kind = mujoco.mjtEq(int(model.eq_type[i])).name.removeprefix("mjEQ_").lower()
    of = int(model.eq_objtype[i])
    numbers = [int(n) for n in (model.eq_obj1id[i], model.eq_obj2id[i]) if n >= 0]
    if not of:
        return f"{kind} (number {i})"
    return f"{kind} of " + " and ".join(mujoco.mj_id2name(model, of, n) or f"number {n}" for n in numbers)


def _joint(model: mujoco.MjModel, j: int) -> tuple[str, float]:
    return model.joint(j).name or f"unnamed_joint_{j}", float(model.qpos0[model.jnt_qposadr[j]])
