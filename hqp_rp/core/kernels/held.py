"""What moves that active rows allow can still remove from a residual: an upper bound, by non-negative multipliers."""

from __future__ import annotations

import math

import numpy as np

from hqp_rp.core.kernels.compile import kernel
from hqp_rp.core.kernels.orthogonal import EPS, tall_least_squares

STEP_COST = 1e-5  # as in certify
NOISE = 8.0 * EPS  # half of the least that certify allows for what rounding turns


@kernel
def length_of(v):
    """||v||_2; overflow gives inf, which proves nothing."""
    return math.sqrt(np.sum(v * v))


@kernel
def drop_negative(C, y, w, passive):
    """w: least squares `min ||y - C w||` on the passive columns, those of negative weight dropped until none is.

    False where more columns are passive than y has entries.
    """
    d, k = C.shape
    index = np.empty(k, np.int64)
    while True:
        count = 0
        for i in range(k):
            w[i] = 0.0
            if passive[i]:
                index[count] = i
                count += 1
        if count > d:
            return False
        if count == 0:
            return True
        t = y.copy()
        tall_least_squares(C[:, index[:count]].copy(), t)
        agreed = True
        for i in range(count):
            if t[i] < 0.0:
                passive[index[i]] = False
                agreed = False
            else:
                w[index[i]] = t[i]
        if agreed:
            return True


@kernel
def nonnegative(C, y, w, enough):
    """y - C w for a w >= 0 that makes it short (Lawson and Hanson 1974): any w >= 0 gives an upper bound.

    Starts from the least squares of all columns, which in most cases has the right signs. w (k,) is written.
    """
    d, k = C.shape
    passive = np.ones(k, np.bool_)
    if k > d or not drop_negative(C, y, w, passive):
        passive[:] = False
        w[:] = 0.0
    rest = y - np.dot(C, w)
    least = 1e-13 * length_of(y)
    index = np.empty(k, np.int64)
    trial = np.empty(k)
    for _ in range(3 * k + 10):
        if length_of(rest) <= enough:
            break
        entering = -1
        most = least
        for i in range(k):
            if not passive[i]:
                pull = 0.0
                for j in range(d):
                    pull += C[j, i] * rest[j]
                if pull > most:
                    most = pull
                    entering = i
        if entering < 0:
            break
        passive[entering] = True
        trial[:] = w
        count = 0
        while True:
            count = 0
            for i in range(k):
                if passive[i]:
                    index[count] = i
                    count += 1
            if count == 0 or count > d:
                break
            t = y.copy()
            tall_least_squares(C[:, index[:count]].copy(), t)
            step = 1.0
            for i in range(count):
                old = trial[index[i]]
                if t[i] <= 0.0:
                    step = min(step, old / (old - t[i]) if old > t[i] else 0.0)
            for i in range(count):
                trial[index[i]] += step * (t[i] - trial[index[i]])
                if t[i] <= 0.0 and trial[index[i]] <= 1e-15 * abs(t[i]):
                    trial[index[i]] = 0.0
                    passive[index[i]] = False
            if step == 1.0:
                break
            if not passive[entering] and step == 0.0:
                break
        if count > d:
            break
        following = y - np.dot(C, np.maximum(trial, 0.0))
        if not length_of(following) < length_of(rest):
            break
        w[:] = np.maximum(trial, 0.0)
        rest = following
    return rest


@kernel
def over_square_root(C, v, H, delta, columns):
    """F^-1 C^T v (d,) and, in the columns of `columns` (d, h), F^-1 H^T, with F F^T = C^T C + delta^2 I (Cholesky)."""
    m, d = C.shape
    h = len(H)
    F = np.dot(np.ascontiguousarray(C.T), C)
    slope = np.zeros(d)
    for i in range(m):
        for j in range(d):
            slope[j] += C[i, j] * v[i]
    for j in range(d):
        s = F[j, j] + delta * delta
        for q in range(j):
            s -= F[j, q] * F[j, q]
        s = math.sqrt(max(s, delta * delta))
        F[j, j] = s
        for i in range(j + 1, d):
            t = F[i, j]
            for q in range(j):
                t -= F[i, q] * F[j, q]
            F[i, j] = t / s
    for j in range(d):
        s = slope[j]
        for q in range(j):
            s -= F[j, q] * slope[q]
        slope[j] = s / F[j, j]
        for i in range(h):
            columns[j, i] = H[i, j]
        for q in range(j):
            f = F[j, q]
            for i in range(h):
                columns[j, i] -= f * columns[q, i]
        for i in range(h):
            columns[j, i] /= F[j, j]
    return slope


@kernel
def held_back(C, v, H, size, whole, allowed, multipliers):
    """Whether moves z with H z <= 0, each at the cost STEP_COST * size * ||z||, are proven to remove no more than allowed.

    What they remove from v through C z is at most `||F^-1 (C^T v + H^T w)||` for any multipliers w >= 0 (F as in
    `over_square_root`). Rounding adds as much as w pulls; size and whole are bounds below and above ||C||_2 of the level.
    multipliers (h,): written, w over what the level can pull.
    """
    h = len(H)
    columns = np.empty((C.shape[1], h))
    slope = over_square_root(C, v, H, STEP_COST * size, columns)
    lengths = np.ones(h)
    for i in range(h):
        s = 0.0
        for j in range(C.shape[1]):
            s += columns[j, i] ** 2
        if s > 0.0:
            lengths[i] = math.sqrt(s)
            for j in range(C.shape[1]):
                columns[j, i] /= lengths[i]
    w = np.empty(h)
    rest = length_of(nonnegative(columns, -slope, w, allowed))
    residual = length_of(v)
    pulls = residual
    for i in range(h):
        multiplier = w[i] / lengths[i] / whole
        pulls += multiplier
        multipliers[i] = multiplier / residual
    return rest <= allowed + min(residual, pulls * NOISE / STEP_COST)
