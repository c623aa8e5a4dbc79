"""What is done to a QP's answer before it is used: refinement on its active rows."""

from __future__ import annotations

import numpy as np

from hqp_rp.core.problem import FloatArray
from hqp_rp.core.qp_backend import SlackQP

_ACTIVE = 1e-7  # Multipliers and violations of a scaled QP above this count as nonzero at first.
_FEASIBLE = 1e-13  # Rounding of a scaled QP's rows, relative to their terms.
_PASSES = 12


def polish(qp: SlackQP, t: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The exact answer on the active rows that (t, y) points at, or (t, y) when those rows are not the right ones.

    With hard rows G at their bounds and soft rows M violated, solves `min ||S w - c||^2 + ||M t - bounds||^2` subject
    to `G t = bounds` by orthogonal factorization, as a least correction of t. Rows that turn out violated, or held by a
    multiplier of the wrong sign, change sides; after a bounded number of passes without agreement the answer stays as it was.

    Source: solution polishing, Stellato, Banjac, Goulart, Bemporad and Boyd 2020, with changes of the set.

    Args:
        qp: the QP. t: (n,), y: (m,), what a back end answered.
    """
    soft = qp.soft
    root = np.sqrt(qp.hessian)
    curved = root > 0.0
    c = np.where(curved, -qp.gradient / np.where(curved, root, 1.0), 0.0)
    J = np.diag(root)[curved]
    c = c[curved]
    side = _sides(qp, t, y)
    seen = set()
    for _ in range(_PASSES):
        key = side.tobytes()
        if key in seen:
            break
        seen.add(key)
        bound = np.where(side > 0, qp.upper, qp.lower)
        violated = np.flatnonzero(side[:soft])
        active = soft + np.flatnonzero(side[soft:])
        M = np.concatenate([J, qp.rows[violated]])
        G = qp.rows[active]
        target = np.concatenate([c, bound[violated]])
        new = t
        for _ in range(2):  # The second pass refines what the factorization lost.
            new = new + _constrained_step(M, target - M @ new, G, bound[active] - G @ new)
        gradient = M.T @ (M @ new - target)
        multipliers = np.linalg.lstsq(G.T, -gradient, rcond=1e-10)[0] if len(active) else np.zeros(0)
        value = qp.rows @ new
        slack_y = np.zeros(len(y))
        slack_y[violated] = value[violated] - bound[violated]
        slack_y[active] = multipliers
        if len(active) and np.abs(value[active] - bound[active]).max() > 1e-11 * (1.0 + float(np.abs(new).max())):
            # More rows than can be met at once: the one that mattered least to the back end goes.
            side = side.copy()
            side[active[np.argmin(np.abs(y[active]))]] = 0.0
            continue
        changed = _change_sides(qp, new, value, slack_y, side)
        if changed is None:
            # On rows that are nearly dependent the factorization may run away: then the back end's answer is the better.
            before, after = _objective(qp, t)[0], _objective(qp, new)[0]
            return (new, slack_y) if after <= before + 1e-7 * (1.0 + before) else (t, y)
        side = changed
    return t, y


def _sides(qp: SlackQP, t: FloatArray, y: FloatArray) -> FloatArray:
    """(m,) +1 for a row beyond or held at its upper bound, -1 at its lower one, else 0."""
    value = qp.rows @ t
    beyond = value - np.clip(value, qp.lower, qp.upper)
    signal = np.where(np.arange(len(y)) < qp.soft, beyond, y)
    side = np.where(np.abs(signal) > _ACTIVE, np.sign(signal), 0.0)
    side[(side > 0) & ~np.isfinite(qp.upper)] = 0.0
    side[(side < 0) & ~np.isfinite(qp.lower)] = 0.0
    return side


def _change_sides(qp: SlackQP, t: FloatArray, value: FloatArray, y: FloatArray, side: FloatArray) -> FloatArray | None:
    """The sides after the rows that disagree with (t, y) have changed, or None when none does."""
    soft = qp.soft
    rounding = _FEASIBLE * (1.0 + np.abs(value) + np.linalg.norm(qp.rows, axis=1) * np.linalg.norm(t))
    wrong = (y * side < -rounding) & (side != 0.0)
    beyond = value - np.clip(value, qp.lower, qp.upper)
    missing = (side == 0.0) & (np.abs(beyond) > rounding)
    if not wrong.any() and not missing.any():
        return None
    new = side.copy()
    new[:soft][wrong[:soft]] = 0.0
    new[missing] = np.sign(beyond[missing])
    hard = np.flatnonzero(wrong[soft:])
    if len(hard) and not missing[soft:].any():
        # One at a time: letting several hard rows go at once may lose one that is needed.
        new[soft + hard[np.argmin((y * side)[soft + hard])]] = 0.0
    return new


def _constrained_step(M: FloatArray, residual: FloatArray, G: FloatArray, gap: FloatArray) -> FloatArray:
    """argmin ||M step - residual|| subject to G step = gap, of least norm."""
    if len(G) == 0:
        return _least_squares(M, residual)
    U, sigma, Vt = np.linalg.svd(G)
    rank = int((sigma > 1e-10 * sigma[0]).sum()) if len(sigma) else 0
    particular = Vt[:rank].T @ ((U[:, :rank].T @ gap) / sigma[:rank])
    N = Vt[rank:].T
    return np.asarray(particular + N @ _least_squares(M @ N, residual - M @ particular))


def _least_squares(M: FloatArray, residual: FloatArray) -> FloatArray:
    """Least-norm least squares; in a scaled QP a singular value below 1e-12 is rounding noise."""
    if M.size == 0:
        return np.zeros(M.shape[1])
    U, sigma, Vt = np.linalg.svd(M, full_matrices=False)
    rank = int((sigma > 1e-12 * max(1.0, sigma[0])).sum())
    return np.asarray(Vt[:rank].T @ ((U[:, :rank].T @ residual) / sigma[:rank]))


def _objective(qp: SlackQP, t: FloatArray) -> tuple[float, FloatArray]:
    """(1/2 ||(S w - c, violation)||^2, its gradient)."""
    soft = qp.soft
    curved = qp.hessian > 0.0
    root = np.sqrt(qp.hessian[curved])
    residual = root * t[curved] + qp.gradient[curved] / root
    value = qp.rows[:soft] @ t
    violation = value - np.clip(value, qp.lower[:soft], qp.upper[:soft])
    gradient = qp.rows[:soft].T @ violation
    gradient[curved] += root * residual
    return 0.5 * float(residual @ residual + violation @ violation), gradient
