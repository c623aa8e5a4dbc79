// A QP's answer refined on its active rows: the least squares that the back end's choice of active rows stands for, solved exactly.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "hqp_rp/least_squares.hpp"

namespace hqp {
inline namespace HQP_ISA {

// min 1/2 ||M t - c||^2 + 1/2 ||s||^2 over t (n,) and the slacks s of the first `soft` rows, lower <= G t + [s; 0] <= upper.
struct SlackQP {
  int n = 0, curved = 0, m = 0, soft = 0;
  Matrix M;                // (curved, n)
  const double* c;         // (curved,)
  const double* G;         // (m, n), contiguous
  const double *lower, *upper;

  double value(int i, const double* t) const { return product(G + static_cast<std::ptrdiff_t>(i) * n, t, n); }
  double violation(int i, double v) const { return v > upper[i] ? v - upper[i] : v < lower[i] ? v - lower[i] : 0.0; }
  double objective(const double* t) const {
    double total = 0.0;
    for (int i = 0; i < curved; ++i) {
      double s = -c[i];
      for (int j = 0; j < n; ++j) s += M[i][j] * t[j];
      total += s * s;
    }
    for (int i = 0; i < soft; ++i) {
      const double v = violation(i, value(i, t));
      total += v * v;
    }
    return 0.5 * total;
  }
};

// t_new <- the least correction of t to min ||A t - b|| (rows, n) subject to E t = e (a, n), and the multipliers of E's rows; rows of E
// that depend on others get 0. Refined once.
inline void equality_answer(Matrix A, const double* b, int rows, Matrix E, const double* e, int a, int n, const double* t, double* t_new,
                            double* multipliers, Workspace& workspace) {
  Workspace::Scope scope(workspace);
  Matrix W = make_matrix(workspace, a + rows, n);
  Matrix V = make_matrix(workspace, a + rows, n);
  double* order = workspace.numbers(a + rows);
  double* lengths = workspace.numbers(2 * (a + rows) + n);
  double* step = workspace.numbers(W.stride);
  double* residual = workspace.numbers(a + rows);
  for (int i = 0; i < a + rows; ++i) {
    copy(W[i], i < a ? E[i] : A[i - a], W.stride);
    order[i] = i;
  }
  const int rE = lq(W, 0, a, 0, n, order, tolerance::polish_dependent, V, lengths, W.stride);
  reflect_rows_by_all(W, a, a + rows, V, rE, 0, W.stride);
  int r = 0;
  if (rows && rE < n) {
    double longest = 1.0;
    for (int i = 0; i < rows; ++i) longest = std::max(longest, std::sqrt(square_from(A[i], 0, A.stride)));
    r = lq(W, a, a + rows, rE, n, order, tolerance::polish_rank * longest, V.below(rE), lengths, W.stride);
  }
  for (int j = 0; j < n; ++j) t_new[j] = t[j];
  for (int pass = 0; pass < 2; ++pass) {  // the second one refines what the factorization lost
    fill(step, 0.0, W.stride);
    for (int i = 0; i < rE; ++i) {
      const int row = static_cast<int>(order[i]);
      double s = e[row];
      for (int j = 0; j < n; ++j) s -= E[row][j] * t_new[j];
      for (int j = 0; j < i; ++j) s -= W[i][j] * step[j];
      step[i] = s / W[i][i];
    }
    if (r) {
      for (int i = 0; i < rows; ++i) {
        const int row = static_cast<int>(order[a + i]) - a;
        double s = b[row];
        for (int j = 0; j < n; ++j) s -= A[row][j] * t_new[j];
        for (int j = 0; j < rE; ++j) s -= W[a + i][j] * step[j];
        residual[i] = s;
      }
      level_least_squares(W, a, rows, rE, r, residual, workspace);
      for (int j = 0; j < r; ++j) step[rE + j] = residual[j];
    }
    apply_q(step, V, rE + r, 0, W.stride);
    for (int j = 0; j < n; ++j) t_new[j] += step[j];
  }
  for (int i = 0; i < a; ++i) multipliers[i] = 0.0;
  if (!rE) return;
  fill(step, 0.0, W.stride);  // the gradient, then in the coordinates of the factor
  for (int i = 0; i < rows; ++i) {
    double s = -b[i];
    for (int j = 0; j < n; ++j) s += A[i][j] * t_new[j];
    add_multiple(step, A[i], s, 0, W.stride);
  }
  apply_q_transpose(step, V, rE, 0, W.stride);
  for (int i = rE - 1; i >= 0; --i) {
    double s = -step[i];
    for (int j = i + 1; j < rE; ++j) s -= W[j][i] * multipliers[static_cast<int>(order[j])];
    multipliers[static_cast<int>(order[i])] = s / W[i][i];
  }
}

// (t, y) <- the exact answer on the active rows that (t, y) points at, or (t, y) as it was where those are not the right ones.
//
// With hard rows at their bounds and soft rows violated, solves min ||M t - c||^2 + ||violated - bounds||^2 subject to the hard ones.
// Rows that turn out violated, or held by a multiplier of the wrong sign, change sides; after `passes` without agreement the answer
// stays. Source: solution polishing, Stellato, Banjac, Goulart, Bemporad and Boyd 2020, with changes of the set.
inline void polish(const SlackQP& qp, double* t, double* y, Workspace& workspace) {
  constexpr int passes = 12;
  Workspace::Scope scope(workspace);
  const int n = qp.n, m = qp.m;
  Matrix A = make_matrix(workspace, qp.curved + qp.soft, n);
  Matrix E = make_matrix(workspace, m - qp.soft, n);
  double* b = workspace.numbers(qp.curved + qp.soft);
  double* e = workspace.numbers(m);
  double* lengths = workspace.numbers(m);
  double* found = workspace.numbers(m);
  double* t_new = workspace.numbers(n);
  double* multipliers = workspace.numbers(m);
  int* side = workspace.counts(m);
  int* next = workspace.counts(m);
  int* seen = workspace.counts(static_cast<std::size_t>(passes) * m);
  const auto row = [&](Matrix to, int at, const double* from) {
    for (int j = 0; j < to.stride; ++j) to[at][j] = j < n ? from[j] : 0.0;
  };
  for (int i = 0; i < m; ++i) {
    lengths[i] = length_of(qp.G + static_cast<std::ptrdiff_t>(i) * n, n);
    const double signal = i < qp.soft ? qp.violation(i, qp.value(i, t)) : y[i];
    side[i] = signal > tolerance::polish_active && qp.upper[i] < tolerance::no_bound     ? 1
              : signal < -tolerance::polish_active && qp.lower[i] > -tolerance::no_bound ? -1 : 0;
  }
  for (int pass = 0; pass < passes; ++pass) {
    for (int old = 0; old < pass; ++old)
      if (std::equal(side, side + m, seen + static_cast<std::ptrdiff_t>(old) * m)) return;
    std::copy(side, side + m, seen + static_cast<std::ptrdiff_t>(pass) * m);
    int rows = 0, a = 0;
    for (; rows < qp.curved; ++rows) {
      copy(A[rows], qp.M[rows], A.stride);
      b[rows] = qp.c[rows];
    }
    for (int i = 0; i < m; ++i) {
      if (!side[i]) continue;
      const double bound = side[i] > 0 ? qp.upper[i] : qp.lower[i];
      const double* g = qp.G + static_cast<std::ptrdiff_t>(i) * n;
      if (i < qp.soft)
        row(A, rows, g), b[rows++] = bound;
      else
        row(E, a, g), e[a++] = bound;
    }
    equality_answer(A, b, rows, E, e, a, n, t, t_new, multipliers, workspace);
    double size = 0.0, largest = 0.0;
    for (int j = 0; j < n; ++j) {
      size += t_new[j] * t_new[j];
      largest = std::max(largest, std::fabs(t_new[j]));
    }
    size = std::sqrt(size);
    double missed = 0.0, least = std::numeric_limits<double>::infinity(), most_wrong = 0.0;
    int weakest = -1, wrong_hard = -1, hard = 0;
    bool missing_hard = false, changed = false;
    for (int i = 0; i < m; ++i) {
      next[i] = side[i];
      const double value = qp.value(i, t_new);
      const double rounding = tolerance::polish_feasible * (1.0 + std::fabs(value) + lengths[i] * size);
      found[i] = 0.0;
      if (!side[i]) {
        const double beyond = qp.violation(i, value);
        if (std::fabs(beyond) > rounding) {
          next[i] = beyond > 0.0 ? 1 : -1;
          changed = true;
          missing_hard = missing_hard || i >= qp.soft;
        }
        continue;
      }
      const double bound = side[i] > 0 ? qp.upper[i] : qp.lower[i];
      if (i < qp.soft) {
        found[i] = value - bound;
        if (found[i] * side[i] < -rounding) next[i] = 0, changed = true;
        continue;
      }
      found[i] = multipliers[hard++];
      missed = std::max(missed, std::fabs(value - bound));
      if (std::fabs(y[i]) < least) least = std::fabs(y[i]), weakest = i;
      if (found[i] * side[i] < -rounding) {
        changed = true;
        if (found[i] * side[i] < most_wrong) most_wrong = found[i] * side[i], wrong_hard = i;
      }
    }
    if (weakest >= 0 && missed > tolerance::polish_missed * (1.0 + largest)) {
      side[weakest] = 0;  // more rows than can be met at once: the one that mattered least to the back end goes
      continue;
    }
    if (!changed) {
      // On rows that are nearly dependent the factorization may run away: then the back end's answer is the better.
      const double before = qp.objective(t), after = qp.objective(t_new);
      if (after <= before + tolerance::polish_worse * (1.0 + before)) {
        std::copy(t_new, t_new + n, t);
        std::copy(found, found + m, y);
      }
      return;
    }
    // One at a time: letting several hard rows go at once may lose one that is needed.
    if (wrong_hard >= 0 && !missing_hard) next[wrong_hard] = 0;
    std::copy(next, next + m, side);
  }
}

}  // namespace HQP_ISA
}  // namespace hqp
