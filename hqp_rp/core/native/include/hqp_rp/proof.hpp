// A quick proof that an answer is the lexicographic optimum: sufficient, not necessary. The judge is hqp_rp.certify, which shares no
// code with this; what is accepted here, it accepts too.
//
// The excess of a level is bounded from above as `certify` defines it, and what rounding may contribute to it from below. Rows that
// still matter are carried in coordinates whose columns from c0 on are the freedom that judged levels leave: the active inequality
// rows of judged levels (held), the rows of levels to come and, at last, x - zeta.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "hqp_rp/load.hpp"
#include "hqp_rp/nonnegative.hpp"
#include "hqp_rp/problem.hpp"

namespace hqp {
inline namespace HQP_ISA {

class Proof {
 public:
  Proof(const Problem& problem, Workspace& workspace)
      : problem_(problem), workspace_(workspace), n_(problem.unknowns), M_(problem.hard_rows + problem.rows) {
    const int size = M_ + n_;
    rows_ = make_matrix(workspace, M_ + 1, n_);
    held_ = make_matrix(workspace, M_ + 1, n_);
    work_ = make_matrix(workspace, M_ + 1, n_);
    reflectors_ = make_matrix(workspace, n_ + 1, n_);
    x_ = workspace.numbers(rows_.stride);
    for (double** v : {&low_, &up_, &value_, &square_, &v_, &side_, &new_side_, &multipliers_, &residual_, &right_, &order_})
      *v = workspace.numbers(size);
    lengths_ = workspace.numbers(3 * static_cast<std::size_t>(size));
    pulling_ = workspace.counts(size);
    fixed_ = workspace.counts(size);
  }

  // Whether x (n,) is proven to be the optimum nearest to zeta (n,), to the relative tolerance `accept`.
  bool accepts(const double* x, const double* zeta, double accept, double rank_tolerance) {
    const int p = problem_.levels + 1;
    const double x_size = length_of(x, n_);
    if (!(x_size < 1e150) || !finite(x, n_)) return false;
    for (int j = 0; j < rows_.stride; ++j) {
      x_[j] = j < n_ ? x[j] : 0.0;
      rows_[M_][j] = j < n_ ? x[j] - zeta[j] : 0.0;
    }
    const double near_tolerance = std::max(accept, tolerance::near_bound);
    int h = 0, c0 = 0;
    for (int k = 0; k < p; ++k) {
      const int r0 = k ? problem_.hard_rows + static_cast<int>(problem_.offsets[k - 1]) : 0;
      const int r1 = problem_.hard_rows + static_cast<int>(problem_.offsets[k]);
      if (r0 == r1) continue;
      const int m = r1 - r0;
      double whole = 0.0;
      if (!load(k, r0, m, &whole)) return false;
      if (c0 < n_) reflect_rows_by_all(rows_, r0, r1, reflectors_, c0, 0, rows_.stride);
      const double size = whole / std::sqrt(static_cast<double>(std::min(m, n_)));
      double target_square = 0.0, residual_square = 0.0;
      double longest = 0.0, shortest = std::numeric_limits<double>::infinity(), farthest = 0.0, nearest = std::numeric_limits<double>::infinity();
      bool missed = false;
      int pulls = 0, fixes = 0;
      for (int i = r0; i < r1; ++i) {
        const double value = value_[i], row = std::sqrt(square_[i]);
        const double target = std::min(std::max(value, low_[i]), up_[i]);
        target_square += target * target;
        v_[i] = value - target;
        const double reach = row * x_size + std::fabs(target);
        const double near = near_tolerance * reach;
        if (row > 0.0) longest = std::max(longest, row), shortest = std::min(shortest, row);
        if (reach > 0.0) farthest = std::max(farthest, reach), nearest = std::min(nearest, reach);
        missed = missed || std::fabs(v_[i]) * whole > accept * reach * size;
        if (k == 0 && std::fabs(v_[i]) > accept * reach) return false;
        const bool above = value >= up_[i] - near, below = value <= low_[i] + near;
        const bool beyond = std::fabs(v_[i]) > near, equality = low_[i] == up_[i];
        new_side_[i] = 0.0;
        if (equality || v_[i] != 0.0) {
          pulling_[pulls++] = i;
          residual_square += v_[i] * v_[i];
        }
        if (equality || beyond || (above && below))
          fixed_[fixes++] = i;
        else if ((above || below) && row > 0.0)
          new_side_[i] = above ? 1.0 : -1.0;
      }
      if (c0 == n_) {
        if (k == 0) continue;
        return true;
      }
      // The norm of a level of very different rows does not show the small ones: the judge looks at them by themselves.
      if (k > 0 && missed && (longest > tolerance::uneven * shortest || farthest > tolerance::far_targets * nearest)) return false;
      const double level_size = size * x_size + std::sqrt(target_square);
      double allowed = accept * level_size;
      bool open_question = k > 0 && !(std::sqrt(residual_square) <= allowed);
      if (open_question) allowed += 4.0 * tolerance::eps * (n_ + m) * level_size;
      int firm = 0;
      if (open_question && (h || pulls != fixes)) {
        Workspace::Scope scope(workspace_);
        const int d = n_ - c0;
        Matrix C = make_matrix(workspace_, pulls, d);
        for (int i = 0; i < pulls; ++i) {
          for (int j = 0; j < C.stride; ++j) C[i][j] = j < d ? rows_[pulling_[i]][c0 + j] : 0.0;
          residual_[i] = v_[pulling_[i]];
        }
        if (!held_back(C, pulls, d, residual_, h, c0, size, whole, allowed)) return false;
        open_question = false;
        for (int i = 0; i < h; ++i) firm += multipliers_[i] > tolerance::firm;
      }
      // What is fixed leaves with the directions that it takes: so do firm rows, whose normals, weighted by multipliers, add up to a
      // combination of fixed rows, so that no allowed move leaves their bounds. What is held stays, with later rows.
      for (int i = 0; i < h; ++i) {
        const double length = std::sqrt(square_from(held_[i], c0, held_.stride));
        multipliers_[i] = !firm || !(multipliers_[i] > tolerance::firm) ? 0.0 : length > tolerance::short_normal ? 1.0 / length : -1.0;
      }
      for (int i = r0; i < r1; ++i) {
        if (new_side_[i] == 0.0) continue;
        copy(held_[h], rows_[i], held_.stride);
        side_[h] = new_side_[i];
        multipliers_[h++] = 0.0;
      }
      if (fixes) {
        for (int i = 0; i < fixes; ++i) {
          copy(work_[i], rows_[fixed_[i]], work_.stride);
          order_[i] = i;
        }
        const Factored f =
            factor_level(work_, 0, fixes, c0, n_, order_, whole, rank_tolerance, reflectors_.below(c0), lengths_, work_.stride);
        for (int i = 0; i < fixes; ++i) right_[i] = v_[fixed_[static_cast<int>(order_[i])]];
        if (!f.proven) return false;  // singular values have to decide the rank: the judge does
        turn_kept(h, c0, f.reflectors);
        const int r = f.reflectors;
        if (open_question && 0 < r && r < fixes) tall_part(fixes, c0, r);
        if (open_question && !(length_of(right_, r) <= allowed)) return false;
        c0 += r;
      }
      if (firm && c0 < n_) c0 += firm_rows(h, c0);
      if (firm) h = still_held(h);
    }
    if (c0 == n_) return true;
    const int d = n_ - c0;
    for (int j = 0; j < d; ++j) residual_[j] = rows_[M_][c0 + j];
    const double reach = x_size + length_of(zeta, n_);
    const double allowed = (accept + 8.0 * tolerance::eps * n_) * reach;
    if (length_of(residual_, d) <= allowed) return true;
    if (h == 0) return false;
    Workspace::Scope scope(workspace_);
    Matrix C = make_matrix(workspace_, d, d);
    for (int i = 0; i < d; ++i)
      for (int j = 0; j < C.stride; ++j) C[i][j] = i == j ? 1.0 : 0.0;
    return held_back(C, d, d, residual_, h, c0, 1.0, 1.0, allowed);
  }

 private:
  // Rows of level k (0: the hard ones) with bounds, values at x and squared lengths; whole <- ||A_k||_F.
  bool load(int k, int r0, int m, double* whole) {
    const double* matrix = k ? problem_.matrix + problem_.offsets[k - 1] * n_ : problem_.hard_matrix;
    const double* lower = k ? problem_.lower + problem_.offsets[k - 1] : problem_.hard_lower;
    const double* upper = k ? problem_.upper + problem_.offsets[k - 1] : problem_.hard_upper;
    const int readable = k ? problem_.rows - static_cast<int>(problem_.offsets[k - 1]) : problem_.hard_rows;
    const Loaded loaded = load_level(matrix, readable, n_, m, rows_.below(r0), rows_.stride);
    if (!loaded.finite) return false;
    *whole = loaded.norm;
    for (int i = 0; i < m; ++i) {
      low_[r0 + i] = lower[i] * loaded.scale;
      up_[r0 + i] = upper[i] * loaded.scale;
      value_[r0 + i] = dot(rows_[r0 + i], x_, 0, rows_.stride);
      square_[r0 + i] = square_from(rows_[r0 + i], 0, rows_.stride);
    }
    return true;
  }

  // The newest reflectors, of the columns c0 ..., reach what stays at once and later levels when their turn comes.
  void turn_kept(int h, int c0, int count) {
    reflect_rows_by_all(held_, 0, h, reflectors_.below(c0), count, c0, held_.stride);
    reflect_rows_by_all(rows_, M_, M_ + 1, reflectors_.below(c0), count, c0, rows_.stride);
  }

  // right (r,) <- what of the residuals the factor's column space holds: Q^T right with L = Q R.
  void tall_part(int m, int c0, int r) {
    Workspace::Scope scope(workspace_);
    TallSystem tall(r, m, workspace_);
    tall.load_triangle(work_, 0, c0, right_);
    tall.factor();
    tall.turn(tall.right);
    for (int j = 0; j < r; ++j) right_[j] = tall.right[j];
  }

  // Whether moves z with H z <= 0 (H the held rows' outward normals), each at the cost step_cost * size * ||z||, are proven to remove
  // no more than `allowed` from v (m,) through C z: at most ||F^-1 (C^T v + H^T w)|| for any w >= 0, F F^T = C^T C + delta^2 I.
  // Rounding adds as much as w pulls. multipliers (h,) <- w over what the level can pull.
  bool held_back(Matrix C, int m, int d, const double* v, int h, int c0, double size, double whole, double allowed) {
    Workspace::Scope scope(workspace_);
    Matrix F = make_matrix(workspace_, d, d);
    Matrix columns = make_matrix(workspace_, h + 1, d);  // rows: F^-1 times each normal
    double* slope = workspace_.numbers(d);
    double* rest = workspace_.numbers(d);
    double* w = workspace_.numbers(h + 1);
    double* lengths = workspace_.numbers(h + 1);
    const double delta = tolerance::step_cost * size;
    for (int j = 0; j < d; ++j) {
      slope[j] = 0.0;
      for (int i = 0; i < m; ++i) slope[j] += C[i][j] * v[i];
    }
    for (int i = 0; i < d; ++i)
      for (int j = 0; j <= i; ++j) {
        double s = 0.0;
        for (int l = 0; l < m; ++l) s += C[l][i] * C[l][j];
        if (i == j) s += delta * delta;
        for (int q = 0; q < j; ++q) s -= F[i][q] * F[j][q];
        F[i][j] = i == j ? std::sqrt(std::max(s, delta * delta)) : s / F[j][j];
      }
    const auto over_root = [&](double* b) {
      for (int j = 0; j < d; ++j) {
        double s = b[j];
        for (int q = 0; q < j; ++q) s -= F[j][q] * b[q];
        b[j] = s / F[j][j];
      }
    };
    over_root(slope);
    for (int i = 0; i < h; ++i) {
      const double length = std::sqrt(square_from(held_[i], c0, held_.stride));
      const double factor = length > tolerance::short_normal ? side_[i] / length : 0.0;
      for (int j = 0; j < columns.stride; ++j) columns[i][j] = j < d ? factor * held_[i][c0 + j] : 0.0;
      over_root(columns[i]);
      const double own = length_of(columns[i], d);
      lengths[i] = own > 0.0 ? own : 1.0;
      scale_row(columns[i], 1.0 / lengths[i], columns.stride);
    }
    for (int j = 0; j < d; ++j) slope[j] = -slope[j];
    nonnegative_least_squares(columns, h, d, slope, w, rest, allowed, workspace_);
    const double residual = length_of(v, m);
    double pulls = residual;
    for (int i = 0; i < h; ++i) {
      const double multiplier = w[i] / lengths[i] / whole;
      pulls += multiplier;
      multipliers_[i] = multiplier / residual;
    }
    return length_of(rest, d) <= allowed + std::min(residual, pulls * tolerance::proof_noise / tolerance::step_cost);
  }

  // Turns what stays by the directions that firm rows take from the columns c0 ...; returns how many those are.
  int firm_rows(int h, int c0) {
    int firm = 0;
    for (int i = 0; i < h; ++i) {
      if (!(multipliers_[i] > 0.0)) continue;
      copy(work_[firm], held_[i], work_.stride);
      scale_row(work_[firm], multipliers_[i], work_.stride);
      order_[firm] = firm;
      ++firm;
    }
    const int r = lq(work_, 0, firm, c0, n_, order_, tolerance::dependent_normal, reflectors_.below(c0), lengths_, work_.stride);
    turn_kept(h, c0, r);
    return r;
  }

  // Drops the rows that were firm from the held ones; returns how many remain.
  int still_held(int h) {
    int still = 0;
    for (int i = 0; i < h; ++i) {
      if (multipliers_[i] != 0.0) continue;
      if (still != i) copy(held_[still], held_[i], held_.stride);
      side_[still++] = side_[i];
    }
    return still;
  }

  const Problem& problem_;
  Workspace& workspace_;
  const int n_, M_;
  Matrix rows_;        // (M + 1, n): rows of the levels, scaled, then x - zeta; in the coordinates that judged levels leave
  Matrix held_;        // active inequality rows of judged levels
  Matrix work_;        // rows being factored
  Matrix reflectors_;  // of judged levels, that of column t in row t
  double* x_;
  double *low_, *up_, *value_, *square_, *v_, *side_, *new_side_, *multipliers_, *residual_, *right_, *order_, *lengths_;
  int *pulling_, *fixed_;
};

}  // namespace HQP_ISA
}  // namespace hqp
