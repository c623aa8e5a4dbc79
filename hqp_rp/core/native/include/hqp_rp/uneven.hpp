// What counted rows of very different length miss by, accurate in each row's own length.
//
// What a long row misses by can balance what a short one misses by, although it is less than the rounding error of the long row's value.
// At the least squares of a level, what its counted rows miss by is the part of their targets in the orthogonal complement of the factor,
// which is accurate row by row (Cox and Higham 1998) where the difference of value and bound is not. Multipliers come from these.
#pragma once

#include <algorithm>
#include <cmath>

#include "hqp_rp/least_squares.hpp"
#include "hqp_rp/working_set.hpp"

namespace hqp {
inline namespace HQP_ISA {

template <class W>
class UnevenResiduals {
 public:
  UnevenResiduals(WorkingRows<W>& rows, Workspace& workspace) : rows_(rows), workspace_(workspace) {
    double* reals = workspace.numbers(3 * static_cast<std::size_t>(rows.M));
    missed_ = reals, hidden_ = missed_ + rows.M, cosine_ = hidden_ + rows.M;
    released_ = workspace.counts(rows.M + 1);
  }

  bool known = false;  // whether these are what the rows of the last step miss by

  void begin_level(int r0, int r1) {
    for (int i = r0; i < r1; ++i) released_[i] = 0;
  }

  // y (r,) <- the minimizer of ||C y - t||, C being rows r0 ... r0 + count - 1 of A from column c0 on, r of them independent; which (count,):
  // the counted row that stands in each. Then what those rows miss by is known.
  HQP_APART void solve(Matrix A, int r0, int count, int c0, int r, const int* which, const double* t, double* y) {
    Workspace::Scope scope(workspace_);
    int* order = workspace_.counts(count);
    for (int i = 0; i < count; ++i) order[i] = i;
    std::sort(order, order + count, [&](int i, int j) { return rows_.norm[which[i]] > rows_.norm[which[j]]; });
    TallSystem tall(r, count, workspace_);
    double* unit = workspace_.numbers(tall.T.stride);
    tall.load(A.below(r0), order, c0, t);
    tall.factor();
    const Matrix T = tall.T;
    const int steps = tall.reflectors;
    double* rest = tall.right;
    tall.turn(rest);
    // Not `tall.solve`: compilers contract its loop in another way, and answers would change in their last bit.
    for (int j = steps - 1; j >= 0; --j) {
      double s = rest[j];
      for (int i = j + 1; i < steps; ++i) s -= T[i][j] * y[static_cast<int>(tall.order[i])];
      y[static_cast<int>(tall.order[j])] = s / T[j][j];
    }
    for (int j = 0; j < steps; ++j) rest[j] = 0.0;
    apply_q(rest, tall.V, steps, 0, T.stride);
    double pulls = 0.0;
    for (int q = 0; q < count; ++q) {
      const int row = which[order[q]];
      missed_[row] = -rest[q];
      pulls += std::fabs(rest[q]) * rows_.norm[row];
    }
    // Q^T e_q: behind the triangle how the row reaches the complement; before it, over the triangle, column q of the pseudo-inverse.
    for (int q = 0; q < count; ++q) {
      for (int l = 0; l < T.stride; ++l) unit[l] = l == q ? 1.0 : 0.0;
      tall.turn(unit);
      double cosine = 0.0, inverse = 0.0;
      for (int l = steps; l < count; ++l) cosine += unit[l] * unit[l];
      for (int j = steps - 1; j >= 0; --j) {
        for (int i = j + 1; i < steps; ++i) unit[j] -= T[i][j] * unit[i];
        unit[j] /= T[j][j];
        inverse += unit[j] * unit[j];
      }
      const int row = which[order[q]];
      cosine_[row] = std::sqrt(cosine);
      hidden_[row] = tolerance::row_rounding * std::sqrt(inverse) * pulls;
    }
    known = true;
  }

  // Bounds what rounding may add to what the counted rows miss by, at an x of this size.
  HQP_APART void bound_rounding(const int* counted, int count, double size) {
    double total = 0.0;
    for (int i = 0; i < count; ++i) {
      const int row = counted[i];
      total += cosine_[row] * tolerance::row_rounding * (rows_.norm[row] * size + std::fabs(rows_.bound(row)));
    }
    pull_ = hidden_pull_ = 0.0;
    doubtful_ = false;
    for (int i = 0; i < count; ++i) {
      const int row = counted[i];
      hidden_[row] += cosine_[row] * total;
      pull_ = std::max(pull_, std::fabs(missed_[row]) * rows_.norm[row]);
      hidden_pull_ += hidden_[row] * rows_.norm[row];
      doubtful_ = doubtful_ || hidden_[row] > tolerance::hidden_row * (rows_.norm[row] * size + std::fabs(rows_.bound(row)));
    }
  }

  // What a counted row misses by; what rounding can explain is 0.
  double missed_by(int row) const { return std::fabs(missed_[row]) > hidden_[row] ? missed_[row] : 0.0; }
  // What of a multiplier is rounding error.
  double multiplier_floor() const { return tolerance::multiplier_rounding * pull_ + hidden_pull_; }

  // A row at its bound may be hidden: rounding keeps from telling whether it holds others back there, because others beside it are at
  // their bounds too; without it they tell. Releases such a row, each once in a level; false where none is left.
  HQP_APART bool release_hidden(const int* counted, int count) {
    for (int i = 0; i < count; ++i) {
      const int row = counted[i];
      if (rows_.equality(row) || released_[row] || !(std::fabs(missed_[row]) <= hidden_[row]) ||
          !(hidden_[row] * rows_.norm[row] > tolerance::hidden_pull * pull_))
        continue;
      rows_.release(row);
      released_[row] = 1;
      return true;
    }
    return false;
  }
  // Whether what is hidden weighs so much that the answer is to be verified.
  bool doubtful() const { return doubtful_ || hidden_pull_ > tolerance::hidden_pull * pull_; }

 private:
  WorkingRows<W>& rows_;
  Workspace& workspace_;
  double* missed_;  // by row, of counted ones: what it misses by
  double* hidden_;  // what of that may be rounding error
  double* cosine_;  // how much of the row is in the complement
  int* released_;   // rows of the level that were released as hidden
  double pull_ = 0.0, hidden_pull_ = 0.0;  // the most that a counted row pulls, and what of multipliers may be rounding error
  bool doubtful_ = false;  // whether rounding may move a counted row visibly
};

}  // namespace HQP_ISA
}  // namespace hqp
