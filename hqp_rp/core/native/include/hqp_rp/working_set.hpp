// The rows of an active-set search: their values, bounds and states, and how far a step may go.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "hqp_rp/load.hpp"
#include "hqp_rp/lq.hpp"
#include "hqp_rp/problem.hpp"

namespace hqp {
inline namespace HQP_ISA {

constexpr double infinite = std::numeric_limits<double>::infinity();

// M rows low <= a_i x <= up, stacked level by level, each level scaled by a power of two.
template <class W>
struct WorkingRows {
  enum State : int {
    waiting = 0,  // of a level that has not been reached
    kept = 1,     // must stay within its bounds
    fixed = 2     // determined: its value stays as it is
  };

  W width;
  int M, n;
  Matrix R;        // (M, n) the rows
  Matrix T;        // (M, n) those that were needed, in the coordinates that finished levels left; their freedom stands last
  double* low;     // (M,) bounds
  double* up;
  double* norm;    // ||a_i||
  double* value;   // a_i x
  double* change;  // of the value along the step that is tried
  double* before;  // the value before it
  int* state;
  int* working;    // 1 in the working set
  int* guess;      // the bound at which a warm start hopes to find the row: -1, 0, +1
  int* conflict;   // 1 for a hard row of a contradiction
  int* turned;     // by how many finished levels row i of T is turned, -1 when it has not been needed
  int* side;       // the bound at which a row is active: -1 lower, +1 upper (an equality has both), 0 none
  bool uneven = false;  // whether the rows that were loaded last are of very different length

  WorkingRows(int M_, int n_, W width_, Workspace& workspace) : width(width_), M(M_), n(n_) {
    R = make_matrix(workspace, M, n);
    T = make_matrix(workspace, M, n);
    double* reals = workspace.numbers(6 * static_cast<std::size_t>(M));
    low = reals, up = low + M, norm = up + M, value = norm + M, change = value + M, before = change + M;
    int* counts = workspace.counts(6 * static_cast<std::size_t>(M));
    state = counts, working = state + M, guess = working + M, conflict = guess + M, turned = conflict + M, side = turned + M;
  }

  // Rows r0 ... of a level from m rows (of `rows_left` that may be read), their bounds and guesses (null for none); false when a number
  // is not finite.
  bool load(int r0, int m, const double* matrix, int rows_left, const double* lower, const double* upper, const int* guesses) {
    double longest = 0.0, shortest = infinite;
    bool sound = true;
    for (int i = 0; i < m; ++i) {
      const double square = square_anywhere(matrix + static_cast<std::ptrdiff_t>(i) * n, n, rows_left - i);
      norm[r0 + i] = square;
      longest = longest > square ? longest : square;
      shortest = shortest < square ? shortest : square;
      sound = sound && square < 1e240;
    }
    double scale = 1.0;
    const bool usual = sound && longest > 1e-240;
    if (!usual) {  // far from one, or not a number, be it the next row's: once more, from the largest entry
      double largest = 0.0;
      for (std::ptrdiff_t i = 0; i < static_cast<std::ptrdiff_t>(m) * n; ++i) {
        const double a = std::fabs(matrix[i]);
        if (!(a < infinite)) return false;
        largest = largest > a ? largest : a;
      }
      if (largest > 0.0) scale = scale_to_one(largest);
      longest = 0.0, shortest = infinite;
      for (int i = 0; i < m; ++i) {
        for (int j = 0; j < width; ++j) R[r0 + i][j] = j < n ? matrix[static_cast<std::ptrdiff_t>(i) * n + j] * scale : 0.0;
        norm[r0 + i] = square_from(R[r0 + i], 0, width);
        longest = longest > norm[r0 + i] ? longest : norm[r0 + i];
        shortest = shortest < norm[r0 + i] ? shortest : norm[r0 + i];
      }
    }
    if (shortest == 0.0) {  // rows of zeros do not count
      shortest = infinite;
      for (int i = r0; i < r0 + m; ++i) shortest = norm[i] > 0.0 && norm[i] < shortest ? norm[i] : shortest;
    }
    uneven = longest > tolerance::uneven * tolerance::uneven * shortest;
    if (usual) {
      const double more = scale = inverse_power_of_two(std::sqrt(longest));
      for (int i = 0; i < m; ++i) {
        load_scaled_row(R[r0 + i], matrix + static_cast<std::ptrdiff_t>(i) * n, n, rows_left - i, more, width);
        norm[r0 + i] = std::sqrt(norm[r0 + i]) * more;
      }
    } else if (longest > 0.0) {
      const double more = inverse_power_of_two(std::sqrt(longest));
      scale *= more;
      for (int i = r0; i < r0 + m; ++i) {
        scale_row(R[i], more, width);
        norm[i] = std::sqrt(norm[i]) * more;
      }
    }
    bool ordered = true;
    for (int i = 0; i < m; ++i) {
      const int row = r0 + i;
      low[row] = lower[i] * scale;
      up[row] = upper[i] * scale;
      state[row] = waiting;
      working[row] = 0;
      conflict[row] = 0;
      turned[row] = -1;
      guess[row] = guesses ? guesses[i] : 0;
      side[row] = 0;
      ordered = ordered && low[row] < infinite && up[row] > -infinite;
    }
    return ordered;
  }

  double level_norm(int r0, int r1) const {
    double s = 0.0;
    for (int i = r0; i < r1; ++i) s += norm[i] * norm[i];
    return std::sqrt(s);
  }
  double bound(int i) const { return side[i] > 0 ? up[i] : low[i]; }
  bool equality(int i) const { return low[i] == up[i]; }

  // How far row i is from its active bound, signed; what rounding can explain at an x of this size is 0.
  double residual(int i, double size) const {
    const double b = bound(i);
    const double w = value[i] - b;
    return std::fabs(w) > tolerance::row_rounding * (norm[i] * size + std::fabs(b)) ? w : 0.0;
  }
  // Whether row i is outside its bounds by more than rounding can explain.
  bool beyond(int i, double size, double part = tolerance::row_rounding) const {
    const double b = value[i] > up[i] ? up[i] : low[i];
    const double over = std::max(value[i] - up[i], low[i] - value[i]);
    return over > 0.0 && over > part * (norm[i] * size + std::fabs(b));
  }
  void activate(int i, int at) {
    side[i] = at;
    working[i] = 1;
  }
  void release(int i) { side[i] = working[i] = 0; }

  // Drops the rows of a list that are no longer working; returns how many remain.
  int compress(int* list, int count) const {
    int still = 0;
    for (int i = 0; i < count; ++i)
      if (working[list[i]]) list[still++] = list[i];
    return still;
  }
  bool takes_part(int i, int r0) const { return i >= r0 || state[i] == kept; }

  void set_values(const double* point, int r0, int r1) {
    double dots[lanes];
    for (int i = r0; i < r1; i += lanes) {
      eight_dots(R, i, r1, point, dots, width);
      for (int j = i; j < std::min(i + lanes, r1); ++j) value[j] = dots[j - i];
    }
  }
  // Values of every kept row and of the rows r0 ... end - 1 after a step `move` of x; how many that are not in the working set are
  // then outside their bounds.
  int try_step(const double* move, int end, int r0) {
    int outside = 0;
    double dots[lanes];
    for (int first = 0; first < end; first += lanes) {
      const int behind = std::min(first + lanes, end);
      bool any = behind > r0;
      for (int i = first; i < behind && !any; ++i) any = state[i] == kept;
      if (!any) continue;
      eight_dots(R, first, end, move, dots, width);
      for (int i = first; i < behind; ++i) {
        if (!takes_part(i, r0)) continue;
        change[i] = dots[i - first];
        before[i] = value[i];
        value[i] += change[i];
        if ((value[i] > up[i] || value[i] < low[i]) && !working[i]) ++outside;
      }
    }
    return outside;
  }
  // The change of a step that is rounding error: none.
  void stay(int end, int r0) {
    for (int i = 0; i < end; ++i)
      if (takes_part(i, r0)) change[i] = 0.0, before[i] = value[i];
  }
  // Values after that part of the step that was tried; 0 goes back to where it began.
  void set_length(int end, int r0, double length) {
    for (int i = 0; i < end; ++i)
      if (takes_part(i, r0)) value[i] = before[i] + length * change[i];
  }

  struct Block {
    double length;  // in [0, 1]
    int row;        // what stops the step, -1 for nothing
    int side;
  };
  // How far the step that was tried goes; span = ||step||. A row that changes by less than `depends` times its norm depends on the
  // working set, as its factorization sees it, and cannot block. Of rows nearer to their bounds than `slack` times their size the
  // first stops it at once, whatever rounding says of their order: with slack > 0 as Bland's rule needs it. None stops a step that ends
  // within the slack (Harris 1973): how a row changes along so short a step is rounding error. Rows that are `passed` stop nothing.
  Block first_to_block(int end, int r0, double span, double slack, double depends, const int* passed) const {
    Block best{1.0, -1, 0};
    for (int i = 0; i < end; ++i) {
      if (working[i] || passed[i] || !takes_part(i, r0)) continue;
      const double s = change[i];
      if (!(std::fabs(s) > 2.0 * depends * norm[i] * span)) continue;
      const double b = s > 0.0 ? up[i] : low[i];
      if (!(std::fabs(b) < infinite)) continue;
      const double left = s > 0.0 ? b - before[i] : before[i] - b;
      const double near = slack * (norm[i] + tolerance::bland_bound * std::fabs(b));
      if (slack > 0.0 && std::fabs(s) - left <= near) continue;
      const double part = left <= near ? 0.0 : left / std::fabs(s);
      if (part < best.length) best = {part, i, s > 0.0 ? 1 : -1};
    }
    return best;
  }
};

}  // namespace HQP_ISA
}  // namespace hqp
