"""Damping policies: what replaces 1/sigma when singular values become small, in a closed form or at one level of a problem."""

from __future__ import annotations

import dataclasses
import math
from typing import ClassVar, TypeAlias

from hqp_rp.core.errors import SettingError


@dataclasses.dataclass(frozen=True)
class NoDamping:
    """`1/sigma_i` for every singular value that the rank rule keeps: the pseudo-inverse (17)."""

    kind: ClassVar[int] = 0

    @property
    def parameters(self) -> tuple[float, float]:
        return (0.0, 0.0)

    def __repr__(self) -> str:
        return "none"


@dataclasses.dataclass(frozen=True)
class ConstantDamping:
    """`sigma_i / (sigma_i^2 + factor^2)`: damped least squares (14)-(15), with eta = factor.

    Args:
        factor: eta >= 0, in the units of the matrix that is inverted.
    """

    factor: float
    kind: ClassVar[int] = 1

    def __post_init__(self) -> None:
        _require("factor", self.factor, 0.0)

    @property
    def parameters(self) -> tuple[float, float]:
        return (float(self.factor), 0.0)

    def __repr__(self) -> str:
        return f"constant({self.factor:g})"


@dataclasses.dataclass(frozen=True)
class VariableDamping:
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

    def __post_init__(self) -> None:
        _require("delta", self.delta, 0.0, strict=True)
        _require("maximum", self.maximum, 0.0)

    @property
    def parameters(self) -> tuple[float, float]:
        return (float(self.delta), float(self.maximum))

    def __repr__(self) -> str:
        return f"variable(delta={self.delta:g}, maximum={self.maximum:g})"


@dataclasses.dataclass(frozen=True)
class Truncation:
    """`1/sigma_i` for sigma_i > threshold, else 0: the truncated pseudo-inverse.

    Args:
        threshold: >= 0, in the units of the matrix that is inverted.
    """

    threshold: float
    kind: ClassVar[int] = 3

    def __post_init__(self) -> None:
        _require("threshold", self.threshold, 0.0)

    @property
    def parameters(self) -> tuple[float, float]:
        return (float(self.threshold), 0.0)

    def __repr__(self) -> str:
        return f"truncation({self.threshold:g})"


@dataclasses.dataclass(frozen=True)
class ErrorDamping:
    """mu = factor * |e|^2 for a level of which x = 0 misses its rows by e: strong far from the target, none at it.

    A damping of one level (`Level(damping=...)`), not of a closed form, whose inverses know no error.

    Args:
        factor: c >= 0, in the units of the rows' matrix squared over the units of its bounds squared.

    Source: Sugihara 2011, (21); the `lm_damping` of mink's and pink's tasks.
    """

    factor: float
    kind: ClassVar[int] = 4

    def __post_init__(self) -> None:
        _require("factor", self.factor, 0.0)

    @property
    def parameters(self) -> tuple[float, float]:
        return (float(self.factor), 0.0)

    def __repr__(self) -> str:
        return f"error({self.factor:g})"


Damping: TypeAlias = NoDamping | ConstantDamping | VariableDamping | Truncation
"""Of a closed form."""

LevelDamping: TypeAlias = NoDamping | ConstantDamping | VariableDamping | Truncation | ErrorDamping
"""Of one level of a problem; see `hqp_rp.core.level_damping`."""

_KINDS: tuple[type[LevelDamping], ...] = (NoDamping, ConstantDamping, VariableDamping, Truncation, ErrorDamping)


def checked_damping(damping: object) -> Damping:
    """`damping` itself; raises `SettingError` when it is no damping policy."""
    if isinstance(damping, NoDamping | ConstantDamping | VariableDamping | Truncation):
        return damping
    if isinstance(damping, ErrorDamping):
        raise SettingError(f"damping is {damping!r}, which is of one level: Level(..., damping={damping!r}).")
    raise SettingError(
        f"damping is {damping!r}; give NoDamping(), ConstantDamping(factor), VariableDamping(delta, maximum) or "
        "Truncation(threshold)."
    )


def checked_level_damping(damping: object, what: str = "damping") -> LevelDamping | None:
    """`damping` itself, None for none; raises `SettingError` when it is no policy of a level."""
    if damping is None or isinstance(damping, NoDamping):
        return None
    if isinstance(damping, ConstantDamping | VariableDamping | Truncation | ErrorDamping):
        return damping
    raise SettingError(
        f"{what} is {damping!r}; give None, ConstantDamping(factor), ErrorDamping(factor), VariableDamping(delta, maximum) "
        "or Truncation(threshold)."
    )


def damping_of(kind: int, parameters: tuple[float, float]) -> LevelDamping | None:
    """The policy of this kind with these parameters, None for kind 0: the inverse of `kind` and `parameters`."""
    if kind not in range(len(_KINDS)):
        raise SettingError(f"damping of kind {kind!r}; kinds are 0 ... {len(_KINDS) - 1}.")
    made = _KINDS[kind]
    fields = dataclasses.fields(made)
    return checked_level_damping(made(**{field.name: value for field, value in zip(fields, parameters, strict=False)}))


def _require(name: str, value: float, least: float, *, strict: bool = False) -> None:
    if not isinstance(value, int | float) or not math.isfinite(value) or value < least or (strict and value == least):
        sign = ">" if strict else ">="
        raise SettingError(f"{name} is {value!r}; it must be a finite number {sign} {least:g}.")
