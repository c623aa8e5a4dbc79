// Saturation in the null space (SNS) on N levels, with orthonormal null-space bases in the place of projectors.
//
// Level k, in the freedom Z that earlier levels left, with the saturated unknowns S held at their bounds:
//
//     x~   = x_{k-1} + Z Z_S^# (bound_S - x_{k-1,S})            moves S to its bounds
//     x(s) = x~ + Z V (J_k Z V)^# (s b_k - J_k x~) = b + s a    V a basis of the null space of Z_S
//
// Where s = 1 leaves the box, the unknown that allows the least scale s is saturated next, until the level would lose rank; then the
// largest scale that was found is taken. The optimal variant follows the nearest points to zeta instead (saturation_optimal.hpp).
// Source: Flacco, De Luca and Khatib 2012, 2015.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "hqp_rp/least_squares.hpp"
#include "hqp_rp/kernels.hpp"
#include "hqp_rp/load.hpp"
#include "hqp_rp/problem.hpp"

namespace hqp {
inline namespace HQP_ISA {

// B (m, d) = [L 0] Q^T with an orthogonal Q (d, d): least squares and the null space of B, its rank by an absolute `zero`.
class Split {
 public:
  Split(int most_rows, int most_columns, Workspace& workspace)
      : workspace_(workspace), work_(make_matrix(workspace, most_rows + 1, most_columns)), V_(make_matrix(workspace, most_rows + 1, most_columns)),
        T_(make_matrix(workspace, std::min(most_rows, most_columns) + 1, most_rows)),
        turn_V_(make_matrix(workspace, std::min(most_rows, most_columns) + 1, std::min(most_rows, most_columns) + 1)),
        order_(workspace.numbers(most_rows + 1)), lengths_(workspace.numbers(2 * (most_rows + most_columns) + 2)),
        sigma_(workspace.numbers(std::min(most_rows, most_columns) + 1)), right_(workspace.numbers(padded(most_rows) + most_columns)),
        Q(make_matrix(workspace, most_columns + 1, most_columns)) {}

  // Singular values <= zero do not count.
  void factor(Matrix B, int m, int d, double zero) {
    m_ = m, d_ = d;
    for (int i = 0; i < m; ++i) {
      for (int j = 0; j < work_.stride; ++j) work_[i][j] = j < d ? B[i][j] : 0.0;
      order_[i] = i;
    }
    for (int i = 0; i < d; ++i)
      for (int j = 0; j < Q.stride; ++j) Q[i][j] = i == j ? 1.0 : 0.0;
    const double norm = frobenius(work_, 0, m, work_.stride);
    rank = r_ = norm > 0.0 ? lq(work_, 0, m, 0, d, order_, std::min(tolerance::elimination * norm, zero / std::sqrt(static_cast<double>(std::max(1, std::min(m, d))))),
                                V_, lengths_, work_.stride)
                           : 0;
    reflect_rows_by_all(Q, 0, d, V_, r_, 0, Q.stride);
    singular_ = r_ > 0 && !(zero * inverse_norm(work_, 0, 0, r_, lengths_) < 1.0);
    if (!singular_) return;
    transpose_triangle(T_, work_, 0, m, 0, r_);
    orthogonalize_rows(T_, r_, turn_V_, sigma_, T_.stride);
    Turn turn{turn_V_, r_, 0};
    for (int i = 0; i < d; ++i) turn.forward(Q[i], lengths_);
    rank = count_above(sigma_, r_, zero);
  }

  // y (d,) <- the least-norm minimizer of ||B y - t||, t (m,).
  void solve(const double* t, double* y) {
    double* w = right_ + padded(m_);
    if (singular_) {
      for (int j = 0; j < rank; ++j) {
        double s = 0.0;
        for (int i = 0; i < m_; ++i) s += T_[j][i] * t[static_cast<int>(order_[i])];
        w[j] = s / (sigma_[j] * sigma_[j]);
      }
    } else if (rank) {
      for (int i = 0; i < m_; ++i) right_[i] = t[static_cast<int>(order_[i])];
      level_least_squares(work_, 0, m_, 0, rank, right_, workspace_);
      for (int j = 0; j < rank; ++j) w[j] = right_[j];
    }
    for (int i = 0; i < d_; ++i) {
      double s = 0.0;
      for (int j = 0; j < rank; ++j) s += Q[i][j] * w[j];
      y[i] = s;
    }
  }

  // The part of v (m,) that the column space of B holds, as a length.
  double held(const double* v) {
    if (!rank) return 0.0;
    if (singular_) {
      double total = 0.0;
      for (int j = 0; j < rank; ++j) {
        double s = 0.0;
        for (int i = 0; i < m_; ++i) s += T_[j][i] / sigma_[j] * v[static_cast<int>(order_[i])];
        total += s * s;
      }
      return std::sqrt(total);
    }
    // The projection of v is L y with y its least squares.
    for (int i = 0; i < m_; ++i) right_[i] = v[static_cast<int>(order_[i])];
    level_least_squares(work_, 0, m_, 0, rank, right_, workspace_);
    double total = 0.0;
    for (int i = 0; i < m_; ++i) {
      double s = 0.0;
      for (int j = 0; j < std::min(i + 1, rank); ++j) s += work_[i][j] * right_[j];
      total += s * s;
    }
    return std::sqrt(total);
  }

 private:
  Workspace& workspace_;
  Matrix work_, V_, T_, turn_V_;
  double *order_, *lengths_, *sigma_, *right_;
  int m_ = 0, d_ = 0, r_ = 0;
  bool singular_ = false;

 public:
  Matrix Q;      // (d, d): the first `rank` columns span the rows of B, the others its null space
  int rank = 0;
};

// C (rows, columns) <- A (rows, inner) times columns first ... first + columns - 1 of B; plain, for the small matrices here.
inline void times_columns(Matrix C, Matrix A, Matrix B, int rows, int inner, int first, int columns) {
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < C.stride; ++j) C[i][j] = 0.0;
    for (int l = 0; l < inner; ++l)
      for (int j = 0; j < columns; ++j) C[i][j] += A[i][l] * B[l][first + j];
  }
}

// How far v is outside [low, high] beyond rounding; 0 inside.
inline double outside(double v, double low, double high) {
  const double miss = std::max(low - v, v - high);
  return miss > tolerance::saturation_slack * (tolerance::smallest_unknown + std::fabs(v)) ? miss : 0.0;
}

struct ScaleRange {
  double least = -std::numeric_limits<double>::infinity(), most = std::numeric_limits<double>::infinity();
  int above = -1, below = -1;  // the first to block from above, from below
};

// The s for which b + s a is inside the box, held unknowns left aside.
inline ScaleRange scale_range(const double* a, const double* b, const double* low, const double* high, const int* held, int n) {
  ScaleRange range;
  for (int j = 0; j < n; ++j) {
    if (held[j]) continue;
    if (std::fabs(a[j]) <= tolerance::no_slope) {
      if (outside(b[j], low[j], high[j]) > 0.0)
        return {std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity(), j, j};
      continue;
    }
    double s0 = (low[j] - b[j]) / a[j], s1 = (high[j] - b[j]) / a[j];
    if (s0 > s1) std::swap(s0, s1);
    if (s1 < range.most) range.most = s1, range.above = j;
    if (s0 > range.least) range.least = s0, range.below = j;
  }
  return range;
}

// What one level of saturation works on: x (n,) so far, its freedom Z (n, d), and the box.
struct SaturationLevel {
  Matrix J;          // (m, n)
  const double* t;   // (m,)
  int m, n, full;    // full: the level's rank in Z
  double zero;
  Matrix Z;
  int d;
  const double *low, *high;
};

struct Executed {
  bool finite;
  double scale;  // negative, and x unchanged, where none was found
  int tried;
};

// One level as the basic algorithm executes it; x (n,) is updated.
inline Executed basic_level(const SaturationLevel& level, double* x, Workspace& workspace) {
  Workspace::Scope scope(workspace);
  const int n = level.n, m = level.m, d = level.d;
  Split of_held(n, d, workspace), of_level(m, d, workspace);
  Matrix rows = make_matrix(workspace, n, d), basis = make_matrix(workspace, n, d), B = make_matrix(workspace, m, d);
  double *start = workspace.numbers(n), *gap = workspace.numbers(n), *y = workspace.numbers(d), *a = workspace.numbers(n);
  double *b = workspace.numbers(n), *answer = workspace.numbers(n), *bound = workspace.numbers(n), *made = workspace.numbers(m);
  int *held = workspace.counts(n), *which = workspace.counts(n);
  for (int j = 0; j < n; ++j) held[j] = 0, answer[j] = x[j];
  int count = 0, tried = 0;
  double best = -1.0;
  for (;;) {
    int free = d;
    for (int j = 0; j < n; ++j) start[j] = x[j];
    if (count) {
      for (int i = 0; i < count; ++i) {
        copy(rows[i], level.Z[which[i]], rows.stride);
        gap[i] = bound[i] - x[which[i]];
      }
      of_held.factor(rows, count, d, tolerance::saturation_dependent);
      if (of_held.rank < count) break;  // the last unknown cannot be brought to its bound beside the others
      of_held.solve(gap, y);
      for (int j = 0; j < n; ++j) start[j] += product(level.Z[j], y, d);
      free = d - of_held.rank;
      if (!free) break;
      times_columns(basis, level.Z, of_held.Q, n, d, of_held.rank, free);
    } else {
      for (int j = 0; j < n; ++j) copy(basis[j], level.Z[j], basis.stride);
    }
    times_columns(B, level.J, basis, m, n, 0, free);
    of_level.factor(B, m, free, level.zero);
    if (of_level.rank < level.full) break;
    of_level.solve(level.t, y);
    for (int j = 0; j < n; ++j) a[j] = product(basis[j], y, free);
    for (int i = 0; i < m; ++i) made[i] = product(level.J[i], start, n);
    of_level.solve(made, y);
    for (int j = 0; j < n; ++j) b[j] = start[j] - product(basis[j], y, free);
    if (!finite(a, n) || !finite(b, n)) return {false, best, tried};
    bool inside = true;
    for (int j = 0; j < n; ++j) inside = inside && (held[j] || outside(a[j] + b[j], level.low[j], level.high[j]) == 0.0);
    if (inside) {
      best = 1.0;
      for (int j = 0; j < n; ++j) answer[j] = a[j] + b[j];
      break;
    }
    const ScaleRange range = scale_range(a, b, level.low, level.high, held, n);
    if (range.least <= range.most && range.most >= 0.0 && range.least <= 1.0 && std::min(range.most, 1.0) > best) {
      best = std::min(range.most, 1.0);
      for (int j = 0; j < n; ++j) answer[j] = b[j] + best * a[j];
    }
    const int critical = range.most < 1.0 ? range.above : range.below;
    if (critical < 0 || count == n) break;
    const double value = a[critical] + b[critical];
    if (outside(value, level.low[critical], level.high[critical]) == 0.0) break;  // only rounding is left
    which[count] = critical;
    bound[count++] = value > level.high[critical] ? level.high[critical] : level.low[critical];
    held[critical] = 1;
    ++tried;
  }
  for (int j = 0; j < n; ++j) x[j] = std::min(std::max(answer[j], level.low[j]), level.high[j]);
  return {true, best, tried};
}

}  // namespace HQP_ISA
}  // namespace hqp
