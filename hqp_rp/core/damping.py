"""Damping policies, shared by every closed form: what replaces 1/sigma when singular values become small."""

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


Damping: TypeAlias = NoDamping | ConstantDamping | VariableDamping | Truncation


def checked_damping(damping: object) -> Damping:
    """`damping` itself; raises `SettingError` when it is no damping policy."""
    if isinstance(damping, NoDamping | ConstantDamping | VariableDamping | Truncation):
        return damping
    raise SettingError(
        f"damping is {damping!r}; give NoDamping(), ConstantDamping(factor), VariableDamping(delta, maximum) or "
        "Truncation(threshold)."
    )


def _require(name: str, value: float, least: float, *, strict: bool = False) -> None:
    if not isinstance(value, int | float) or not math.isfinite(value) or value < least or (strict and value == least):
        sign = ">" if strict else ">="
        raise SettingError(f"{name} is {value!r}; it must be a finite number {sign} {least:g}.")
