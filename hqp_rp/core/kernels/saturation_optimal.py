"""The optimum that the optimal variant of saturation in the null space seeks, found by saturating and releasing unknowns.

Level k, in the freedom Z (n, d) that earlier levels left, z = Z^T (x - x_{k-1}), reads V z = q + s p: p and q come from
b_k and from A_k x_{k-1}, V (r, d) is an orthonormal basis of the rows that A_k has there. Wanted are the largest s in
[0, 1] that the box allows and, at that s, the z whose x is nearest to zeta. `follow` moves along the curve of such nearest
points while the right-hand side grows from what x_{k-1} makes of it to what the level asks for:

    the unknown that reaches its bound first is saturated;
    a saturated unknown whose multiplier changes its sign is released;
    an unknown that reaches its bound where the level has no freedom left takes the place of a saturated one, chosen by the
    smallest ratio of multipliers; where there is none, no point of the box goes any further.
"""

from __future__ import annotations

import numpy as np

from hqp_rp.core.kernels.cascade import finite
from hqp_rp.core.kernels.compile import kernel
from hqp_rp.core.kernels.saturation import SLACK, least_squares

DEPENDENT = 1e-9  # a row of which no more than this share is new counts as a combination of the others
ROUNDS = 20  # iterations allowed for each unknown


@kernel
def forward(R, t, m):
    """y with R[:m, :m]^T y = t."""
    y = np.empty(m)
    for i in range(m):
        s = t[i]
        for l in range(i):
            s -= R[l, i] * y[l]
        y[i] = s / R[i, i]
    return y


@kernel
def backward(R, t, m):
    """y with R[:m, :m] y = t."""
    y = np.empty(m)
    for i in range(m - 1, -1, -1):
        s = t[i]
        for l in range(i + 1, m):
            s -= R[i, l] * y[l]
        y[i] = s / R[i, i]
    return y


@kernel
def append(g, Q, R, m):
    """Add g as row m of the factorization C = R^T Q, Q with orthonormal rows; whether it is independent of those before it."""
    D = len(g)
    v = g.copy()
    R[:m, m] = 0.0
    for _ in range(2):  # twice is enough for orthogonality to working precision
        for i in range(m):
            c = np.dot(Q[i], v)
            R[i, m] += c
            v -= c * Q[i]
    left = np.sqrt(np.dot(v, v))
    if m == D or left <= DEPENDENT * np.sqrt(np.dot(g, g)):
        return False
    R[m, m] = left
    Q[m] = v / left
    return True


@kernel
def factor(E, G, held, count, Q, R):
    """Factor the rows of E and the held rows of G, which are independent; the number of rows."""
    m = len(E)
    for i in range(m):
        append(E[i], Q, R, i)
    for i in range(count):
        append(G[held[i]], Q, R, m + i)
    return m + count


@kernel
def remove(held, count, i):
    """Take entry i out of the list; the new count."""
    for l in range(i, count - 1):
        held[l] = held[l + 1]
    return count - 1


@kernel
def kept_rows(E, G, side, mu, held, Q, R):
    """The first set of held rows: those with a side, as far as they are independent of E and of each other.

    A dependent row hands its multiplier over to the others as far as their signs allow; the first that reaches zero is
    dropped. Returns the number of rows in `held`; `side` and `mu` are brought up to date.
    """
    r = len(E)
    count = 0
    for j in range(len(side)):
        if side[j] == 0:
            continue
        m = factor(E, G, held, count, Q, R)
        if append(G[j], Q, R, m):
            held[count] = j
            count += 1
            continue
        alpha = backward(R, R[:m, m].copy(), m)
        total = mu[j]
        move = total
        out = -1
        for i in range(count):
            a = alpha[r + i]
            # mu_i + move * a must keep its sign
            if side[held[i]] * total * a > 0.0 and abs(a) > DEPENDENT:
                reach = -mu[held[i]] / a
                if abs(reach) < abs(move):
                    move = reach
                    out = i
        for i in range(count):
            mu[held[i]] += move * alpha[r + i]
        if out < 0:
            side[j] = 0
            mu[j] = 0.0
        else:
            mu[j] = total - move
            mu[held[out]] = 0.0
            side[held[out]] = 0
            count = remove(held, count, out)
            held[count] = j
            count += 1
    return count


@kernel
def follow(E, e0, e1, G, low, high, centre, side, mu, z):
    """Move z = argmin ||z - centre|| over E z = e0 + t (e1 - e0), low <= G z <= high from t = 0 to t = 1.

    At t = 0, z is that point, `side` (+1 at high, -1 at low, 0 neither) and the multipliers `mu` of its bounds fit it. All
    three are updated. Returns (t, iterations); t < 1 where no point goes further, t = -1 where the iterations ran out.
    """
    r, D = E.shape
    n = len(G)
    Q = np.empty((D, D))
    R = np.empty((D, D + 1))
    held = np.empty(n, np.int64)
    size = np.empty(n)
    for j in range(n):
        size[j] = np.sqrt(np.dot(G[j], G[j]))
        if size[j] <= DEPENDENT:  # fixed by the levels before
            side[j] = 0
            mu[j] = 0.0
    count = kept_rows(E, G, side, mu, held, Q, R)
    slope = np.zeros(D)
    target = np.empty(D)
    slope[:r] = e1 - e0
    t = 0.0
    for iteration in range(ROUNDS * (n + 1)):
        m = factor(E, G, held, count, Q, R)
        for i in range(r):
            target[i] = e0[i] + t * slope[i] - np.dot(E[i], centre)
        for i in range(count):
            j = held[i]
            target[r + i] = (high[j] if side[j] > 0 else low[j]) - np.dot(G[j], centre)
        w = forward(R, target[:m], m)
        dw = forward(R, slope[:m], m)
        z[:] = centre + np.dot(w, Q[:m])
        dz = np.dot(dw, Q[:m])
        force = backward(R, w, m)
        dforce = backward(R, dw, m)
        step = 1.0 - t
        enter = -1
        leave = -1
        above = False
        for j in range(n):
            if side[j] != 0 or size[j] <= DEPENDENT:
                continue
            v = np.dot(G[j], z)
            dv = np.dot(G[j], dz)
            if abs(dv) <= 1e-14 * size[j] * np.sqrt(np.dot(dz, dz)):
                continue
            reach = max(((high[j] if dv > 0.0 else low[j]) - v) / dv, 0.0)
            if reach < step:
                step = reach
                enter = j
                above = dv > 0.0
        for i in range(count):
            s = side[held[i]]
            rise = s * dforce[r + i]
            if rise <= 0.0:
                continue
            reach = max(-s * force[r + i], 0.0) / rise
            if reach < step:
                step = reach
                enter = -1
                leave = i
        t += step
        z += step * dz
        for i in range(count):
            mu[held[i]] = force[r + i] + step * dforce[r + i]
        if leave >= 0:
            side[held[leave]] = 0
            mu[held[leave]] = 0.0
            count = remove(held, count, leave)
            continue
        if enter < 0:
            return 1.0, iteration
        if not append(G[enter], Q, R, m):
            alpha = backward(R, R[:m, m].copy(), m)
            out = -1
            least = np.inf
            new = 1.0 if above else -1.0
            for i in range(count):
                s = side[held[i]]
                a = s * new * alpha[r + i]
                if a <= DEPENDENT:
                    continue
                ratio = max(-s * mu[held[i]], 0.0) / a
                if ratio < least:
                    least = ratio
                    out = i
            if out < 0:
                return t, iteration
            for i in range(count):
                mu[held[i]] += new * least * alpha[r + i]
            mu[held[out]] = 0.0
            side[held[out]] = 0
            count = remove(held, count, out)
            mu[enter] = -new * least
        else:
            mu[enter] = 0.0
        side[enter] = 1 if above else -1
        held[count] = enter
        count += 1
    return -1.0, ROUNDS * (n + 1)


@kernel
def optimal_level(J, t, rank, U, S, Vt, Z, low, high, zeta, side, mu, x):
    """Execute one level, J Z = U S Vt of that rank, at its largest scale and as near to zeta as that allows.

    x (n,) is the answer of the levels before, `side` and `mu` its saturated unknowns with their multipliers; all three are
    updated. Returns (scale, iterations): scale 0 with nothing changed where no scale is possible, -1 with nothing changed
    where the iterations ran out, nan after an overflow.
    """
    n, d = Z.shape
    V = np.ascontiguousarray(Vt[:rank])
    p = np.dot(V, least_squares(rank, U, S, Vt, t))
    q = -np.dot(V, least_squares(rank, U, S, Vt, np.dot(J, x)))
    centre = np.dot(np.ascontiguousarray(Z.T), zeta - x)
    below = low - x
    above = high - x
    z = np.zeros(d)
    side_k = side.copy()
    mu_k = mu.copy()
    reached, tried = follow(V, np.zeros(rank), p + q, Z, below, above, centre, side_k, mu_k, z)
    scale = 1.0
    if 0.0 <= reached < 1.0:
        size = np.sqrt(np.dot(p, p))
        if size == 0.0:
            return 0.0, tried
        if np.sqrt(np.dot(q, q)) <= SLACK * size:  # from A_k x_{k-1} = 0 the way to b_k is that of the scale itself
            scale = reached
        else:
            # The scale is one more unknown, sigma = s |p| in [0, |p|], drawn to |p|; then it is raised, all else in its wake.
            E = np.empty((rank, d + 1))
            E[:, :d] = V
            E[:, d] = -p / size
            G = np.zeros((n + 1, d + 1))
            G[:n, :d] = Z
            G[n, d] = 1.0
            wide = np.append(side, 0)
            force = np.append(mu, 0.0)
            point = np.zeros(d + 1)
            reached, more = follow(
                E, -p, q, G, np.append(below, 0.0), np.append(above, size), np.append(centre, size), wide, force, point
            )
            tried += more
            if 0.0 <= reached < 1.0:
                return 0.0, tried
            side_k = wide[:n].copy()
            mu_k = force[:n].copy()
            z = point[:d].copy()
            scale = min(max(point[d] / size, 0.0), 1.0)
            if reached == 1.0 and scale < 1.0:
                reached, more = follow(V, q + scale * p, q + p, Z, below, above, centre, side_k, mu_k, z)
                tried += more
                scale += reached * (1.0 - scale)
    if not finite(z):
        return np.nan, tried
    if reached < 0.0:
        return -1.0, tried
    side[:] = side_k
    mu[:] = mu_k
    step = np.dot(Z, z)
    for j in range(n):
        x[j] = min(max(x[j] + step[j], low[j]), high[j])
    return scale, tried
