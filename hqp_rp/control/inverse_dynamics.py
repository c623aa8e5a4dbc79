"""How the answer to a problem of inverse dynamics becomes torques."""

from __future__ import annotations

import dataclasses

from hqp_rp.core.problem import FloatArray, IntArray


@dataclasses.dataclass(slots=True, eq=False)
class InverseDynamics:
    """How an answer x = (v-dot, f / force_unit) of one problem becomes torques.

    Attributes:
        map: (d, n) and offset: (d,): the torques of the driven velocities are `map @ x + offset`, N m or N.
        driven: (d,) their velocity indices.
        limit: (d,) the greatest |torque|, infinite for none.
        nv, force_unit: as above.
        contact_jacobian: (F, nv): forces f act on the joints as `contact_jacobian.T @ f`.
        degrees: (M,) activation of each row of the levels, None where all are present.
    """

    map: FloatArray
    offset: FloatArray
    driven: IntArray
    limit: FloatArray
    nv: int
    force_unit: float
    contact_jacobian: FloatArray
    degrees: FloatArray | None

    def torque(self, x: FloatArray) -> FloatArray:
        """(d,) torques of the driven velocities for x (n,)."""
        torque: FloatArray = self.map @ x + self.offset
        return torque

    def acceleration(self, x: FloatArray) -> FloatArray:
        """(nv,) v-dot."""
        return x[: self.nv]

    def forces(self, x: FloatArray) -> FloatArray:
        """(F,) N, of all contacts' points, each in the axes of its contact."""
        return x[self.nv :] * self.force_unit
