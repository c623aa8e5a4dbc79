"""Damping policies: what replaces 1/sigma when singular values become small, in a closed form or at one level of a problem."""

from __future__ import annotations

import dataclasses
import math
from typing import ClassVar, Literal, TypeAlias

from hqp_rp.core.errors import SettingError


class _Policy:
    """What every policy is: a kind and up to two numbers for the native core, and a word for its label."""

    kind: ClassVar[int]
    label: ClassVar[str]

    @property
    def parameters(self) -> tuple[float, float]:
        """The policy's settings in the order of its fields, 0 for those that it does not have."""
        first, second = (*self._settings().values(), 0.0, 0.0)[:2]
        return first, second

    def _settings(self) -> dict[str, float]:
        own = [field.name for field in dataclasses.fields(self)]  # type: ignore[arg-type]
        return {name: float(getattr(self, name)) for name in own}

    def __repr__(self) -> str:
        settings = self._settings()
        if not settings:
            return self.label
        if len(settings) == 1:
            return f"{self.label}({next(iter(settings.values())):g})"
        return f"{self.label}({', '.join(f'{name}={value:g}' for name, value in settings.items())})"


@dataclasses.dataclass(frozen=True, repr=False)
class NoDamping(_Policy):
    """`1/sigma_i` for every singular value that the rank rule keeps: the pseudo-inverse (17)."""

    kind: ClassVar[int] = 0
    label: ClassVar[str] = "none"


@dataclasses.dataclass(frozen=True, repr=False)
class ConstantDamping(_Policy):
    """`sigma_i / (sigma_i^2 + factor^2)`: damped least squares (14)-(15), with eta = factor.

    Args:
        factor: eta >= 0, in the units of the matrix that is inverted.
    """

    factor: float
    kind: ClassVar[int] = 1
    label: ClassVar[str] = "constant"

    def __post_init__(self) -> None:
        _require("factor", self.factor, 0.0)


@dataclasses.dataclass(frozen=True, repr=False)
class VariableDamping(_Policy):
    """`sigma_i / (sigma_i^2 + lambda_0^2)`, damped only near a singularity: equations (18)-(19).

    lambda_0^2 = 0 when the smallest singular value sigma_m >= delta, else (1 - (sigma_m / delta)^2) * maximum^2:
    continuous at sigma_m = delta. (The paper's (19) prints the right-hand side as lambda_0; it is lambda_0^2, as its
    lambda_max^2 and the source of the formula, Chiaverini 1997, have it.)

    Args:
        delta: > 0, the smallest singular value below which damping sets in.
        maximum: lambda_max >= 0, the damping at sigma_m = 0. Both in the units of the matrix that is inverted.
    """

    delta: float
    maximum: float
    kind: ClassVar[int] = 2
    label: ClassVar[str] = "variable"

    def __post_init__(self) -> None:
        _require("delta", self.delta, 0.0, strict=True)
        _require("maximum", self.maximum, 0.0)


@dataclasses.dataclass(frozen=True, repr=False)
class Truncation(_Policy):
    """`1/sigma_i` for sigma_i > threshold, else 0: the truncated pseudo-inverse.

    Args:
        threshold: >= 0, in the units of the matrix that is inverted.
    """

    threshold: float
    kind: ClassVar[int] = 3
    label: ClassVar[str] = "truncation"

    def __post_init__(self) -> None:
        _require("threshold", self.threshold, 0.0)


@dataclasses.dataclass(frozen=True, repr=False)
class ManipulabilityDamping(_Policy):
    """`sigma_i / (sigma_i^2 + lambda)`, lambda = maximum^2 (1 - w / threshold)^2 where w < threshold, else 0.

    w is the manipulability sqrt(det(A A^T)), the product of all singular values (of a matrix with more rows than columns, of
    those that it can have). Unlike the smallest singular value it depends on units and on how many rows there are: a threshold
    serves one kind of matrix.

    Args:
        threshold: w_0 > 0, in the unit of the matrix to the power of its rank.
        maximum: >= 0, in the unit of the matrix; the paper's lambda_0 is its square.

    Source: Nakamura and Hanafusa 1986; Yoshikawa 1985 for w.
    """

    threshold: float
    maximum: float
    kind: ClassVar[int] = 5
    label: ClassVar[str] = "manipulability"

    def __post_init__(self) -> None:
        _require("threshold", self.threshold, 0.0, strict=True)
        _require("maximum", self.maximum, 0.0)


@dataclasses.dataclass(frozen=True, repr=False)
class NumericalFiltering(_Policy):
    """Numerical filtering: the last singular direction alone is damped, `1/sigma_i` for all others.

    `sigma_m / (sigma_m^2 + beta^2)` with beta^2 = (1 - (sigma_m / delta)^2) maximum^2 where sigma_m < delta, else 0: what
    J^T (J J^T + beta^2 u_m u_m^T)^-1 is. The task is missed in that direction only; where two singular values are small the
    second is not damped.

    Args:
        delta: > 0. maximum: beta_max >= 0. Both in the unit of the matrix that is inverted.

    Source: Maciejewski and Klein 1988; Chiaverini 1997, who adds a small isotropic damping, here none.
    """

    delta: float
    maximum: float
    kind: ClassVar[int] = 6
    label: ClassVar[str] = "filtering"

    def __post_init__(self) -> None:
        _require("delta", self.delta, 0.0, strict=True)
        _require("maximum", self.maximum, 0.0)


@dataclasses.dataclass(frozen=True, repr=False)
class ErrorDamping(_Policy):
    """mu ||x - zeta||^2, mu = factor * |e|^power, for a level of which x = 0 misses its rows by e: none at the target.

    A damping of one level (`Level(damping=...)`), not of a closed form, whose inverses know no error.

    Args:
        factor: c >= 0, in the unit of the matrix squared over that of the bounds to the power.
        power: 2, as mink and pink have it, or 1. What keeps a loop from chattering about a target out of reach grows like the
            error itself, reach * dt / 2 times it, so with power 1 one factor serves near and far: see
            the page "Still at the limit".
        toward: "below": zeta is what the levels below ask for, the minimizer of sum_j ||A_j x - b_j||^2 + mu ||x||^2 over their
            equality rows. Along a direction that the level hardly sees they then get what it does not need, in proportion;
            towards "rest", zeta = 0 as in mink and pink, they must leave that direction alone, and where it turns from step to
            step, as beside a stretched arm, they chatter around it.

    Source: Sugihara 2011, (21); the `lm_damping` of mink's and pink's tasks.
    """

    factor: float
    power: int = 2
    toward: Literal["below", "rest"] = "below"
    kind: ClassVar[int] = 4
    label: ClassVar[str] = "error"

    def __post_init__(self) -> None:
        _require("factor", self.factor, 0.0)
        if self.power not in (1, 2):
            raise SettingError(f"power is {self.power!r}; it must be 1 or 2.")
        if self.toward not in ("below", "rest"):
            raise SettingError(f"toward is {self.toward!r}; it must be 'below' or 'rest'.")

    @property
    def parameters(self) -> tuple[float, float]:
        return (float(self.factor), 2.0 * self.power + (self.toward == "rest"))

    def __repr__(self) -> str:
        power = "" if self.power == 2 else f", power={self.power}"
        return f"{self.label}({self.factor:g}{power}{'' if self.toward == 'below' else ', rest'})"


Damping: TypeAlias = (
    NoDamping | ConstantDamping | VariableDamping | Truncation | ManipulabilityDamping | NumericalFiltering
)
"""Of a closed form."""

LevelDamping: TypeAlias = Damping | ErrorDamping
"""Of one level of a problem; see `hqp_rp.core.level_damping`."""


def checked_damping(damping: object) -> Damping:
    """`damping` itself; raises `SettingError` when it is no damping policy."""
    if isinstance(damping, Damping):
        return damping
    if isinstance(damping, ErrorDamping):
        raise SettingError(f"damping is {damping!r}, which is of one level: Level(..., damping={damping!r}).")
    raise SettingError(
        f"damping is {damping!r}; give NoDamping(), ConstantDamping(factor), VariableDamping(delta, maximum), "
        "Truncation(threshold), ManipulabilityDamping(threshold, maximum) or NumericalFiltering(delta, maximum)."
    )


def checked_level_damping(damping: object, what: str = "damping") -> LevelDamping | None:
    """`damping` itself, None for none; raises `SettingError` when it is no policy of a level."""
    if damping is None or isinstance(damping, NoDamping):
        return None
    if isinstance(damping, LevelDamping):
        return damping
    raise SettingError(
        f"{what} is {damping!r}; give None, ConstantDamping(factor), ErrorDamping(factor), VariableDamping(delta, maximum), "
        "Truncation(threshold), ManipulabilityDamping(threshold, maximum) or NumericalFiltering(delta, maximum)."
    )


def damping_of(kind: int, parameters: tuple[float, float]) -> LevelDamping | None:
    """The policy of this kind with these parameters, None for kind 0: the inverse of `kind` and `parameters`."""
    first, second = parameters
    if kind == NoDamping.kind:
        return None
    if kind == ErrorDamping.kind:
        power, rest = divmod(int(second), 2)
        return ErrorDamping(first, power, "rest" if rest else "below")
    for one in (ConstantDamping, Truncation):
        if kind == one.kind:
            return one(first)
    for two in (VariableDamping, ManipulabilityDamping, NumericalFiltering):
        if kind == two.kind:
            return two(first, second)
    raise SettingError(f"damping of kind {kind!r}; kinds are 0 to {NumericalFiltering.kind}.")


def _require(name: str, value: float, least: float, *, strict: bool = False) -> None:
    if not isinstance(value, int | float) or not math.isfinite(value) or value < least or (strict and value == least):
        sign = ">" if strict else ">="
        raise SettingError(f"{name} is {value!r}; it must be a finite number {sign} {least:g}.")
