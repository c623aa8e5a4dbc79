// The optimum that the optimal variant of saturation in the null space seeks, found by saturating and releasing unknowns.
//
// Level k, in the freedom Z (n, d) that earlier levels left, z = Z^T (x - x_{k-1}), reads V z = q + s p: p and q come from b_k and from
// A_k x_{k-1}, V (r, d) is an orthonormal basis of the rows that A_k has there. Wanted are the largest s in [0, 1] that the box allows
// and, at that s, the z whose x is nearest to zeta. `follow` moves along the curve of such nearest points while the right-hand side
// grows from what x_{k-1} makes of it to what the level asks for:
//
//     the unknown that reaches its bound first is saturated;
//     a saturated unknown whose multiplier changes its sign is released;
//     an unknown that reaches its bound where the level has no freedom left takes the place of a saturated one, chosen by the smallest
//     ratio of multipliers; where there is none, no point of the box goes any further.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "hqp_rp/saturation.hpp"

namespace hqp {
inline namespace HQP_ISA {

constexpr int saturation_rounds = 20;  // iterations allowed for each unknown

// Rows that are independent, as C = R^T Q with orthonormal rows Q: Gram and Schmidt, twice (Giraud, Langou and Rozloznik 2005).
struct OrthonormalRows {
  Matrix Q, R;  // (D, D), (D, D + 1)
  int D;
  double* v;

  // Adds g (D,) as row m; whether it is independent of those before it. R[., m] holds its coordinates in either case.
  bool append(const double* g, int m) {
    for (int j = 0; j < D; ++j) v[j] = g[j];
    for (int i = 0; i < m; ++i) R[i][m] = 0.0;
    for (int pass = 0; pass < 2; ++pass)
      for (int i = 0; i < m; ++i) {
        const double c = product(Q[i], v, D);
        R[i][m] += c;
        for (int j = 0; j < D; ++j) v[j] -= c * Q[i][j];
      }
    const double left = std::sqrt(product(v, v, D));
    if (m == D || !(left > tolerance::saturation_combination * std::sqrt(product(g, g, D)))) return false;
    R[m][m] = left;
    for (int j = 0; j < Q.stride; ++j) Q[m][j] = j < D ? v[j] / left : 0.0;
    return true;
  }
  // y with R[:m, :m]^T y = t.
  void forward(const double* t, int m, double* y) const {
    for (int i = 0; i < m; ++i) {
      double s = t[i];
      for (int l = 0; l < i; ++l) s -= R[l][i] * y[l];
      y[i] = s / R[i][i];
    }
  }
  // y with R[:m, :m] y = t; column: t is column m of R.
  void backward(const double* t, int m, double* y) const {
    for (int i = m - 1; i >= 0; --i) {
      double s = t ? t[i] : R[i][m];
      for (int l = i + 1; l < m; ++l) s -= R[i][l] * y[l];
      y[i] = s / R[i][i];
    }
  }
};

// The curve of nearest points z to `centre` over E z = e0 + t (e1 - e0), low <= G z <= high.
struct Following {
  Matrix E, G;  // (r, D), (n, D)
  int r, n, D;
  const double *low, *high, *centre;
  OrthonormalRows& rows;
  int* held;    // (n,)
  double* size;  // (n,)

  int factor(int count) {
    for (int i = 0; i < r; ++i) rows.append(E[i], i);
    for (int i = 0; i < count; ++i) rows.append(G[held[i]], r + i);
    return r + count;
  }
  int remove(int count, int i) {
    for (int l = i; l < count - 1; ++l) held[l] = held[l + 1];
    return count - 1;
  }

  // The first set of held rows: those with a side, as far as they are independent of E and of each other. A dependent row hands its
  // multiplier over to the others as far as their signs allow; the first that reaches zero is dropped.
  int kept_rows(int* side, double* mu, double* alpha) {
    int count = 0;
    for (int j = 0; j < n; ++j) {
      if (side[j] == 0) continue;
      const int m = factor(count);
      if (rows.append(G[j], m)) {
        held[count++] = j;
        continue;
      }
      rows.backward(nullptr, m, alpha);
      const double total = mu[j];
      double move = total;
      int out = -1;
      for (int i = 0; i < count; ++i) {
        const double a = alpha[r + i];
        if (side[held[i]] * total * a > 0.0 && std::fabs(a) > tolerance::saturation_combination) {  // mu_i + move a must keep its sign
          const double reach = -mu[held[i]] / a;
          if (std::fabs(reach) < std::fabs(move)) move = reach, out = i;
        }
      }
      for (int i = 0; i < count; ++i) mu[held[i]] += move * alpha[r + i];
      if (out < 0) {
        side[j] = 0;
        mu[j] = 0.0;
      } else {
        mu[j] = total - move;
        mu[held[out]] = 0.0;
        side[held[out]] = 0;
        count = remove(count, out);
        held[count++] = j;
      }
    }
    return count;
  }

  struct End {
    double t;  // < 1 where no point goes further, -1 where the iterations ran out
    int iterations;
  };
  // Moves z from t = 0 to t = 1; at t = 0 z is that point, `side` (+1 at high, -1 at low, 0 neither) and the multipliers `mu` fit it.
  End follow(const double* e0, const double* e1, int* side, double* mu, double* z, Workspace& workspace) {
    Workspace::Scope scope(workspace);
    double *target = workspace.numbers(D + n), *slope = workspace.numbers(D + n), *w = workspace.numbers(D + n), *dw = workspace.numbers(D + n);
    double *force = workspace.numbers(D + n), *dforce = workspace.numbers(D + n), *dz = workspace.numbers(D), *alpha = workspace.numbers(D + n);
    for (int j = 0; j < n; ++j) {
      size[j] = std::sqrt(product(G[j], G[j], D));
      if (size[j] <= tolerance::saturation_combination) side[j] = 0, mu[j] = 0.0;  // fixed by the levels before
    }
    int count = kept_rows(side, mu, alpha);
    for (int i = 0; i < D + n; ++i) slope[i] = i < r ? e1[i] - e0[i] : 0.0;
    double t = 0.0;
    for (int iteration = 0; iteration < saturation_rounds * (n + 1); ++iteration) {
      const int m = factor(count);
      for (int i = 0; i < r; ++i) target[i] = e0[i] + t * slope[i] - product(E[i], centre, D);
      for (int i = 0; i < count; ++i) {
        const int j = held[i];
        target[r + i] = (side[j] > 0 ? high[j] : low[j]) - product(G[j], centre, D);
      }
      rows.forward(target, m, w);
      rows.forward(slope, m, dw);
      for (int j = 0; j < D; ++j) {
        z[j] = centre[j], dz[j] = 0.0;
        for (int i = 0; i < m; ++i) z[j] += w[i] * rows.Q[i][j], dz[j] += dw[i] * rows.Q[i][j];
      }
      rows.backward(w, m, force);
      rows.backward(dw, m, dforce);
      const double way = std::sqrt(product(dz, dz, D));
      double step = 1.0 - t;
      int enter = -1, leave = -1;
      bool above = false;
      for (int j = 0; j < n; ++j) {
        if (side[j] != 0 || size[j] <= tolerance::saturation_combination) continue;
        const double dv = product(G[j], dz, D);
        if (std::fabs(dv) <= tolerance::saturation_still * size[j] * way) continue;
        const double reach = std::max(((dv > 0.0 ? high[j] : low[j]) - product(G[j], z, D)) / dv, 0.0);
        if (reach < step) step = reach, enter = j, above = dv > 0.0;
      }
      for (int i = 0; i < count; ++i) {
        const int s = side[held[i]];
        const double rise = s * dforce[r + i];
        if (rise <= 0.0) continue;
        const double reach = std::max(-s * force[r + i], 0.0) / rise;
        if (reach < step) step = reach, enter = -1, leave = i;
      }
      t += step;
      for (int j = 0; j < D; ++j) z[j] += step * dz[j];
      for (int i = 0; i < count; ++i) mu[held[i]] = force[r + i] + step * dforce[r + i];
      if (leave >= 0) {
        side[held[leave]] = 0;
        mu[held[leave]] = 0.0;
        count = remove(count, leave);
        continue;
      }
      if (enter < 0) return {1.0, iteration};
      if (!rows.append(G[enter], m)) {
        rows.backward(nullptr, m, alpha);
        int out = -1;
        double least = std::numeric_limits<double>::infinity();
        const double sign = above ? 1.0 : -1.0;
        for (int i = 0; i < count; ++i) {
          const int s = side[held[i]];
          const double a = s * sign * alpha[r + i];
          if (a <= tolerance::saturation_combination) continue;
          const double ratio = std::max(-s * mu[held[i]], 0.0) / a;
          if (ratio < least) least = ratio, out = i;
        }
        if (out < 0) return {t, iteration};
        for (int i = 0; i < count; ++i) mu[held[i]] += sign * least * alpha[r + i];
        mu[held[out]] = 0.0;
        side[held[out]] = 0;
        count = remove(count, out);
        mu[enter] = -sign * least;
      } else {
        mu[enter] = 0.0;
      }
      side[enter] = above ? 1 : -1;
      held[count++] = enter;
    }
    return {-1.0, saturation_rounds * (n + 1)};
  }
};

// One level at its largest scale and as near to zeta as that allows; J Z is factored in `split`. x (n,), `side` and `mu` are updated.
// Scale 0 with nothing changed where no scale is possible, -1 with nothing changed where the iterations ran out; not finite: overflow.
inline Executed optimal_level(const SaturationLevel& level, Split& split, const double* zeta, int* side, double* mu, double* x,
                              Workspace& workspace) {
  Workspace::Scope scope(workspace);
  const int n = level.n, d = level.d, rank = level.full, m = level.m, D = d + 1;
  Matrix E = make_matrix(workspace, rank, D), G = make_matrix(workspace, n + 1, D);
  OrthonormalRows rows{make_matrix(workspace, D + 1, D), make_matrix(workspace, D + n + 2, D + n + 2), d, workspace.numbers(D)};
  double *y = workspace.numbers(d), *p = workspace.numbers(rank), *q = workspace.numbers(rank), *end = workspace.numbers(rank);
  double *begin = workspace.numbers(rank), *centre = workspace.numbers(D), *below = workspace.numbers(n + 1), *above = workspace.numbers(n + 1);
  double *z = workspace.numbers(D), *force = workspace.numbers(n + 1), *made = workspace.numbers(m), *size = workspace.numbers(n + 1);
  int *held = workspace.counts(n + 1), *wide = workspace.counts(n + 1);
  for (int i = 0; i < rank; ++i)
    for (int j = 0; j < E.stride; ++j) E[i][j] = j < d ? split.Q[j][i] : 0.0;
  split.solve(level.t, y);
  for (int i = 0; i < rank; ++i) p[i] = product(E[i], y, d);
  for (int i = 0; i < m; ++i) made[i] = product(level.J[i], x, n);
  split.solve(made, y);
  for (int i = 0; i < rank; ++i) q[i] = -product(E[i], y, d);
  for (int j = 0; j < d; ++j) {
    centre[j] = z[j] = 0.0;
    for (int i = 0; i < n; ++i) centre[j] += level.Z[i][j] * (zeta[i] - x[i]);
  }
  for (int j = 0; j < n; ++j) {
    below[j] = level.low[j] - x[j];
    above[j] = level.high[j] - x[j];
    wide[j] = side[j];
    force[j] = mu[j];
    for (int l = 0; l < G.stride; ++l) G[j][l] = l < d ? level.Z[j][l] : 0.0;
  }
  for (int i = 0; i < rank; ++i) begin[i] = 0.0, end[i] = p[i] + q[i];
  Following curve{E, G, rank, n, d, below, above, centre, rows, held, size};
  Following::End found = curve.follow(begin, end, wide, force, z, workspace);
  int tried = found.iterations;
  double scale = 1.0;
  if (0.0 <= found.t && found.t < 1.0) {
    const double length = std::sqrt(product(p, p, rank));
    if (length == 0.0) return {true, 0.0, tried};
    if (std::sqrt(product(q, q, rank)) <= tolerance::saturation_slack * length) {
      scale = found.t;  // from A_k x_{k-1} = 0 the way to b_k is that of the scale itself
    } else {
      // The scale is one more unknown, sigma = s |p| in [0, |p|], drawn to |p|; then it is raised, all else in its wake.
      for (int i = 0; i < rank; ++i) E[i][d] = -p[i] / length;
      for (int j = 0; j < G.stride; ++j) G[n][j] = j == d ? 1.0 : 0.0;
      below[n] = 0.0, above[n] = length, centre[d] = length;
      for (int j = 0; j < n; ++j) wide[j] = side[j], force[j] = mu[j];
      wide[n] = 0, force[n] = 0.0;
      for (int j = 0; j < D; ++j) z[j] = 0.0;
      for (int i = 0; i < rank; ++i) begin[i] = -p[i], end[i] = q[i];
      rows.D = D;
      Following raised{E, G, rank, n + 1, D, below, above, centre, rows, held, size};
      found = raised.follow(begin, end, wide, force, z, workspace);
      tried += found.iterations;
      if (0.0 <= found.t && found.t < 1.0) return {true, 0.0, tried};
      scale = std::min(std::max(z[d] / length, 0.0), 1.0);
      if (found.t == 1.0 && scale < 1.0) {
        for (int i = 0; i < rank; ++i) E[i][d] = 0.0, begin[i] = q[i] + scale * p[i], end[i] = q[i] + p[i];
        rows.D = d;
        Following last{E, G, rank, n, d, below, above, centre, rows, held, size};
        found = last.follow(begin, end, wide, force, z, workspace);
        tried += found.iterations;
        scale += found.t * (1.0 - scale);
      }
    }
  }
  if (!finite(z, d)) return {false, 0.0, tried};
  if (found.t < 0.0) return {true, -1.0, tried};
  for (int j = 0; j < n; ++j) {
    side[j] = wide[j];
    mu[j] = force[j];
    x[j] = std::min(std::max(x[j] + product(level.Z[j], z, d), level.low[j]), level.high[j]);
  }
  return {true, scale, tried};
}

// x (n,) and the scale of each level, from zeta clipped to the box; N levels of equalities.
inline bool saturation_null_space(SaturationCall& call, Workspace& workspace) {
  Workspace::Scope scope(workspace);
  const Problem& problem = *call.problem;
  const int n = problem.unknowns, p = problem.levels, M = problem.rows;
  double* x = call.x;
  Matrix J = make_matrix(workspace, M + 1, n), Z = make_matrix(workspace, n, n), next = make_matrix(workspace, n, n);
  Matrix B = make_matrix(workspace, M + 1, n);
  double *rhs = workspace.numbers(M + 1), *made = workspace.numbers(M + 1), *mu = workspace.numbers(n), *off = workspace.numbers(M + 1);
  int *side = workspace.counts(n), *done = workspace.counts(p);
  double checked = 0.0;
  for (int k = 0; k < p; ++k) {
    const int r0 = static_cast<int>(problem.offsets[k]), m = static_cast<int>(problem.offsets[k + 1]) - r0;
    const Loaded loaded = load_level(problem.matrix + static_cast<std::ptrdiff_t>(r0) * n, M - r0, n, m, J.below(r0), J.stride);
    if (!loaded.finite) return false;
    for (int i = r0; i < r0 + m; ++i) {
      rhs[i] = problem.lower[i] * loaded.scale;
      checked += 0.0 * rhs[i];
    }
    done[k] = 0;
    call.scales[k] = 1.0;
  }
  if (checked != 0.0) return false;
  for (int j = 0; j < n; ++j) {
    x[j] = std::min(std::max(call.zeta[j], call.low[j]), call.high[j]);
    mu[j] = x[j] - call.zeta[j];
    side[j] = mu[j] < 0.0 ? 1 : mu[j] > 0.0 ? -1 : 0;
    for (int l = 0; l < Z.stride; ++l) Z[j][l] = j == l ? 1.0 : 0.0;
  }
  int d = n;
  const auto too_far = [&](int r0, int m, double miss) {
    double square = 0.0, target = 0.0;
    for (int i = r0; i < r0 + m; ++i) square += product(J[i], J[i], n), target += rhs[i] * rhs[i];
    return miss > tolerance::saturation_missed * (std::sqrt(square * product(x, x, n)) + std::sqrt(target));
  };
  for (int k = 0; k < p; ++k) {
    const int r0 = static_cast<int>(problem.offsets[k]), m = static_cast<int>(problem.offsets[k + 1]) - r0;
    if (m == 0 || d == 0) continue;
    Workspace::Scope level_scope(workspace);
    const double zero = call.rank_tolerance * spectral(J[r0], m, n, J.stride, workspace);
    Split split(m, d, workspace);
    times_columns(B, J.below(r0), Z, m, n, 0, d);
    split.factor(B, m, d, zero);
    const int full = split.rank;
    if (full == 0) continue;
    const SaturationLevel level{J.below(r0), rhs + r0, m, n, full, zero, Z, d, call.low, call.high};
    Executed executed{true, 0.0, 0};
    if (call.optimal && call.unfinished < 0) {
      executed = optimal_level(level, split, call.zeta, side, mu, x, workspace);
      call.tried += executed.tried;
      if (!executed.finite) return false;
      if (executed.scale < 0.0) call.unfinished = k;
    }
    if (!call.optimal || call.unfinished >= 0) {
      executed = basic_level(level, x, workspace);
      call.tried += executed.tried;
      if (!executed.finite) return false;
    }
    done[k] = executed.scale > 0.0;
    for (int i = 0; i < m; ++i) {
      made[r0 + i] = product(J[r0 + i], x, n);
      off[i] = made[r0 + i] - executed.scale * rhs[r0 + i];
    }
    if (done[k] && call.missed < 0 && too_far(r0, m, split.held(off))) call.missed = k;
    call.scales[k] = std::max(executed.scale, 0.0);
    times_columns(next, Z, split.Q, n, d, full, d - full);
    std::swap(Z, next);
    d -= full;
  }
  for (int k = 0; k < p; ++k) {
    if (!done[k] || (call.missed >= 0 && k >= call.missed)) continue;
    const int r0 = static_cast<int>(problem.offsets[k]), m = static_cast<int>(problem.offsets[k + 1]) - r0;
    double drift = 0.0;
    for (int i = r0; i < r0 + m; ++i) drift += (product(J[i], x, n) - made[i]) * (product(J[i], x, n) - made[i]);
    if (too_far(r0, m, std::sqrt(drift))) call.missed = k;
  }
  return finite(x, n);
}

}  // namespace HQP_ISA
}  // namespace hqp
