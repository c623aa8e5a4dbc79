// Null-space priority (9)-(11) on N levels as an orthogonal cascade.
//
// One working copy W of the stacked rows is turned by orthogonal transformations, W <- W Q, level by level, so that x = z + Q y.
// After level k its columns c0 ... c0 + rank - 1 span its row space within the freedom left to it, and the columns behind them are
// free for the levels below: the null-space basis is orthonormal to working precision by construction and is never formed.
// Source: the paper, (9)-(11); Siciliano and Slotine 1991; Escande, Mansard and Wieber 2014 for the factorization.
#pragma once

#include <algorithm>

#include "hqp_rp/least_squares.hpp"
#include "hqp_rp/load.hpp"
#include "hqp_rp/problem.hpp"

namespace hqp {
inline namespace HQP_ISA {

// x (unknowns,) <- z + sum_k Z_{k-1} (A_k Z_{k-1})^# (b_k - A_k x_{k-1}), b the lower bounds; z null means 0.
//
// Damping acts on the pseudo-inverse that gives a level's answer, never on the null space that the level leaves. The reflectors of
// finished levels reach a level when its turn comes: levels behind the last free direction need none.
template <class W>
inline Outcome null_space(const Problem& problem, const double* z, double rank_tolerance, const Damping& damping, double* x,
                          Workspace& workspace, W width) {
  Workspace::Scope scope(workspace);
  const int n = problem.unknowns;
  const int p = problem.levels;
  const int M = problem.rows;
  const std::int64_t* offsets = problem.offsets;
  int largest = 0;
  for (int k = 0; k < p; ++k) largest = std::max(largest, static_cast<int>(offsets[k + 1] - offsets[k]));
  Matrix A = make_matrix(workspace, largest, n);
  Matrix V = make_matrix(workspace, M, n);  // a level cut by the rank rule turns more often than it takes directions
  double* y = workspace.numbers(width);
  double* start = workspace.numbers(width);
  double* t = workspace.numbers(largest);
  double* answer = workspace.numbers(largest + n);
  double* lengths = workspace.numbers(2 * largest + n);
  int* first = workspace.counts(p + 1);   // reflectors of level k: first[k] ... first[k + 1] - 1
  int* column = workspace.counts(p + 1);  // free columns begin here when level k begins
  Turn* turns = reinterpret_cast<Turn*>(workspace.numbers(p * (sizeof(Turn) / sizeof(double) + 1)));
  fill(y, 0.0, width);
  if (z) load_row(start, z, n, 1, width);
  int c0 = 0;
  int done = 0;
  first[0] = 0;
  double checked = 0.0;
  for (int k = 0; k < p; ++k) {
    const int r0 = static_cast<int>(offsets[k]), r1 = static_cast<int>(offsets[k + 1]);
    const int m = r1 - r0;
    if (c0 == n) {  // nothing is free: what is left need only be finite
      for (std::int64_t i = static_cast<std::int64_t>(r0) * n; i < static_cast<std::int64_t>(M) * n; ++i) checked += 0.0 * problem.matrix[i];
      for (int i = r0; i < M; ++i) checked += 0.0 * problem.lower[i];
      break;
    }
    column[k] = c0;
    first[k + 1] = first[k];
    turns[k].r = 0;
    done = k + 1;
    if (m == 0) continue;
    const Loaded loaded = load_level(problem.matrix + static_cast<std::ptrdiff_t>(r0) * n, M - r0, n, m, A, width);
    if (!loaded.finite) return Outcome::not_finite;
    for (int i = 0; i < m; ++i) {
      t[i] = problem.lower[r0 + i] * loaded.scale;
      checked += 0.0 * t[i];
      if (z) t[i] -= dot(A[i], start, 0, width);
    }
    for (int before = 0; before < k; ++before) {
      reflect_rows_by_all(A, 0, m, V.below(first[before]), first[before + 1] - first[before], column[before], width);
      if (turns[before].r)
        for (int i = 0; i < m; ++i) turns[before].forward(A[i], answer);
    }
    if (c0)
      for (int i = 0; i < m; ++i) t[i] -= dot(A[i], y, 0, width);
    const Factored f = factor_level(A, 0, m, c0, n, t, loaded.norm, rank_tolerance, V.below(first[k]), lengths, width);
    first[k + 1] += f.reflectors;
    const int r = f.reflectors;
    if (r == 0) continue;
    if (f.proven && damping.kind == Damping::none) {
      level_least_squares(A, 0, m, c0, r, t, workspace);
      for (int j = 0; j < r; ++j) y[c0 + j] = t[j];
      c0 += r;
      continue;
    }
    const double zero =
        rank_tolerance * loaded.scale * spectral(problem.matrix + static_cast<std::ptrdiff_t>(r0) * n, m, n, n, workspace);
    const Damping scaled{damping.kind, damping.first, damping.second, loaded.scale};
    turns[k].V = make_matrix(workspace, r, r);
    const Decided decided = decide_level(A, 0, m, c0, r, n - c0, zero, t, scaled, turns[k], answer, workspace);
    for (int j = 0; j < decided.rank; ++j) y[c0 + j] = answer[j];
    c0 += decided.rank;
  }
  for (int k = done - 1; k >= 0; --k) {
    if (turns[k].r) turns[k].back(y, answer);
    apply_q(y, V.below(first[k]), first[k + 1] - first[k], column[k], width);
  }
  for (int j = 0; j < n; ++j) {
    const double value = z ? z[j] + y[j] : y[j];
    x[j] = value;
    checked += 0.0 * value;
  }
  return checked == 0.0 ? Outcome::solved : Outcome::not_finite;
}

}  // namespace HQP_ISA
}  // namespace hqp
