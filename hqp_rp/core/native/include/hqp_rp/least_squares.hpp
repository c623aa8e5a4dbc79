// Least squares with the factor of a level: its triangle, its tall part, or its singular values where they decide.
#pragma once

#include <algorithm>

#include "hqp_rp/lq.hpp"
#include "hqp_rp/svd.hpp"

namespace hqp {
inline namespace HQP_ISA {

// y (r,) <- the minimizer of ||C y - t|| for C^T (r, padded m) that `lq` factored as T, all r rows of it or the first `steps`, `order`
// saying which row stands where; right (padded m,) holds t padded with zeros, and is overwritten.
inline void tall_answer(Matrix T, Matrix V, int r, int steps, const double* order, double* right, double* y) {
  for (int j = 0; j < steps; ++j) reflect(right, V[j], j, T.stride);
  for (int j = r - 1; j >= 0; --j) {
    double s = j < steps ? right[j] : 0.0;
    for (int i = j + 1; i < steps; ++i) s -= T[i][j] * right[i];
    right[j] = j < steps ? s / T[j][j] : 0.0;
  }
  for (int j = 0; j < r; ++j) y[static_cast<int>(order[j])] = right[j];
}

// min ||C y - t|| for C (m, r) of full column rank, m >= r, given by T = C^T (r, padded m), overwritten; right (padded m,) holds t
// padded with zeros. y (r,) is written.
//
// QR with column pivoting is the row-pivoted LQ of the transpose; with rows sorted by falling size it is stable row by row (Cox and
// Higham 1998): rows of very different weight do not swamp each other.
inline void tall_least_squares(Matrix T, int r, int m, double* right, double* y, Workspace& workspace) {
  Workspace::Scope scope(workspace);
  double* order = workspace.numbers(r);
  double* lengths = workspace.numbers(2 * r);
  Matrix V = make_matrix(workspace, r, m);
  for (int j = 0; j < r; ++j) order[j] = j;
  const int steps = lq(T, 0, r, 0, m, order, 0.0, V, lengths, T.stride);
  tall_answer(T, V, r, steps, order, right, y);
}

// y (d,) <- the minimizer of ||C y - t||, C being rows r0 ... r0 + m - 1 of A from column c0 on, d <= m columns, where one QR proves
// that no singular value is <= tol * norm; A and t (m,) stay as they are. Where it does not, `proven` is false and y not written.
inline Factored tall_level(Matrix A, int r0, int m, int c0, int d, double norm, double tol, const double* t, double* y,
                           Workspace& workspace) {
  Workspace::Scope scope(workspace);
  Matrix T = make_matrix(workspace, d, m);
  Matrix V = make_matrix(workspace, d, m);
  double* right = workspace.numbers(T.stride);
  double* squares = workspace.numbers(m);
  double* order = workspace.numbers(d);
  double* lengths = workspace.numbers(2 * d);
  int* rows = workspace.counts(m);
  for (int i = 0; i < m; ++i) {
    squares[i] = square_from(A[r0 + i], c0, A.stride);
    rows[i] = i;
  }
  std::sort(rows, rows + m, [squares](int a, int b) { return squares[a] > squares[b] || (squares[a] == squares[b] && a < b); });
  for (int i = 0; i < T.stride; ++i) {
    if (i < m) {
      const double* from = A[r0 + rows[i]] + c0;
      for (int j = 0; j < d; ++j) T[j][i] = from[j];
      right[i] = t[rows[i]];
    } else {
      for (int j = 0; j < d; ++j) T[j][i] = 0.0;
      right[i] = 0.0;
    }
  }
  for (int j = 0; j < d; ++j) order[j] = j;
  Factored f = factor_level(T, 0, d, 0, m, order, norm, tol, V, lengths, T.stride);
  f.proven = f.proven && f.reflectors == d;
  if (f.proven) tall_answer(T, V, d, d, order, right, y);
  return f;
}

// t[:r] <- the y of min ||L y - t|| for the factor L (m, r) that `lq` left in rows r0 ... r0 + m - 1, of full column rank.
inline void level_least_squares(Matrix A, int r0, int m, int c0, int r, double* t, Workspace& workspace) {
  if (r == m) {
    for (int i = 0; i < r; ++i) {
      const double* row = A[r0 + i] + c0;
      double s = t[i];
      for (int l = 0; l < i; ++l) s -= row[l] * t[l];
      t[i] = s / row[i];
    }
    return;
  }
  if (r == 1) {
    double square = 0.0, product = 0.0;
    for (int i = 0; i < m; ++i) {
      const double a = A[r0 + i][c0];
      square += a * a;
      product += a * t[i];
    }
    t[0] = product / square;
    return;
  }
  Workspace::Scope scope(workspace);
  Matrix T = make_matrix(workspace, r, m);
  double* right = workspace.numbers(T.stride);
  double* y = workspace.numbers(r);
  for (int i = 0; i < T.stride; ++i) right[i] = i < m ? t[i] : 0.0;
  for (int j = 0; j < r; ++j)
    for (int i = 0; i < T.stride; ++i) T[j][i] = i >= j && i < m ? A[r0 + i][c0 + j] : 0.0;
  tall_least_squares(T, r, m, right, y, workspace);
  for (int j = 0; j < r; ++j) t[j] = y[j];
}

// Coordinates that a level's singular vectors took: columns c0 ... c0 + r - 1 times V, V[j] the j-th right singular vector.
struct Turn {
  Matrix V;
  int r = 0;
  int c0 = 0;

  // y <- V^T y, from the coordinates of the triangle to those of the singular vectors; `work` (r,).
  void forward(double* y, double* work) const {
    for (int j = 0; j < r; ++j) {
      double s = 0.0;
      for (int i = 0; i < r; ++i) s += V[j][i] * y[c0 + i];
      work[j] = s;
    }
    for (int j = 0; j < r; ++j) y[c0 + j] = work[j];
  }
  // y <- V y.
  void back(double* y, double* work) const {
    for (int i = 0; i < r; ++i) work[i] = 0.0;
    for (int j = 0; j < r; ++j)
      for (int i = 0; i < r; ++i) work[i] += V[j][i] * y[c0 + j];
    for (int i = 0; i < r; ++i) y[c0 + i] = work[i];
  }
};

struct Decided {
  int rank;
  double smallest;  // singular value that counts; 0 where one was cut
};

// What singular values decide where the triangle proves nothing: the rank by the library's rule and the level's damped answer.
//
// Rows r0 ... r0 + m - 1 of A hold L, as `lq` left it; singular values <= zero do not count. turn.V (r, r) <- right singular vectors;
// answer (r,) <- f(S) U^T t, in their coordinates, f the policy's; t (m,).
inline Decided decide_level(Matrix A, int r0, int m, int c0, int r, int free, double zero, const double* t, const Damping& damping,
                            Turn& turn, double* answer, Workspace& workspace) {
  Workspace::Scope scope(workspace);
  Matrix T = make_matrix(workspace, r, m);
  double* sigma = workspace.numbers(r);
  for (int j = 0; j < r; ++j)
    for (int i = 0; i < T.stride; ++i) T[j][i] = i >= j && i < m ? A[r0 + i][c0 + j] : 0.0;
  orthogonalize_rows(T, r, turn.V, sigma, T.stride);
  turn.r = r;
  turn.c0 = c0;
  int rank = 0;
  while (rank < r && sigma[rank] > zero) ++rank;
  const double factor = damping_factor(damping, sigma, r, r == std::min(m, free));
  const double cut = damping.kind == Damping::truncation ? damping.first * damping.unit : 0.0;
  for (int j = 0; j < r; ++j) answer[j] = 0.0;
  for (int j = 0; j < rank && sigma[j] > cut; ++j) {
    double s = 0.0;
    for (int i = 0; i < m; ++i) s += T[j][i] * t[i];
    const bool damped = damping.kind != Damping::filtering || j == r - 1;
    answer[j] = s / sigma[j] * damped_inverse(sigma[j], damped ? factor : 0.0);
  }
  return {rank, rank == r ? sigma[r - 1] : 0.0};
}

}  // namespace HQP_ISA
}  // namespace hqp
