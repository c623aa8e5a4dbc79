"""What the forces of contacts should be: tracked, shared evenly, or kept small."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from hqp_rp.control._checks import LINEAR_AXES, axis_numbers, axis_rows, finite_vector, per_row
from hqp_rp.control.contact import Contact
from hqp_rp.core.errors import SettingError
from hqp_rp.core.problem import FloatArray


class ContactForceTask:
    """Forces of contacts, in the axes of each contact (z its normal; x, y as of `Contact.axes`), in a level of a `TorqueStack`.

    For each contact with points i = 1, ..., k and the target f* (3,), along the chosen axes::

        each=False    sum_i f_i = f*            one row for each axis: the force of the contact
        each=True     f_i = f* / k              one row for each point and axis: shared evenly as well

    Tracking a force is the first; regularizing (target 0, or the share of the weight that a foot should carry) the second. An
    open contact (activation 0) has no force: its rows ask for 0, which it has.

    Args:
        contacts: of the stack: one `Contact`, or a sequence.
        target: (3,) N, f* of each contact, in its axes; components of axes that are not chosen do not matter.
        axes: any of "x", "y", "z". each: as above.
        weight: > 0, one number or one for each axis: how rows of the same level are weighed against each other.
        name: default "<contacts> force".

    `target` and `weight` may be set at every step.

    Raises:
        SettingError: no contact, or a value of the wrong shape, not finite, or out of its range.
    """

    __slots__ = ("_axes", "_contacts", "_each", "_name", "_target", "_version", "_weight")

    def __init__(
        self,
        contacts: Contact | Sequence[Contact],
        target: ArrayLike = (0.0, 0.0, 0.0),
        *,
        axes: str | Sequence[str] = "xyz",
        each: bool = False,
        weight: ArrayLike = 1.0,
        name: str = "",
    ) -> None:
        chosen = (contacts,) if isinstance(contacts, Contact) else contacts
        if not isinstance(chosen, list | tuple) or not chosen or not all(isinstance(c, Contact) for c in chosen):
            raise SettingError(f"contacts is {contacts!r}; give a Contact of the stack, or a list of them.")
        self._contacts = tuple(chosen)
        self._name = name or f"{', '.join(contact.name for contact in chosen)} force"
        self._axes, _ = axis_rows(axes, LINEAR_AXES, f"axes of {self._name!r}")
        self._each = bool(each)
        self._version = 0
        self.target = target
        self.weight = weight

    @property
    def name(self) -> str:
        """What levels, reports and errors call the task."""
        return self._name

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """Whose forces."""
        return self._contacts

    @property
    def axes(self) -> tuple[str, ...]:
        """The chosen axes of each contact."""
        return self._axes

    @property
    def target(self) -> FloatArray:
        """(3,) N, of each contact, in its axes."""
        return self._target

    @target.setter
    def target(self, value: ArrayLike) -> None:
        target = finite_vector(value, 3, f"the target of {self._name!r}", "N")
        if not np.array_equal(getattr(self, "_target", np.nan), target):
            self._target = target
            self._version += 1

    @property
    def weight(self) -> float | FloatArray:
        """One number, or one for each axis."""
        return self._weight

    @weight.setter
    def weight(self, value: ArrayLike) -> None:
        self._weight = per_row(value, len(self._axes), f"the weight of {self._name!r}", positive=True)
        self._version += 1

    @property
    def size(self) -> int:
        """How many rows it has."""
        each = sum(len(contact.points) for contact in self._contacts) if self._each else len(self._contacts)
        return each * len(self._axes)

    def rows(self, spans: dict[int, slice], forces: int) -> tuple[FloatArray, FloatArray]:
        """Matrix (m, F) on the forces of all contacts and their target (m,), scaled by the weight.

        spans: where the forces of a contact stand, by its `id`. forces: F.
        """
        axes = axis_numbers(self._axes)
        weight = np.broadcast_to(np.asarray(self._weight, dtype=np.float64), (len(axes),))
        matrices, targets = [], []
        for contact in self._contacts:
            span, k = spans[id(contact)], len(contact.points)
            target = self._target[axes] if contact.activation > 0.0 else np.zeros(len(axes))
            chosen = np.zeros((len(axes), 3))
            chosen[np.arange(len(axes)), axes] = weight
            own = np.kron(np.eye(k), chosen) if self._each else np.tile(chosen, k)
            rows = np.zeros((len(own), forces))
            rows[:, span] = own
            matrices.append(rows)
            targets.append(np.tile(weight * target / k, k) if self._each else weight * target)
        return np.concatenate(matrices), np.concatenate(targets)

    def __repr__(self) -> str:
        return f"ContactForceTask({self._name!r})"
