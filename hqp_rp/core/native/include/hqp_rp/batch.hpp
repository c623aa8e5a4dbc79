// Many problems of one shape: eight side by side where the ranks can be proven full, one by one where not.
//
// Side by side, entry (i, j) of eight problems stands in one lane, so that every operation of the cascade is one vector operation. It
// factors without pivoting; a problem whose triangles do not prove that it is far from a singularity, or whose numbers are not
// finite or of unusual size, is left to the one-by-one form: answers obey the same rank rule.
#pragma once

#include <cmath>
#include <limits>

#include "hqp_rp/lq.hpp"
#include "hqp_rp/problem.hpp"

namespace hqp {
inline namespace HQP_ISA {

template <class Function>
HQP_INLINE Lane each(Lane a, Function function) {
  alignas(64) double v[lanes];
  a.store(v);
  for (int i = 0; i < lanes; ++i) v[i] = function(v[i]);
  return Lane::load(v);
}
HQP_INLINE Lane root(Lane a) { return each(a, [](double v) { return std::sqrt(v); }); }
HQP_INLINE Lane size(Lane a) { return each(a, [](double v) { return std::fabs(v); }); }

// Of eight Householder reflectors: beta = -sign(alpha) norm, and what their rows are multiplied by so that ||v||^2 = 2.
struct EightReflectors {
  Lane beta, scale;

  HQP_INLINE EightReflectors(Lane alpha, Lane norm) : scale(Lane::all(1.0) / root(norm * (norm + size(alpha)))) {
    alignas(64) double a[lanes], b[lanes];
    alpha.store(a);
    norm.store(b);
    for (int l = 0; l < lanes; ++l) b[l] = a[l] >= 0.0 ? -b[l] : b[l];
    beta = Lane::load(b);
  }
};

// Eight problems: matrix (8, M, n) and rhs (8, M), each problem's numbers together; z (8, n) apart by z_step, or null.
struct SideBySide {
  int n, M, p;
  const std::int64_t* offsets;
  double* W;         // (M, n) lanes: rows, then what the reflectors make of them; behind a finished row's diagonal, its reflector
  double* t;         // (M,) lanes: right-hand sides
  double* diagonal;  // (M,) lanes
  double* y;         // (n,) lanes
  double* work;      // (max(M, n),) lanes
  double* norms;     // (p,) lanes: ||A_k||_F
  int* top;          // (n,): the row whose reflector belongs to a column

  SideBySide(const Problem& shape, Workspace& workspace)
      : n(shape.unknowns), M(shape.rows), p(shape.levels), offsets(shape.offsets),
        W(workspace.numbers(static_cast<std::size_t>(M) * n * lanes)), t(workspace.numbers(M * lanes)),
        diagonal(workspace.numbers(M * lanes)), y(workspace.numbers(n * lanes)), work(workspace.numbers((M > n ? M : n) * lanes)),
        norms(workspace.numbers(p * lanes)), top(workspace.counts(n)) {}

  HQP_INLINE double* at(int i, int j) const { return W + (static_cast<std::ptrdiff_t>(i) * n + j) * lanes; }
  HQP_INLINE Lane get(int i, int j) const { return Lane::load(at(i, j)); }

  void load(const double* matrix, const double* rhs, const double* z, std::ptrdiff_t z_step) {
    const int entries = M * n;
    for (int lane = 0; lane < lanes; ++lane) {
      const double* from = matrix + static_cast<std::ptrdiff_t>(lane) * entries;
      for (int e = 0; e < entries; ++e) W[e * lanes + lane] = from[e];
      for (int i = 0; i < M; ++i) t[i * lanes + lane] = rhs[static_cast<std::ptrdiff_t>(lane) * M + i];
      for (int j = 0; j < n && z; ++j) work[j * lanes + lane] = z[lane * z_step + j];
    }
    for (int k = 0; k < p; ++k) {
      Lane s = Lane::all(0.0);
      for (int i = static_cast<int>(offsets[k]); i < offsets[k + 1]; ++i)
        for (int j = 0; j < n; ++j) s = s + get(i, j) * get(i, j);
      root(s).store(norms + k * lanes);
    }
    for (int i = 0; i < M && z; ++i) {
      Lane s = Lane::load(t + i * lanes);
      for (int j = 0; j < n; ++j) s = s - get(i, j) * Lane::load(work + j * lanes);
      s.store(t + i * lanes);
    }
  }

  // W[row, c:] <- itself times the reflector of row i.
  HQP_INLINE void reflect(int row, int i, int c) {
    Lane s = get(row, c) * get(i, c);
    for (int j = c + 1; j < n; ++j) s = s + get(row, j) * get(i, j);
    for (int j = c; j < n; ++j) (get(row, j) - s * get(i, j)).store(at(row, j));
  }

  // LQ of rows r0 ... r1 - 1 on columns c0 ..., in place; `later` lists the `count` rows that come later, which are turned too.
  void wide_level(int c0, int r0, int r1, const int* later, int count) {
    for (int i = r0; i < r1; ++i) {
      const int c = c0 + i - r0;
      Lane s = get(i, c) * get(i, c);
      for (int j = c + 1; j < n; ++j) s = s + get(i, j) * get(i, j);
      const Lane norm = root(s);
      const Lane alpha = get(i, c);
      const auto [beta, scale] = EightReflectors(alpha, norm);
      beta.store(diagonal + i * lanes);
      ((alpha - beta) * scale).store(at(i, c));
      for (int j = c + 1; j < n; ++j) (get(i, j) * scale).store(at(i, j));
      for (int row = i + 1; row < r1; ++row) reflect(row, i, c);
      for (int l = 0; l < count; ++l) reflect(later[l], i, c);
      top[c] = i;
    }
  }

  // Whether 1 / ||L^-1||_F > tol * norm for the m x m triangle at (r0, c0), of R^T where `transposed`; one flag for each lane.
  void prove(int r0, int c0, int m, bool transposed, Lane norm, double tol, bool* good) {
    Lane total = Lane::all(0.0);
    for (int j = 0; j < m; ++j)
      for (int i = j; i < m; ++i) {
        Lane s = Lane::all(i == j ? 1.0 : 0.0);
        for (int l = j; l < i; ++l)
          s = s - (transposed ? get(r0 + l, c0 + i) : get(r0 + i, c0 + l)) * Lane::load(work + l * lanes);
        s = s / (transposed ? get(r0 + i, c0 + i) : Lane::load(diagonal + (r0 + i) * lanes));
        s.store(work + i * lanes);
        total = total + s * s;
      }
    alignas(64) double bound[lanes];
    (Lane::all(tol) * norm * root(total)).store(bound);
    for (int l = 0; l < lanes; ++l) good[l] = good[l] && bound[l] < 1.0;
  }

  // QR of rows r0 ... r1 - 1 on columns c0 ... n - 1, fewer than rows, in place, and t <- Q^T t: no freedom is left behind it.
  void tall_level(int c0, int r0, int r1) {
    for (int c = c0; c < n; ++c) {
      const int i0 = r0 + c - c0;
      Lane s = Lane::all(0.0);
      for (int i = i0; i < r1; ++i) s = s + get(i, c) * get(i, c);
      const Lane norm = root(s);
      const Lane alpha = get(i0, c);
      const auto [beta, scale] = EightReflectors(alpha, norm);
      ((alpha - beta) * scale).store(at(i0, c));
      for (int i = i0 + 1; i < r1; ++i) (get(i, c) * scale).store(at(i, c));
      for (int j = c + 1; j <= n; ++j) {
        Lane d = Lane::all(0.0);
        for (int i = i0; i < r1; ++i) d = d + get(i, c) * (j == n ? Lane::load(t + i * lanes) : get(i, j));
        for (int i = i0; i < r1; ++i) {
          double* entry = j == n ? t + i * lanes : at(i, j);
          (Lane::load(entry) - d * get(i, c)).store(entry);
        }
      }
      beta.store(at(i0, c));
    }
  }

  // y <- the cascade's steps from z in x's own coordinates; levels in falling order where `reversed`, which then must be independent.
  // good[lane] keeps where every rank was proven full and every number was of usual size.
  void solve(double rank_tolerance, bool reversed, bool* good, int* later) {
    const double tol = rank_tolerance > tolerance::side_by_side ? rank_tolerance : tolerance::side_by_side;
    for (int j = 0; j < n; ++j) Lane::all(0.0).store(y + j * lanes);
    for (int l = 0; l < lanes; ++l) good[l] = true;
    int c0 = 0, reflected = 0;
    for (int step = 0; step < p; ++step) {
      const int k = reversed ? p - 1 - step : step;
      const int r0 = static_cast<int>(offsets[k]), r1 = static_cast<int>(offsets[k + 1]), m = r1 - r0;
      const Lane norm = Lane::load(norms + k * lanes);
      if (m == 0) continue;
      for (int l = 0; l < lanes; ++l) {
        const double v = norms[k * lanes + l];
        good[l] = good[l] && v > 1e-60 && v < 1e60;
      }
      if (c0 == n) continue;
      for (int i = r0; i < r1; ++i) {
        Lane s = Lane::load(t + i * lanes);
        for (int j = 0; j < c0; ++j) s = s - get(i, j) * Lane::load(y + j * lanes);
        s.store(t + i * lanes);
      }
      if (m > n - c0) {
        tall_level(c0, r0, r1);
        prove(r0, c0, n - c0, true, norm, tol, good);
        for (int c = n - 1; c >= c0; --c) {
          const int i = r0 + c - c0;
          Lane s = Lane::load(t + i * lanes);
          for (int j = c + 1; j < n; ++j) s = s - get(i, j) * Lane::load(y + j * lanes);
          (s / get(i, c)).store(y + c * lanes);
        }
        c0 = n;
        continue;
      }
      int count = 0;
      for (int after = step + 1; after < p; ++after) {
        const int other = reversed ? p - 1 - after : after;
        for (std::int64_t i = offsets[other]; i < offsets[other + 1]; ++i) later[count++] = static_cast<int>(i);
      }
      wide_level(c0, r0, r1, later, count);
      prove(r0, c0, m, false, norm, tol, good);
      for (int i = 0; i < m; ++i) {
        Lane s = Lane::load(t + (r0 + i) * lanes);
        for (int j = 0; j < i; ++j) s = s - get(r0 + i, c0 + j) * Lane::load(y + (c0 + j) * lanes);
        (s / Lane::load(diagonal + (r0 + i) * lanes)).store(y + (c0 + i) * lanes);
      }
      c0 += m;
      reflected = c0;
    }
    for (int c = reflected - 1; c >= 0; --c) {
      const int i = top[c];
      Lane s = Lane::load(y + c * lanes) * get(i, c);
      for (int j = c + 1; j < n; ++j) s = s + Lane::load(y + j * lanes) * get(i, j);
      for (int j = c; j < n; ++j) (Lane::load(y + j * lanes) - s * get(i, j)).store(y + j * lanes);
    }
  }
};

// `one` solves one problem. Side by side go undamped problems; of reverse priority those of no more rows than unknowns, whose answer is
// that of the cascade in reverse order where all levels are independent.
template <class One>
inline void solve_batch(const Batch& batch, double tol, bool undamped, bool reversed, One one, Workspace& workspace) {
  Workspace::Scope scope(workspace);
  const Problem& shape = batch.shape;
  const int n = shape.unknowns, M = shape.rows;
  const double *matrix = batch.matrix, *rhs = batch.rhs, *z = batch.free;
  const std::int64_t z_step = batch.free_step, N = batch.count;
  double* X = batch.x;
  unsigned char* codes = batch.codes;
  const std::int64_t entries = static_cast<std::int64_t>(M) * n;
  const auto single = [&](std::int64_t i) {
    Problem problem = shape;
    problem.matrix = matrix + i * entries;
    problem.lower = problem.upper = rhs + i * M;
    const Outcome outcome = one(problem, z ? z + i * z_step : nullptr, X + i * n);
    codes[i] = static_cast<unsigned char>(outcome);
    if (outcome != Outcome::solved)
      for (int j = 0; j < n; ++j) X[i * n + j] = std::numeric_limits<double>::quiet_NaN();
  };
  std::int64_t i = 0;
  if (undamped && M > 0 && (!reversed || M <= n)) {
    SideBySide eight(shape, workspace);
    int* later = workspace.counts(M);
    bool good[lanes];
    for (; i + lanes <= N; i += lanes) {
      eight.load(matrix + i * entries, rhs + i * M, z ? z + i * z_step : nullptr, z_step);
      eight.solve(tol, reversed, good, later);
      for (int lane = 0; lane < lanes; ++lane) {
        double* x = X + (i + lane) * n;
        double checked = 0.0;
        for (int j = 0; j < n; ++j) {
          x[j] = eight.y[j * lanes + lane] + (z ? z[(i + lane) * z_step + j] : 0.0);
          checked += 0.0 * x[j];
        }
        for (int row = 0; row < M; ++row) checked += 0.0 * rhs[(i + lane) * M + row];
        codes[i + lane] = 0;
        if (!good[lane] || checked != 0.0) single(i + lane);
      }
    }
  }
  for (; i < N; ++i) single(i);
}

}  // namespace HQP_ISA
}  // namespace hqp
