// Least squares with the factor of a level: its triangle, its tall part, or its singular values where they decide.
#pragma once

#include <algorithm>

#include "hqp_rp/lq.hpp"
#include "hqp_rp/svd.hpp"

namespace hqp {
inline namespace HQP_ISA {

// min ||C y - t|| for C (m, r), m >= r, by QR with column pivoting, the row-pivoted LQ of the transpose. With rows sorted by falling
// size it is stable row by row (Cox and Higham 1998): rows of very different weight do not swamp each other.
struct TallSystem {
  int r, m;
  Matrix T;           // (r, m padded): C^T, then its triangle
  Matrix V;           // (r, m padded): its reflectors
  double* right;      // (m padded,): t padded with zeros; `solve` leaves Q^T t behind the triangle, y before it in the triangle's order
  double* order;      // (r,): which unknown stands where
  double* lengths;    // (2 r,)
  int reflectors = 0;

  TallSystem(int r_, int m_, Matrix T_, double* right_, Workspace& workspace)
      : r(r_), m(m_), T(T_), V(make_matrix(workspace, r, m)), right(right_), order(workspace.numbers(r)), lengths(workspace.numbers(2 * r)) {
    for (int j = 0; j < r; ++j) order[j] = j;
  }
  TallSystem(int r_, int m_, Workspace& workspace)
      : TallSystem(r_, m_, make_matrix(workspace, r_, m_), workspace.numbers(padded(m_)), workspace) {}

  // C and t <- rows `rows` (m,) of A from column c0 on, and those of `target`.
  void load(Matrix A, const int* rows, int c0, const double* target) {
    for (int i = 0; i < T.stride; ++i) {
      if (i < m) {
        const double* from = A[rows[i]] + c0;
        for (int j = 0; j < r; ++j) T[j][i] = from[j];
        right[i] = target[rows[i]];
      } else {
        for (int j = 0; j < r; ++j) T[j][i] = 0.0;
        right[i] = 0.0;
      }
    }
  }
  // C (m, r) <- L, which `lq` left in rows r0 ... r0 + m - 1 of A from column c0 on; t <- target (m,).
  void load_triangle(Matrix A, int r0, int c0, const double* target) {
    transpose_triangle(T, A, r0, m, c0, r);
    for (int i = 0; i < T.stride; ++i) right[i] = i < m ? target[i] : 0.0;
  }
  void factor() { reflectors = lq(T, 0, r, 0, m, order, 0.0, V, lengths, T.stride); }
  // Proven: C has full column rank, no singular value being <= tol * norm.
  Factored factor(double norm, double tol) {
    Factored f = factor_level(T, 0, r, 0, m, order, norm, tol, V, lengths, T.stride);
    reflectors = f.reflectors;
    f.proven = f.proven && f.reflectors == r;
    return f;
  }
  // v (m padded,) <- Q^T v, the triangle being Q^T C.
  void turn(double* v) const { apply_q_transpose(v, V, reflectors, 0, T.stride); }
  // y (r,) <- the minimizer; 0 for unknowns that stand behind the triangle.
  void solve(double* y) {
    turn(right);
    for (int j = reflectors - 1; j >= 0; --j) {
      double s = right[j];
      for (int i = j + 1; i < reflectors; ++i) s -= T[i][j] * right[i];
      right[j] = s / T[j][j];
    }
    for (int j = 0; j < r; ++j) y[static_cast<int>(order[j])] = j < reflectors ? right[j] : 0.0;
  }
};

// min ||C y - t|| for C (m, r) of full column rank, m >= r, given by T = C^T (r, m padded), overwritten; right (m padded,) holds t
// padded with zeros. y (r,) is written.
inline void tall_least_squares(Matrix T, int r, int m, double* right, double* y, Workspace& workspace) {
  Workspace::Scope scope(workspace);
  TallSystem tall(r, m, T, right, workspace);
  tall.factor();
  tall.solve(y);
}

// y (d,) <- the minimizer of ||C y - t||, C being rows r0 ... r0 + m - 1 of A from column c0 on, d <= m columns, where one QR proves
// that no singular value is <= tol * norm; A and t (m,) stay as they are. Where it does not, `proven` is false and y not written.
inline Factored tall_level(Matrix A, int r0, int m, int c0, int d, double norm, double tol, const double* t, double* y,
                           Workspace& workspace) {
  Workspace::Scope scope(workspace);
  TallSystem tall(d, m, workspace);
  double* squares = workspace.numbers(m);
  int* rows = workspace.counts(m);
  for (int i = 0; i < m; ++i) {
    squares[i] = square_from(A[r0 + i], c0, A.stride);
    rows[i] = i;
  }
  std::sort(rows, rows + m, [squares](int a, int b) { return squares[a] > squares[b] || (squares[a] == squares[b] && a < b); });
  tall.load(A.below(r0), rows, c0, t);
  const Factored f = tall.factor(norm, tol);
  if (f.proven) tall.solve(y);
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
  TallSystem tall(r, m, workspace);
  double* y = workspace.numbers(r);
  tall.load_triangle(A, r0, c0, t);
  tall.factor();
  tall.solve(y);
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
  transpose_triangle(T, A, r0, m, c0, r);
  orthogonalize_rows(T, r, turn.V, sigma, T.stride);
  turn.r = r;
  turn.c0 = c0;
  const int rank = count_above(sigma, r, zero);
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
