// Reverse priority (20)-(29) on N levels: lowest level first, each higher one corrected along T_k.
//
// For level k and the rows B = [J_{k+1}; ...; J_p] of all lower levels, T_k holds the first columns of [J_k; B]^+ (25), so that
// range(T_k) = { S^+ J_k^T mu } with S = J_k^T J_k + B^T B, and the step T_k (J_k T_k)^# r of (29) is the solution of
//
//     min ||B d||^2 + lambda^2 ||d||^2     subject to     J_k d = r (in the least-squares sense),  d of least norm,
//
// the correction that disturbs all lower levels least, jointly; lambda is the damping of the pseudo-inverse that gives T_k. That
// problem is what is factored here, J_k by orthogonal transformations, then the lower rows in the freedom that J_k leaves: no matrix
// is squared, and J_k d = r holds to rounding error at any condition.
//
// While the levels, from the last one up, are independent of all below, d disturbs nothing and lies in their null space: up to there
// the steps are those of the null-space cascade in reverse order, on one factorization.
// Source: the paper, (20)-(29); Flacco and De Luca 2014. The factorizations are ours.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "hqp_rp/least_squares.hpp"
#include "hqp_rp/load.hpp"
#include "hqp_rp/problem.hpp"

namespace hqp {
inline namespace HQP_ISA {

// The right singular vectors (rows of V, longest first) and values (n,) of `rows` rows of n columns, row i times weight[i].
inline void right_singular(Matrix A, int rows, int n, const double* weight, Matrix V, double* sigma, Workspace& workspace) {
  Workspace::Scope scope(workspace);
  Matrix T = make_matrix(workspace, n, rows);
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < T.stride; ++i) T[j][i] = i < rows ? A[i][j] * weight[i] : 0.0;
  orthogonalize_rows(T, n, V, sigma, T.stride);
  // The passes end with the longest first but for ties in the last one.
  for (int i = 1; i < n; ++i)
    for (int j = i; j > 0 && sigma[j] > sigma[j - 1]; --j) {
      std::swap(sigma[j], sigma[j - 1]);
      if (V.data) swap_rows(V[j], V[j - 1], V.stride);
    }
}

// order <- rows by falling weight, equal ones as they stand.
inline void by_weight(const double* weight, int count, int* order) {
  for (int i = 0; i < count; ++i) {
    int at = i;
    for (; at > 0 && weight[order[at - 1]] < weight[i]; --at) order[at] = order[at - 1];
    order[at] = i;
  }
}

// Completes y, whose first `rank` entries level k needs, by the w = y[rank:] of min ||D (B y)||^2 + lambda^2 ||w||^2, D the weights:
// B (below, n) turned already. False where it cannot be told that B has full column rank there: then w is not written.
inline bool tall_completion(Matrix B, int below, int n, int rank, const double* weight, double norm, double tol, double lambda,
                            double* y, Workspace& workspace) {
  Workspace::Scope scope(workspace);
  const int d = n - rank;
  const int extra = lambda > 0.0 ? d : 0;
  if (below + extra < d) return false;
  const int m = below + extra;
  TallSystem tall(d, m, workspace);
  const Matrix T = tall.T;
  int* order = workspace.counts(below);
  by_weight(weight, below, order);  // rows by falling size: the factorization is then stable row by row
  for (int i = 0; i < below; ++i) {
    const double* row = B[order[i]];
    const double w = weight[order[i]];
    double s = 0.0;
    for (int j = 0; j < rank; ++j) s -= row[j] * y[j];
    tall.right[i] = s * w;
    for (int j = 0; j < d; ++j) T[j][i] = row[rank + j] * w;
  }
  for (int i = below; i < T.stride; ++i) {
    tall.right[i] = 0.0;
    for (int j = 0; j < d; ++j) T[j][i] = i - below == j && extra ? lambda : 0.0;
  }
  if (extra)
    tall.factor();
  else if (!tall.factor(norm, tol).proven)
    return false;
  tall.solve(y + rank);
  return true;
}

// One step of (29): y (padded n) <- T_k (J_k T_k)^# t for rows R = [J_k (m, n); B (below, n)], which are overwritten; t (m,).
// weight (m + below,): what a row was multiplied by less than the largest level's. False for what is not finite.
template <class W>
inline void reverse_step(Matrix R, int m, int below, int n, const double* weight, const double* t, double tol, double lambda,
                         double* y, Workspace& workspace, W width) {
  Workspace::Scope scope(workspace);
  Matrix V = make_matrix(workspace, m + below, n);
  double* right = workspace.numbers(m + below);
  double* answer = workspace.numbers(m + below + n);
  double* lengths = workspace.numbers(2 * (m + below) + n);
  const double norm = frobenius(R, 0, m, width);
  const double low_norm = frobenius(R, m, m + below, width);
  for (int i = 0; i < m; ++i) right[i] = t[i];
  fill(y, 0.0, width);
  double unturned = 0.0;  // ||J_k||_2, where it is needed
  const Matrix copy_of = make_matrix(workspace, m, n);
  for (int i = 0; i < m; ++i) copy(copy_of[i], R[i], width);
  const Factored f = factor_level(R, 0, m, 0, n, right, norm, tol, V, lengths, width);
  const int r = f.reflectors;
  if (r == 0) return;
  reflect_rows_by_all(R, m, m + below, V, r, 0, width);
  Turn turn;
  int rank = r;
  if (f.proven) {
    level_least_squares(R, 0, m, 0, r, right, workspace);
    for (int j = 0; j < r; ++j) y[j] = right[j];
  } else {
    unturned = spectral(copy_of[0], m, n, copy_of.stride, workspace);
    turn.V = make_matrix(workspace, r, r);
    rank = decide_level(R, 0, m, 0, r, n, tol * unturned, right, Damping{}, turn, answer, workspace).rank;
    for (int j = 0; j < rank; ++j) y[j] = answer[j];
    for (int i = m; i < m + below; ++i) turn.forward(R[i], answer);
  }
  if (below && rank > 0 && rank < n &&
      !tall_completion(R.below(m), below, n, rank, weight + m, low_norm, tol, lambda, y, workspace)) {
    // Fewer rows than freedom, or a rank to be decided: the least-norm w of min ||D (B y)||, from an LQ of B first.
    Matrix B = R.below(m);
    double* origin = workspace.numbers(below);
    double* moved = workspace.numbers(below);
    double* low_t = workspace.numbers(below);
    Matrix V_low = make_matrix(workspace, below, n);
    Matrix before = make_matrix(workspace, below, n);
    for (int i = 0; i < below; ++i) {
      origin[i] = i;
      copy(before[i], B[i], width);
    }
    const Factored low = factor_level(B, 0, below, rank, n, origin, low_norm, tol, V_low, lengths, width);
    const int q = low.reflectors;
    for (int i = 0; i < below; ++i) {
      moved[i] = weight[m + static_cast<int>(origin[i])];
      double s = 0.0;
      for (int j = 0; j < rank; ++j) s -= B[i][j] * y[j];
      low_t[i] = s;
    }
    if (q) {
      Turn low_turn;
      Matrix L = make_matrix(workspace, q, below);  // L^T, then (U S)^T where singular values decide
      transpose_triangle(L, B, 0, below, rank, q);
      int low_rank = q;
      if (!low.proven) {
        double* sigma = workspace.numbers(q);
        low_turn.V = make_matrix(workspace, q, q);
        low_turn.r = q;
        low_turn.c0 = rank;
        orthogonalize_rows(L, q, low_turn.V, sigma, L.stride);
        const double zero = tol * spectral(before[0], below, n, before.stride, workspace);
        low_rank = count_above(sigma, q, zero);
      }
      if (low_rank == below && low.proven) {
        level_least_squares(B, 0, below, rank, q, low_t, workspace);
        for (int j = 0; j < q; ++j) y[rank + j] = low_t[j];
      } else if (low_rank) {
        int* order = workspace.counts(below);
        double* sorted = workspace.numbers(L.stride);
        by_weight(moved, below, order);
        Matrix T = make_matrix(workspace, low_rank, below);
        for (int i = 0; i < L.stride; ++i) {
          sorted[i] = i < below ? low_t[order[i]] * moved[order[i]] : 0.0;
          for (int j = 0; j < low_rank; ++j) T[j][i] = i < below ? L[j][order[i]] * moved[order[i]] : 0.0;
        }
        tall_least_squares(T, low_rank, below, sorted, y + rank, workspace);
      }
      if (low_turn.r) low_turn.back(y, answer);
      apply_q(y, V_low, q, rank, width);
    }
  }
  if (turn.r) turn.back(y, answer);
  apply_q(y, V, r, 0, width);
}

// Whether the leading n rows have nothing behind their diagonal.
template <class W>
HQP_INLINE bool is_lower_triangle(Matrix A, int n, W width) {
  for (int i = 0; i + 1 < n; ++i)
    if (square_from(A[i], i + 1, width) != 0.0) return false;
  return true;
}

// Lower rows B that determine everything and are well conditioned, as G (n, n) with (B^T B)^-1 = G G^T: the step of a level is then
// d = G (J G)^# t, the least ||B d||, by one small factorization.
struct LowerRows {
  Matrix G;
  double size = 0.0;  // a bound on ||G||_2

  // G <- L^-1 for the lower triangle L (n, n) of B; whether it is well conditioned.
  template <class W>
  bool invert(Matrix L, int n, W width) {
    double square = 0.0, inverse_square = 0.0;
    for (int i = 0; i < n; ++i) {
      const double* l = L[i];
      if (!(std::fabs(l[i]) > 0.0)) return false;
      const double pivot = 1.0 / l[i];
      double* row = G[i];
      fill(row, 0.0, width);
      row[i] = pivot;
      for (int j = 0; j < i; ++j) add_multiple(row, G[j], -l[j] * pivot, 0, width);
      square += square_from(l, 0, width);
      inverse_square += square_from(row, 0, width);
    }
    size = std::sqrt(inverse_square);
    return std::sqrt(square) * size < tolerance::well_conditioned;
  }

  // y += d for the rows J (m, n), which at y shall be rhs (m,); V (m, n) and C (m, n) are written for `append`. False where the rank
  // of J is not proven.
  template <class W>
  bool step(Matrix J, int m, int n, const double* rhs, double tol, double* y, Matrix C, Matrix V, Workspace& workspace, W width) const {
    Workspace::Scope scope(workspace);
    double* order = workspace.numbers(m);
    double* lengths = workspace.numbers(2 * m + n);
    double* u = workspace.numbers(width);
    const double J_norm = frobenius(J, 0, m, width);
    for (int i = 0; i < m; ++i) order[i] = i;
    multiply(C, J, G, m, n, width);
    // sigma_min(J) >= sigma_min(J G) / ||G||: the rank of J follows from the triangle of J G.
    const Factored f = factor_level(C, 0, m, 0, n, order, J_norm * size, tol, V, lengths, width);
    if (f.reflectors < m || !f.proven) return false;
    for (int pass = 0; pass < 3; ++pass) {
      fill(u, 0.0, width);
      double missed = 0.0;
      for (int i = 0; i < m; ++i) {
        const int row = static_cast<int>(order[i]);
        lengths[i] = rhs[row] - dot(J[row], y, 0, width);
        missed = std::max(missed, std::fabs(lengths[i]));
      }
      if (pass && missed <= 4.0 * tolerance::eps * J_norm * std::sqrt(square_from(y, 0, width))) break;
      for (int i = 0; i < m; ++i) {
        double v = lengths[i];
        for (int l = 0; l < i; ++l) v -= C[i][l] * u[l];
        u[i] = v / C[i][i];
      }
      apply_q(u, V, m, 0, width);
      for (int i = 0; i < n; ++i) lengths[i] = dot(G[i], u, 0, width);
      for (int i = 0; i < n; ++i) y[i] += lengths[i];
    }
    return true;
  }

  // The rows J are among what must not be disturbed from now on: with J G = [X 0] Q, (I + (J G)^T J G)^-1 is that of [X; I] in the
  // first m columns of G Q^T, which a QR of [X; I] gives.
  template <class W>
  void append(Matrix C, Matrix V, int m, int n, double weight, Workspace& workspace, W width) {
    Workspace::Scope scope(workspace);
    Matrix T = make_matrix(workspace, m, 2 * m);
    Matrix U = make_matrix(workspace, m, 2 * m);
    double* order = workspace.numbers(m);
    double* lengths = workspace.numbers(2 * m);
    for (int j = 0; j < m; ++j) {
      order[j] = j;
      for (int i = 0; i < T.stride; ++i) T[j][i] = i < m ? (i >= j ? C[i][j] * weight : 0.0) : i - m == j ? 1.0 : 0.0;
    }
    lq(T, 0, m, 0, 2 * m, order, 0.0, U, lengths, T.stride);
    reflect_rows_by_all(G, 0, n, V, m, 0, width);
    // x R = g for the first m entries of every row g of G, R = T^T: by K, row order[l] of which is column l of T^-1.
    Matrix inverse = make_matrix(workspace, m, m);
    Matrix K = make_matrix(workspace, m, m);
    for (int j = 0; j < m; ++j) {
      const double pivot = 1.0 / T[j][j];
      fill(inverse[j], 0.0, K.stride);
      inverse[j][j] = pivot;
      for (int l = 0; l < j; ++l) add_multiple(inverse[j], inverse[l], -T[j][l] * pivot, 0, K.stride);
    }
    for (int l = 0; l < m; ++l)
      for (int j = 0; j < K.stride; ++j) K[static_cast<int>(order[l])][j] = j < m ? inverse[j][l] : 0.0;
    Matrix product = make_matrix(workspace, n, m);
    multiply(product, G, K, n, m, K.stride);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < m; ++j) G[i][j] = product[i][j];
  }
};

// x (unknowns,) <- x + T_k (J_k T_k)^# (b_k - J_k x) for k = p, ..., 1, from x = z (null means 0): (29).
//
// Damping acts on the pseudo-inverse that gives T_k alone. Where a step cancels most of what lower levels had put into x, its residual
// is corrected once more.
template <class W>
inline Outcome reverse_priority(const Problem& problem, const double* z, double tol, const Damping& damping, double* x,
                                Workspace& workspace, W width) {
  Workspace::Scope scope(workspace);
  const int n = problem.unknowns, p = problem.levels, M = problem.rows;
  const std::int64_t* offsets = problem.offsets;
  Matrix A = make_matrix(workspace, M, n);  // loaded rows, each level of a norm in [1, 2)
  Matrix V = make_matrix(workspace, M, n);
  double* t = workspace.numbers(M);
  double* rhs = workspace.numbers(M);
  double* lengths = workspace.numbers(2 * M + padded(n));
  double* current = workspace.numbers(width);
  double* y = workspace.numbers(width);
  double* scale = workspace.numbers(p);
  double checked = 0.0;
  for (int k = 0; k < p; ++k) {
    const int r0 = static_cast<int>(offsets[k]), m = static_cast<int>(offsets[k + 1]) - r0;
    Loaded loaded = load_level(problem.matrix + static_cast<std::ptrdiff_t>(r0) * n, M - r0, n, m, A.below(r0), width);
    if (!loaded.finite) return Outcome::not_finite;
    scale[k] = loaded.scale;
    if (loaded.norm > 0.0) {
      int exponent = 0;
      std::frexp(loaded.norm, &exponent);
      const double more = std::ldexp(1.0, 1 - exponent);
      scale[k] *= more;
      for (int i = r0; i < r0 + m && more != 1.0; ++i) scale_row(A[i], more, width);
    }
    for (int i = r0; i < r0 + m; ++i) {
      rhs[i] = problem.lower[i] * scale[k];
      checked += 0.0 * rhs[i];
    }
  }
  if (z)
    load_row(current, z, n, 1, width);
  else
    fill(current, 0.0, width);

  int k = p - 1;
  int c0 = 0;
  if (damping.kind == Damping::none) {  // the cascade in reverse order, as far as levels are independent
    Matrix L = make_matrix(workspace, M, n);
    fill(y, 0.0, width);
    bool turned = false;
    for (; k >= 0; --k) {
      const int r0 = static_cast<int>(offsets[k]), m = static_cast<int>(offsets[k + 1]) - r0;
      if (m == 0) continue;
      if (m > n - c0) break;
      Matrix rows = L.below(c0);
      for (int i = 0; i < m; ++i) {
        copy(rows[i], A[r0 + i], width);
        t[i] = rhs[r0 + i];
        if (z) t[i] -= dot(A[r0 + i], current, 0, width);
      }
      const double norm = frobenius(rows, 0, m, width);
      if (c0 == 0 && m == n && is_lower_triangle(rows, n, width)) {  // a posture: nothing to turn
        if (!(tol * norm * inverse_norm(rows, 0, 0, n, lengths) < 1.0)) break;
        level_least_squares(rows, 0, n, 0, n, t, workspace);
        for (int j = 0; j < n; ++j) y[j] = t[j];
        c0 = n;
        continue;
      }
      reflect_rows_by_all(rows, 0, m, V, c0, 0, width);
      if (c0)
        for (int i = 0; i < m; ++i) t[i] -= dot(rows[i], y, 0, width);
      const Factored f = factor_level(rows, 0, m, c0, n, t, norm, tol, V.below(c0), lengths, width);
      if (f.reflectors < m || !f.proven) break;
      level_least_squares(rows, 0, m, c0, m, t, workspace);
      for (int j = 0; j < m; ++j) y[c0 + j] = t[j];
      c0 += m;
      turned = true;
    }
    if (c0 == n && k >= 0) {  // lower levels determine all that higher ones may disturb
      double unit = std::numeric_limits<double>::infinity();  // rows weigh as they were given
      for (int i = 0; i < p; ++i) unit = std::min(unit, scale[i]);
      for (int i = p - 1, row = 0; i > k; --i)
        for (std::int64_t end = row + offsets[i + 1] - offsets[i]; row < end; ++row)
          if (scale[i] != unit) scale_row(L[row], unit / scale[i], width);
      LowerRows lower{make_matrix(workspace, n, n)};
      Matrix J = make_matrix(workspace, n, n), C = make_matrix(workspace, n, n), own = make_matrix(workspace, n, n);
      for (bool serves = lower.invert(L, n, width); serves && k >= 0; --k) {
        const int r0 = static_cast<int>(offsets[k]), m = static_cast<int>(offsets[k + 1]) - r0;
        if (m == 0) continue;
        if (m > n) break;
        for (int i = 0; i < m; ++i) {
          copy(J[i], A[r0 + i], width);
          t[i] = rhs[r0 + i];
          if (z) t[i] -= dot(A[r0 + i], current, 0, width);
        }
        if (turned) reflect_rows_by_all(J, 0, m, V, n, 0, width);
        if (!lower.step(J, m, n, t, tol, y, C, own, workspace, width)) break;
        if (k) lower.append(C, own, m, n, unit / scale[k], workspace, width);
      }
    }
    if (turned) apply_q(y, V, c0, 0, width);
    for (int j = 0; j < width; j += lanes) (Lane::load(current + j) + Lane::load(y + j)).store(current + j);
  }

  double* weight = workspace.numbers(M);
  Matrix R = make_matrix(workspace, M, n);
  for (; k >= 0; --k) {
    const int r0 = static_cast<int>(offsets[k]), m = static_cast<int>(offsets[k + 1]) - r0;
    const int rows = M - r0;
    if (m == 0) continue;
    double unit = std::numeric_limits<double>::infinity();  // of the largest level, whose rows weigh 1
    for (int i = k; i < p; ++i) unit = std::min(unit, scale[i]);
    for (int i = k; i < p; ++i)
      for (std::int64_t row = offsets[i]; row < offsets[i + 1]; ++row)
        weight[row - r0] = std::max(unit / scale[i], 1.0 / tolerance::largest_ratio);
    const Damping scaled{damping.kind, damping.first, damping.second, unit};
    double lambda = damping_factor(scaled, nullptr, 0, true);
    Matrix span;
    int kept = n;
    if (damping.kind != Damping::constant && damping.kind != Damping::none) {
      double* sigma = workspace.numbers(n);
      span = make_matrix(workspace, n, n);
      right_singular(A.below(r0), rows, n, weight, span, sigma, workspace);
      if (damping.kind == Damping::truncation) {
        for (kept = 0; kept < n && sigma[kept] > damping.first * unit;) ++kept;
        if (kept == 0) continue;
      } else {
        lambda = damping_factor(scaled, sigma, std::min(rows, n), true);
      }
    }
    for (int pass = 0; pass < 2; ++pass) {
      for (int i = 0; i < rows; ++i) {
        if (kept == n) {
          copy(R[i], A[r0 + i], width);
        } else {
          fill(R[i], 0.0, width);
          for (int j = 0; j < kept; ++j) R[i][j] = dot(A[r0 + i], span[j], 0, width);
        }
      }
      for (int i = 0; i < m; ++i) t[i] = rhs[r0 + i] - dot(A[r0 + i], current, 0, width);
      reverse_step(R, m, rows - m, kept, weight, t, tol, lambda, y, workspace, width);
      if (kept < n) {
        double* whole = R[0];
        fill(whole, 0.0, width);
        for (int j = 0; j < kept; ++j) add_multiple(whole, span[j], y[j], 0, width);
        copy(y, whole, width);
      }
      double before = 0.0, after = 0.0;
      for (int j = 0; j < n; ++j) {
        before = std::max(before, std::fabs(current[j]));
        current[j] += y[j];
        after = std::max(after, std::fabs(current[j]));
      }
      if (!(before > tolerance::cancellation * after)) break;
    }
  }
  for (int j = 0; j < n; ++j) {
    x[j] = current[j];
    checked += 0.0 * x[j];
  }
  return checked == 0.0 ? Outcome::solved : Outcome::not_finite;
}

}  // namespace HQP_ISA
}  // namespace hqp
