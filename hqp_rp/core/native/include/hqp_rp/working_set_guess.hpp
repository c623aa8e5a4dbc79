// A guess of a level's working set, by a dual active-set method on the level made strictly convex:
//
//     min ||B s - t||^2 + weight^2 ||s_2||^2    subject to    low_i <= value_i + g_i s <= up_i   (kept rows),
//
// s_2 being the directions that B does not see. With B = [L 0] Q^T and L^T L = P P^T this is the least-distance problem min ||u||^2 in
// u = (P^T y_1 - q, weight y_2), s = Q y, whose dual needs the Gram matrix of the active rows alone: a row enters or leaves for
// O(rows * unknowns), where the exact search factors afresh. Nothing here has to be accurate: the exact search starts from the rows
// found and accepts nothing else than its own conditions of optimality.
// Source: Goldfarb and Idnani 1983; Arnstroem, Bemporad and Axehill 2022 (the dual in Gram form).
#pragma once

#include <algorithm>
#include <cmath>

#include "hqp_rp/working_set.hpp"

namespace hqp {
inline namespace HQP_ISA {

// Deletes row `at` of the Cholesky factor C of a Gram matrix of `count` rows.
inline void forget_row(double* C, int stride, int at, int count) {
  const auto entry = [&](int i, int j) -> double& { return C[static_cast<std::ptrdiff_t>(i) * stride + j]; };
  for (int i = at; i < count - 1; ++i)
    for (int j = 0; j < i + 2; ++j) entry(i, j) = entry(i + 1, j);
  for (int c = at; c < count - 1; ++c) {
    const double length = std::hypot(entry(c, c), entry(c, c + 1));
    const double cosine = entry(c, c) / length, sine = entry(c, c + 1) / length;
    for (int i = c; i < count - 1; ++i) {
      const double x = entry(i, c), y = entry(i, c + 1);
      entry(i, c) = cosine * x + sine * y;
      entry(i, c + 1) = cosine * y - sine * x;
    }
  }
}

// Active rows of min ||u||^2 subject to low <= value + G u <= up, G (K, d): fills `active` and `side` and returns how many there are.
// An inconsistent system ends with those that are active when that is found.
inline int least_distance(Matrix G, int K, int d, const double* value, const double* low, const double* up, int* active, int* side,
                          int limit, Workspace& workspace) {
  Workspace::Scope scope(workspace);
  const int most = K < d ? K : d;
  const int stride = most + 1;
  double* C = workspace.numbers(static_cast<std::size_t>(stride) * stride);
  double* square = workspace.numbers(K);
  double* multiplier = workspace.numbers(stride);
  double* l = workspace.numbers(stride);
  double* w = workspace.numbers(stride);
  double* u = workspace.numbers(G.stride);
  double* direction = workspace.numbers(G.stride);
  int* busy = workspace.counts(K);
  fill(u, 0.0, G.stride);
  for (int i = 0; i < K; ++i) {
    square[i] = square_from(G[i], 0, G.stride);
    busy[i] = square[i] == 0.0;
  }
  int count = 0;
  for (int round = 0; round < limit; ++round) {
    int p = -1;
    double worst = tolerance::guess_violated;
    for (int i = 0; i < K; ++i) {
      if (busy[i]) continue;
      const double h = value[i] + dot(G[i], u, 0, G.stride);
      const double over = std::max(h - up[i], low[i] - h) / std::sqrt(square[i]);
      if (over > worst) worst = over, p = i;
    }
    if (p < 0) break;
    const double sign = value[p] + dot(G[p], u, 0, G.stride) > up[p] ? 1.0 : -1.0;
    double own = 0.0;
    for (;;) {
      double delta = square[p];
      for (int i = 0; i < count; ++i) {
        double s = dot(G[active[i]], G[p], 0, G.stride);
        for (int j = 0; j < i; ++j) s -= C[i * stride + j] * l[j];
        l[i] = s / C[i * stride + i];
        delta -= l[i] * l[i];
      }
      for (int i = count - 1; i >= 0; --i) {
        double s = l[i];
        for (int j = i + 1; j < count; ++j) s -= C[j * stride + i] * w[j];
        w[i] = s / C[i * stride + i];
      }
      const double h = value[p] + dot(G[p], u, 0, G.stride);
      const double over = std::max(sign > 0.0 ? h - up[p] : low[p] - h, 0.0);
      const double whole = delta > tolerance::guess_dependent * square[p] && count < most ? over / delta : infinite;
      double part = infinite;
      int out = -1;
      for (int i = 0; i < count; ++i) {
        const double c = sign * w[i] * side[i];
        if (c > 0.0 && multiplier[i] * side[i] < part * c) part = multiplier[i] * side[i] / c, out = i;
      }
      const double tau = whole < part ? whole : part;
      if (!(tau < infinite)) return count;  // inconsistent, or a number overflowed
      copy(direction, G[p], G.stride);
      for (int i = 0; i < count; ++i) {
        multiplier[i] -= tau * sign * w[i];
        add_multiple(direction, G[active[i]], -w[i], 0, G.stride);
      }
      own += tau * sign;
      add_multiple(u, direction, -tau * sign, 0, G.stride);
      if (whole <= part) {
        for (int i = 0; i < count; ++i) C[count * stride + i] = l[i];
        C[count * stride + count] = std::sqrt(delta);
        active[count] = p;
        side[count] = sign > 0.0 ? 1 : -1;
        multiplier[count] = own;
        busy[p] = 1;
        ++count;
        break;
      }
      busy[active[out]] = 0;
      forget_row(C, stride, out, count);
      for (int i = out; i < count - 1; ++i) active[i] = active[i + 1], side[i] = side[i + 1], multiplier[i] = multiplier[i + 1];
      --count;
    }
  }
  return count;
}

// Puts into `guess` the side of every kept row that is likely to be active at the minimum of level r0 ... r1 - 1, 0 for others.
//
// All rows of the level must be equalities, and T up to date. d: the freedom, columns c0 ... c0 + d - 1. goal (padded n): where
// r0 == r1, what ||s - goal|| is minimized for.
template <class W>
inline void guess_working_set(WorkingRows<W>& rows, int r0, int r1, int c0, int d, const double* goal, Workspace& workspace) {
  Workspace::Scope scope(workspace);
  const int m = r1 - r0;
  int K = 0;
  for (int i = 0; i < r0; ++i) K += rows.state[i] == WorkingRows<W>::kept;
  if (K == 0) return;
  const int r_most = m < d ? m : d;
  Matrix T = make_matrix(workspace, m + K, rows.n);
  Matrix V = make_matrix(workspace, r_most + 1, rows.n);
  Matrix G = make_matrix(workspace, K, d);
  Matrix P = make_matrix(workspace, r_most + 1, r_most + 1);
  double* q = workspace.numbers(G.stride);
  double* target = workspace.numbers(m + K);
  double* lengths = workspace.numbers(2 * m + 2);
  double* bounds = workspace.numbers(3 * static_cast<std::size_t>(K));
  int* which = workspace.counts(K);
  int* active = workspace.counts(K);
  int* side = workspace.counts(K);
  K = 0;
  for (int i = 0; i < r0; ++i) {
    if (rows.state[i] != WorkingRows<W>::kept) continue;
    copy(T[m + K], rows.T[i], rows.width);
    which[K++] = i;
  }
  for (int i = 0; i < m; ++i) {
    copy(T[i], rows.T[r0 + i], rows.width);
    target[i] = rows.low[r0 + i] - rows.value[r0 + i];
  }
  fill(q, 0.0, G.stride);
  double scale = 1.0;
  int r = 0;
  if (m) {
    r = lq(T, 0, m, c0, rows.n, target, tolerance::guess_elimination * rows.level_norm(r0, r1), V, lengths, rows.width);
    reflect_rows_by_all(T, m, m + K, V, r, c0, rows.width);
    // L^T L = P P^T
    for (int i = 0; i < r; ++i) {
      for (int j = 0; j <= i; ++j) {
        double s = 0.0;
        for (int row = i; row < m; ++row) s += T[row][c0 + i] * T[row][c0 + j];
        for (int col = 0; col < j; ++col) s -= P[i][col] * P[j][col];
        P[i][j] = i > j ? s / P[j][j] : std::sqrt(s > 0.0 ? s : 0.0);
      }
      if (!(P[i][i] > 0.0)) {
        r = 0;
        break;
      }
    }
    scale = 1.0 / tolerance::guess_weight;
    for (int i = 0; i < r; ++i) {
      double s = 0.0;
      for (int row = i; row < m; ++row) s += T[row][c0 + i] * target[row];
      for (int j = 0; j < i; ++j) s -= P[i][j] * q[j];
      q[i] = s / P[i][i];
    }
  } else {
    for (int j = 0; j < d; ++j) q[j] = goal[c0 + j];
  }
  double *value = bounds, *low = bounds + K, *up = low + K;
  for (int i = 0; i < K; ++i) {
    for (int j = 0; j < d; ++j) {
      double s = T[m + i][c0 + j];
      if (j < r) {
        for (int col = 0; col < j; ++col) s -= P[j][col] * G[i][col];
        G[i][j] = s / P[j][j];
      } else {
        G[i][j] = s * scale;
      }
    }
    for (int j = d; j < G.stride; ++j) G[i][j] = 0.0;
    value[i] = rows.value[which[i]] + dot(G[i], q, 0, G.stride);
    low[i] = rows.low[which[i]];
    up[i] = rows.up[which[i]];
    rows.guess[which[i]] = 0;
  }
  const int count = least_distance(G, K, d, value, low, up, active, side, 3 * K + 20, workspace);
  for (int i = 0; i < count; ++i) rows.guess[which[active[i]]] = side[i];
}

}  // namespace HQP_ISA
}  // namespace hqp
