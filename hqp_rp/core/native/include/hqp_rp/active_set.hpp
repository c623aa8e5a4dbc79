// Lexicographic least squares with two-sided rows at any level: an active set searched level by level.
//
// Level k minimizes the squared violation of its rows over the points that keep what earlier levels reached. Its working set holds kept
// rows at their bounds (held, equalities of a step) and its own rows that count (equalities and violated rows, the least squares of a
// step). Each step factors both afresh by orthogonal transformations. Rows that are then determined (equalities, violated rows, rows
// held by a multiplier) leave for good together with the directions they determine; satisfied rows are kept as rows.
//
// The search of a level starts with a step to where all of its counted and held rows are at their bounds, as far as they are
// independent: no multiplier then has to be known. Rows that this step would violate enter. Where the level cannot be met so, block
// pivots follow: every row that the whole step would violate enters, every row whose multiplier has the wrong sign leaves, and nothing
// moves until the working set allows it. Where that does not end, the primal search takes over from the last point that kept every
// bound: it moves until a row blocks, one row at a time, and cannot cycle (Bland's rule).
//
// A level with damping rows D is searched twice: first with D x = d beside its own rows, which nothing later keeps; then with its own rows
// alone, equalities and violated rows asking for exactly the value that they have there.
//
// Source: Escande, Mansard and Wieber 2014; Dimitrov, Sherikov and Wieber 2015. The level-by-level search with fresh factorizations,
// guess and block pivots is ours.
#pragma once

#include <algorithm>
#include <cmath>

#include "hqp_rp/least_squares.hpp"
#include "hqp_rp/uneven.hpp"
#include "hqp_rp/working_set_guess.hpp"

namespace hqp {
inline namespace HQP_ISA {

constexpr int reaches = 3;       // steps tried in a level to where all of its counted rows are met
constexpr int block_pivots = 6;  // block pivots tried in a level before the primal search takes over

template <class W>
class ActiveSetSearch {
 public:
  // Rows that a search works on: hard ones, and a damped level's twice.
  static int rows_of(const Problem& problem, const Damped& damped) {
    int rows = problem.hard_rows + problem.rows;
    for (int k = 0; k < problem.levels; ++k)
      if (damped.of(k)) rows += static_cast<int>(problem.offsets[k + 1] - problem.offsets[k]) + damped.of(k);
    return rows;
  }

  ActiveSetSearch(const Problem& problem, const Damped& damped, double rank_tolerance, int limit, Workspace& workspace, W width)
      : problem_(problem), damped_(damped), width_(width), n_(problem.unknowns), p_(searched_levels(problem, damped)),
        tol_(rank_tolerance), limit_(limit),
        depends_(rank_tolerance > tolerance::depends ? rank_tolerance : tolerance::depends), workspace_(workspace),
        rows_(rows_of(problem, damped), problem.unknowns, width, workspace), uneven_(rows_, workspace) {
    const int M = rows_.M;
    offsets_ = workspace.counts(p_ + 1);
    tentative_ = workspace.counts(p_ + 1);
    uneven_levels_ = workspace.counts(p_ + 1);
    offsets_[0] = tentative_[0] = 0;
    offsets_[1] = problem.hard_rows;
    int largest = problem.hard_rows, level = 0;
    const auto append = [&](int rows, int tentative) {
      tentative_[++level] = tentative;
      offsets_[level + 1] = offsets_[level] + rows;
      largest = std::max(largest, rows);
    };
    for (int k = 0; k < problem.levels; ++k) {
      const int m = static_cast<int>(problem.offsets[k + 1] - problem.offsets[k]);
      if (damped.of(k)) append(m + damped.of(k), 1);
      append(m, 0);
    }
    const int size = std::max(n_ + largest + 1, M);
    matrix_ = make_matrix(workspace, n_ + largest + 1, n_);
    V_ = make_matrix(workspace, n_ + largest + 1, n_);
    done_ = make_matrix(workspace, M + 1, n_);
    turns_ = reinterpret_cast<Turn*>(workspace.numbers((p_ + 1) * (sizeof(Turn) / sizeof(double) + 1)));
    pages_ = reinterpret_cast<Matrix*>(workspace.numbers((p_ + 1) * (sizeof(Matrix) / sizeof(double) + 1)));
    for (int k = 0; k <= p_; ++k) pages_[k] = Matrix{};
    first_ = workspace.counts(p_ + 2);
    column_ = workspace.counts(p_ + 1);
    held_rows_ = workspace.counts(size);
    counted_rows_ = workspace.counts(size);
    list_ = workspace.counts(size);
    stays_ = workspace.counts(M + 1);
    passed_ = workspace.counts(M + 1);
    origin_ = workspace.numbers(size);
    target_ = workspace.numbers(size + n_);
    multiplier_ = workspace.numbers(size);
    gradient_ = workspace.numbers(size);
    work_ = workspace.numbers(size + n_);
    lengths_ = workspace.numbers(2 * static_cast<std::size_t>(size) + n_);
    point_ = workspace.numbers(width_);
    step_ = workspace.numbers(width_);
    move_ = workspace.numbers(width_);
    next_ = workspace.numbers(width_);
    goal_ = workspace.numbers(width_);
    first_[0] = 0;
  }

  // x (n,): where to start, then the answer. side (hard rows and rows of levels): the bound at which a row is thought to be active,
  // then the bounds at which rows are active; when infeasible, 1 for each hard row of the contradiction. The answer is then the point
  // of least violation, and the levels are optimized over such points only with `go_on`. z (n,) or null: what x should be near to.
  Outcome solve(const double* z, bool go_on, double* x, int* side, bool guessed) {
    const Problem& p = problem_;
    bool sound = true;
    // Hard rows are met or not, each in its own scale; only a least violation weighs them against each other, as they were given.
    const int together = go_on ? std::max(p.hard_rows, 1) : 1;
    for (int i = 0; i < p.hard_rows && sound; i += together)
      sound = rows_.load(i, together, p.hard_matrix + static_cast<std::ptrdiff_t>(i) * n_, p.hard_rows - i, p.hard_lower + i,
                         p.hard_upper + i, guessed ? side + i : nullptr);
    uneven_levels_[0] = together > 1 && rows_.uneven;
    for (int k = 0, level = 1; k < p.levels && sound; ++k, ++level) {
      const std::int64_t r0 = p.offsets[k];
      const int m = static_cast<int>(p.offsets[k + 1] - r0);
      const int* guesses = guessed ? side + p.hard_rows + r0 : nullptr;
      if (tentative_[level]) sound = load_damped(k, level++, guesses);
      sound = sound && rows_.load(offsets_[level], m, p.matrix + r0 * n_, p.rows - static_cast<int>(r0), p.lower + r0, p.upper + r0, guesses);
      uneven_levels_[level] = rows_.uneven;
    }
    if (!sound) return Outcome::not_finite;
    for (int j = 0; j < width_; ++j) {
      point_[j] = j < n_ ? x[j] : 0.0;
      goal_[j] = j < n_ && z ? z[j] : 0.0;
    }
    Outcome outcome = search_levels(go_on);
    for (int j = 0; j < n_; ++j) x[j] = point_[j];
    if (outcome == Outcome::solved && !keeps_hard_rows()) outcome = Outcome::inaccurate;
    const bool infeasible = outcome == Outcome::infeasible;
    for (int i = 0; i < p.hard_rows; ++i) side[i] = infeasible ? rows_.conflict[i] : rows_.side[i];
    for (int k = 0, level = 1; k < p.levels; ++k, ++level) {
      level += tentative_[level];
      const std::int64_t r0 = p.hard_rows + p.offsets[k];
      // A violated row of a damped level became an equality; `conflict` says at which side.
      for (int i = offsets_[level]; i < offsets_[level + 1]; ++i)
        side[r0 + i - offsets_[level]] = infeasible ? 0 : rows_.conflict[i] ? rows_.conflict[i] : rows_.side[i];
    }
    if (outcome != Outcome::infeasible && outcome != Outcome::iteration_limit && !finite(x, n_)) return Outcome::not_finite;
    return outcome;
  }

  int iterations = 0;
  double smallest = infinite;       // pivot of a level's own rows
  double smallest_held = infinite;  // pivot of held rows met on the way, of rows of length one

 private:
  using Rows = WorkingRows<W>;

  static int searched_levels(const Problem& problem, const Damped& damped) {
    int levels = problem.levels + 1;
    for (int k = 0; k < problem.levels; ++k) levels += damped.of(k) > 0;
    return levels;
  }
  // Whether the point keeps every hard row as it was given, whatever rounding the search allowed for on its way.
  bool keeps_hard_rows() const {
    const double size = length(point_);
    for (int i = 0; i < problem_.hard_rows; ++i) {
      const double* a = problem_.hard_matrix + static_cast<std::ptrdiff_t>(i) * n_;
      const double value = dot_anywhere(a, point_, n_);
      const double low = problem_.hard_lower[i], up = problem_.hard_upper[i];
      const double over = std::max(value - up, low - value);
      if (!(over > 0.0)) continue;
      const double b = value > up ? up : low;
      if (over > tolerance::hard_kept * (length_of(a, n_) * size + std::fabs(b))) return false;
    }
    return true;
  }
  // The rows of level k with its damping rows below them, in one scale.
  bool load_damped(int k, int level, const int* guesses) {
    Workspace::Scope scope(workspace_);
    const std::int64_t r0 = problem_.offsets[k];
    const int m = static_cast<int>(problem_.offsets[k + 1] - r0), r = damped_.of(k);
    double* rows = workspace_.numbers(static_cast<std::size_t>(m + r) * n_);
    double *low = workspace_.numbers(m + r), *up = workspace_.numbers(m + r);
    int* guess = guesses ? workspace_.counts(m + r) : nullptr;
    std::copy(problem_.matrix + r0 * n_, problem_.matrix + (r0 + m) * n_, rows);
    std::copy(damped_.rows + damped_.offsets[k] * n_, damped_.rows + damped_.offsets[k + 1] * n_, rows + static_cast<std::ptrdiff_t>(m) * n_);
    for (int i = 0; i < m + r; ++i) {
      const double d = i < m ? 0.0 : damped_.rhs[damped_.offsets[k] + i - m];
      low[i] = i < m ? problem_.lower[r0 + i] : d;
      up[i] = i < m ? problem_.upper[r0 + i] : d;
      if (guess) guess[i] = i < m ? guesses[i] : 0;
    }
    const bool sound = rows_.load(offsets_[level], m + r, rows, m + r, low, up, guess);
    uneven_levels_[level] = rows_.uneven;
    return sound;
  }
  // What the damped level k reached is what its own rows, level k + 1, are to keep; the damping rows and the copies beside them are done.
  void keep_reached(int k, double size) {
    for (int i = offsets_[k]; i < offsets_[k + 1]; ++i) {
      rows_.release(i);
      rows_.state[i] = Rows::waiting;
    }
    rows_.set_values(point_, offsets_[k + 1], offsets_[k + 2]);
    for (int i = offsets_[k + 1]; i < offsets_[k + 2]; ++i) {
      const bool violated = !rows_.equality(i) && rows_.beyond(i, size, tolerance::reached);
      if (violated) rows_.conflict[i] = rows_.value[i] > rows_.up[i] ? 1 : -1;
      if (violated || rows_.equality(i)) rows_.low[i] = rows_.up[i] = rows_.value[i];
    }
  }

  // --- the freedom that finished levels left -------------------------------------------------------------------------------

  double length(const double* v) const { return std::sqrt(square_from(v, 0, width_)); }

  // move <- Z step: a step in the freedom that `levels` finished levels left, as a step of x.
  void from_free(int levels) {
    copy(move_, step_, width_);
    for (int k = levels - 1; k >= 0; --k) {
      if (turns_[k].r) turns_[k].back(move_, work_);
      apply_q(move_, done_.below(first_[k]), first_[k + 1] - first_[k], column_[k], width_);
    }
  }
  // The coordinates of a step of x: those of the freedom that finished levels left stand last.
  void to_free(int levels, double* v) {
    for (int k = 0; k < levels; ++k) {
      apply_q_transpose(v, done_.below(first_[k]), first_[k + 1] - first_[k], column_[k], width_);
      if (turns_[k].r) turns_[k].forward(v, work_);
    }
  }
  // T of the rows i0 ... i1 - 1 that are not fixed <- what `levels` finished levels make of R; rows alike go side by side.
  void turn_rows(int i0, int i1, int levels) {
    for (int i = i0; i < i1;) {
      const int begun = rows_.turned[i];
      if (begun == levels || rows_.state[i] == Rows::fixed) {
        ++i;
        continue;
      }
      int end = i + 1;
      while (end < i1 && rows_.turned[end] == begun && rows_.state[end] != Rows::fixed) ++end;
      for (int row = i; row < end; ++row) {
        rows_.turned[row] = levels;
        if (begun < 0) copy(rows_.T[row], rows_.R[row], width_);
      }
      for (int k = std::max(begun, 0); k < levels;) {
        int last = k;  // levels whose reflectors stand in neighbouring columns are applied together
        while (last + 1 < levels && !turns_[last].r && column_[last + 1] == column_[last] + first_[last + 1] - first_[last]) ++last;
        reflect_rows_by_all(rows_.T, i, end, done_.below(first_[k]), first_[last + 1] - first_[k], column_[k], width_);
        for (int row = i; row < end && turns_[last].r; ++row) turns_[last].forward(rows_.T[row], work_);
        k = last + 1;
      }
      i = end;
    }
  }
  // Remembers what level k turned: the first `reflectors` of V, which begin at column c0, and `turn`.
  void keep_turns(int k, int reflectors, const Turn& turn, int c0) {
    for (int t = 0; t < reflectors; ++t) copy(done_[first_[k] + t], V_[t], width_);
    first_[k + 1] = first_[k] + reflectors;
    column_[k] = c0;
    turns_[k] = turn;
  }

  // --- factorizations ------------------------------------------------------------------------------------------------------

  void gather_held(int levels, int count, int top) {
    for (int i = 0; i < count; ++i) {
      const int row = held_rows_[i];
      if (rows_.turned[row] != levels) turn_rows(row, row + 1, levels);
      copy(matrix_[top + i], rows_.T[row], width_);
      if (rows_.norm[row] > 0.0) scale_row(matrix_[top + i], 1.0 / rows_.norm[row], width_);
      origin_[top + i] = top + i;
    }
  }
  void gather_counted(const int* list, int count, int top) {
    for (int i = 0; i < count; ++i) {
      copy(matrix_[top + i], rows_.T[list[i]], width_);
      origin_[top + i] = top + i;
    }
  }
  // The held row that stands in row i of the factored matrix; the counted row that stands in row top + i.
  int held_at(int i) const { return held_rows_[static_cast<int>(origin_[i])]; }
  int counted_at(int top, int i) const { return counted_rows_[static_cast<int>(origin_[top + i]) - top]; }
  int list_counted(int r0, int r1) {
    int count = 0;
    for (int i = r0; i < r1; ++i)
      if (rows_.working[i]) counted_rows_[count++] = i;
    return count;
  }
  // LQ of rows i0 ... i1 - 1 of the matrix from column c on; rows up to `end` are turned too. Reflectors from V[t0] on.
  int factor(int i0, int i1, int c, int end, double floor, int t0) {
    const int r = lq(matrix_, i0, i1, c, n_, origin_, floor, V_.below(t0), lengths_, width_);
    if (end > i1) reflect_rows_by_all(matrix_, i1, end, V_.below(t0), r, c, width_);
    return r;
  }
  Factored factor_own(int r0, int r1, int top, int count, int end, int c, int t0) {
    const double norm = rows_.level_norm(r0, r1);
    Factored f = factor_level(matrix_, top, top + count, c, n_, origin_, norm, tol_, V_.below(t0), lengths_, width_);
    if (end > top + count) reflect_rows_by_all(matrix_, top + count, end, V_.below(t0), f.reflectors, c, width_);
    return f;
  }
  // step[c ... c + rank - 1] <- the least-squares answer of the factored rows to `target`, the rank by the library's rule.
  int answer_level(int k, int r0, int r1, int top, int count, int c, const Factored& f, Turn& turn, double* pivot) {
    turn.r = 0;
    *pivot = f.smallest;
    if (f.reflectors == 0) return 0;
    const int r = f.reflectors;
    if (f.proven) {
      level_least_squares(matrix_, top, count, c, r, target_, workspace_);
      for (int i = 0; i < r; ++i) step_[c + i] = target_[i];
      return r;
    }
    if (!pages_[k].data) pages_[k] = make_matrix(workspace_, n_, n_);
    turn.V = pages_[k];
    const double zero = tol_ * spectral(rows_.R[r0], r1 - r0, n_, rows_.R.stride, workspace_);
    const Decided d = decide_level(matrix_, top, count, c, r, n_ - c, zero, target_, Damping{}, turn, work_, workspace_);
    for (int i = 0; i < d.rank; ++i) step_[c + i] = work_[i];
    *pivot = d.smallest;
    return d.rank;
  }
  // What a counted row misses by after the whole step; what rounding can explain is 0.
  double missed_by(int row, double size) const { return uneven_.known ? uneven_.missed_by(row) : rows_.residual(row, size); }
  // Releases a row of an uneven level that is hidden; where none is left and what is hidden still weighs, the answer is to be verified.
  bool release_hidden(int count, double residual) {
    if (!uneven_.known || !(residual > 0.0)) return false;
    if (uneven_.release_hidden(counted_rows_, count)) return true;
    if (uneven_.doubtful()) smallest = 0.0;
    return false;
  }

  // --- steps ---------------------------------------------------------------------------------------------------------------

  struct Reached {
    bool independent;
    double sought;  // what the step is after, as a length
    double pivot;
  };
  // Entry i of the y with L y = s, from those before it, which stand in `step`; L in columns c0 ... of the matrix.
  double substituted(int i, int c0, double s) const {
    const double* l = matrix_[i] + c0;
    for (int j = 0; j < i; ++j) s -= l[j] * step_[c0 + j];
    return s / l[i];
  }
  // step <- the way to where all of the counted and held rows are at their bounds; counted ones, factored first, stay factored.
  Reached reach_level(int k, int r0, int r1, int held, int counted, int c0, double size) {
    if (counted + held > n_ - c0) return {false, 0.0, 0.0};
    gather_counted(counted_rows_, counted, 0);
    gather_held(k, held, counted);
    const Factored f = factor_own(r0, r1, 0, counted, counted + held, c0, 0);
    if (f.reflectors < counted || !f.proven) return {false, 0.0, 0.0};
    if (held && factor(counted, counted + held, c0 + counted, counted + held, tolerance::apart, counted) < held) return {false, 0.0, 0.0};
    fill(step_, 0.0, width_);
    double sought = 0.0;
    for (int i = 0; i < counted + held; ++i) {
      double s = 0.0;
      if (i < counted) {
        const int own = counted_at(0, i);
        s = rows_.bound(own) - rows_.value[own];
        sought = std::max(sought, std::fabs(s));
      } else {
        const int row = held_rows_[static_cast<int>(origin_[i]) - counted];
        s = -rows_.residual(row, size) / rows_.norm[row];
      }
      step_[c0 + i] = substituted(i, c0, s);
    }
    apply_q(step_, V_, counted + held, c0, width_);
    return {true, sought, f.smallest};
  }
  // Gathers held and counted rows and factors the held ones; those that depend on others of them leave. Returns how many remain.
  // top: how many are held, and after it where the counted rows stand, which is that many unless `newest` left.
  // newest (-1 for none): the row that stopped a step of length zero. Where it depends on the others, the point is a degenerate vertex
  // and what carried the row across its bound rounding: it is passed, and may not stop a step until the working set is another.
  int factor_held(int k, int& top, int counted, int c0, int newest) {
    const int held = top;
    gather_held(k, held, 0);
    gather_counted(counted_rows_, counted, held);
    if (held == 0) return 0;
    const int r = factor(0, held, c0, held + counted, depends_, 0);
    if (r < held && newest >= 0) {
      smallest_held = 0.0;
      rows_.release(newest);
      passed_[newest] = 1;
      top = rows_.compress(held_rows_, held);
      return factor_held(k, top, counted, c0, -1);
    }
    for (int i = 0; i < r; ++i) smallest_held = std::min(smallest_held, std::fabs(matrix_[i][c0 + i]));
    if (r < held) {
      smallest_held = 0.0;
      for (int i = r; i < held; ++i) rows_.release(held_at(i));
      for (int i = 0; i < r; ++i) list_[i] = held_at(i);
      for (int i = 0; i < r; ++i) {
        held_rows_[i] = list_[i];
        origin_[i] = i;
      }
    }
    return r;
  }
  void toward_goal(int levels, double* v) {
    copy(v, goal_, width_);
    add_multiple(v, point_, -1.0, 0, width_);
    to_free(levels, v);
  }
  // target <- what the counted rows, at `top`, miss their bounds by once held rows have moved by what `step` has in columns c0 ...
  // c0 + held - 1; returns the most that one misses by before that.
  double target_counted(int top, int counted, int c0, int held) {
    double sought = 0.0;
    for (int i = 0; i < counted; ++i) {
      const int own = counted_at(top, i);
      double s = rows_.bound(own) - rows_.value[own];
      sought = std::max(sought, std::fabs(s));
      for (int j = c0; j < c0 + held; ++j) s -= matrix_[top + i][j] * step_[j];
      target_[i] = s;
    }
    return sought;
  }
  struct Minimized {
    int reflectors = 0, rank = 0;
    double sought = 0.0, pivot = infinite;
    bool to_bounds = false;  // held rows are not at their bounds yet
  };
  // step <- the way to the minimizer over the working set, from the factored held rows; factors the counted ones (at `top`).
  //
  // In the `last` level, what is minimized is ||x - goal||; `gradient` then is its gradient along the held rows.
  Minimized step_to_minimizer(int k, int r0, int r1, bool last, int top, int held, int counted, int c0, double size, Turn& turn) {
    Minimized found;
    turn.r = 0;
    uneven_.known = false;
    if (last) {
      toward_goal(k, step_);
      for (int j = 0; j < c0; ++j) step_[j] = 0.0;
      for (int j = c0; j < n_; ++j) found.sought += std::fabs(step_[j]);
      apply_q_transpose(step_, V_, held, c0, width_);
      for (int j = 0; j < held; ++j) gradient_[j] = -step_[c0 + j];
    } else {
      fill(step_, 0.0, width_);
    }
    for (int i = 0; i < held; ++i) {  // held rows go (back) to their bounds
      const int row = held_at(i);
      double s = -rows_.residual(row, size) / rows_.norm[row];
      found.to_bounds = found.to_bounds || s != 0.0;
      step_[c0 + i] = substituted(i, c0, s);
      if (last) gradient_[i] += step_[c0 + i];
    }
    if (counted && counted > n_ - c0 - held && n_ - c0 - held > 1 && !unproven_) {  // nothing is free behind it
      const int d = n_ - c0 - held;
      found.sought = target_counted(top, counted, c0, held);
      const Factored f = tall_level(matrix_, top, counted, c0 + held, d, rows_.level_norm(r0, r1), tol_, target_, step_ + c0 + held, workspace_);
      if (f.proven) {
        found.rank = d;
        found.pivot = f.smallest;
        apply_q(step_, V_, held, c0, width_);
        return found;
      }
      unproven_ = true;
    }
    if (counted) {
      const Factored f = factor_own(r0, r1, top, counted, top + counted, c0 + held, held);
      found.sought = target_counted(top, counted, c0, held);
      found.reflectors = f.reflectors;
      if (uneven_levels_[k] && f.proven && f.reflectors < counted) {
        found.rank = f.reflectors;
        found.pivot = f.smallest;
        for (int i = 0; i < counted; ++i) list_[i] = counted_at(top, i);
        uneven_.solve(matrix_, top, counted, c0 + held, f.reflectors, list_, target_, step_ + c0 + held);
        uneven_.bound_rounding(counted_rows_, counted, size + found.sought + length(step_));
      } else {
        found.rank = answer_level(k, r0, r1, top, counted, c0 + held, f, turn, &found.pivot);
      }
      if (turn.r) {
        for (int j = found.rank; j < turn.r; ++j) step_[c0 + held + j] = 0.0;
        turn.back(step_, work_);
      }
    }
    apply_q(step_, V_, held + found.reflectors, c0, width_);
    return found;
  }
  // next <- x + move; its length.
  double try_next() {
    copy(next_, point_, width_);
    add_multiple(next_, move_, 1.0, 0, width_);
    return length(next_);
  }
  bool move_to_next(double size) {
    copy(point_, next_, width_);
    return size < infinite || finite(point_, n_);
  }
  // Whether x has become so much shorter that the rows' values would carry the rounding error of where it was: they are then computed
  // anew, and the level is not done before a step from there.
  bool came_from_afar(int end, double begun, double now) {
    if (!(begun > tolerance::afar * now)) return false;
    rows_.set_values(point_, 0, end);
    return true;
  }

  // --- working sets --------------------------------------------------------------------------------------------------------

  // Rows to start a level with: equalities, what is violated and, beside such rows, what is guessed. False when none counts.
  bool enter_level(int r0, int r1, double size) {
    bool counts = false;
    for (int i = r0; i < r1; ++i) {
      if (rows_.equality(i)) {
        rows_.activate(i, 1);
        counts = true;
      } else if (rows_.beyond(i, size)) {
        counts = true;
      }
    }
    if (!counts) return false;
    for (int i = r0; i < r1; ++i) {
      if (rows_.equality(i)) continue;
      if (rows_.value[i] > rows_.up[i] || (rows_.guess[i] > 0 && rows_.up[i] < infinite))
        rows_.activate(i, 1);
      else if (rows_.value[i] < rows_.low[i] || (rows_.guess[i] < 0 && rows_.low[i] > -infinite))
        rows_.activate(i, -1);
    }
    return true;
  }
  int enter_guessed(int r0, int held, int most) {
    for (int i = 0; i < r0; ++i) {
      const int guess = rows_.guess[i];
      if (!guess || rows_.state[i] != Rows::kept || rows_.working[i] || held >= most) continue;
      if (std::fabs(guess > 0 ? rows_.up[i] : rows_.low[i]) < infinite) {
        rows_.activate(i, guess);
        held_rows_[held++] = i;
      }
    }
    return held;
  }
  // The working set of the point where the search stands: rows of the level that it violates, of held rows those at their bounds.
  int start_from_values(int r0, int r1, int held, double size) {
    for (int i = r0; i < r1; ++i) {
      if (rows_.equality(i) || rows_.value[i] > rows_.up[i])
        rows_.activate(i, 1);
      else if (rows_.value[i] < rows_.low[i])
        rows_.activate(i, -1);
      else
        rows_.release(i);
    }
    for (int i = 0; i < held; ++i)
      if (rows_.residual(held_rows_[i], size) != 0.0) rows_.release(held_rows_[i]);
    return rows_.compress(held_rows_, held);
  }
  // Multipliers of held rows from L^T multiplier = -gradient; returns the largest residual, or in the last level ||gradient||.
  double multipliers(int top, int held, int counted, int c0, bool last, double size) {
    double residual = 0.0;
    for (int i = 0; i < counted; ++i) residual = std::max(residual, std::fabs(missed_by(counted_rows_[i], size)));
    for (int i = 0; i < held; ++i) multiplier_[i] = 0.0;
    if (last) {
      residual = 0.0;
      for (int i = 0; i < held; ++i) residual += gradient_[i] * gradient_[i];
      residual = std::sqrt(residual);
    }
    if (held == 0 || residual == 0.0) return residual;
    if (!last) {
      for (int j = 0; j < held; ++j) gradient_[j] = 0.0;
      for (int i = 0; i < counted; ++i) {
        const double w = missed_by(counted_at(top, i), size);
        for (int j = 0; j < held; ++j) gradient_[j] += w * matrix_[top + i][c0 + j];
      }
    }
    for (int i = held - 1; i >= 0; --i) {
      double s = -gradient_[i];
      for (int j = i + 1; j < held; ++j) s -= matrix_[j][c0 + i] * multiplier_[static_cast<int>(origin_[j])];
      multiplier_[static_cast<int>(origin_[i])] = s / matrix_[i][c0 + i];
    }
    return residual;
  }
  // How far inside its bounds a counted row of the level is, > 0 when it should not count.
  double wrong_of_level(int row, double size) const {
    return rows_.equality(row) ? 0.0 : -missed_by(row, size) * rows_.side[row];
  }
  double wrong_of_held(int i, double floor) const {
    const double wrong = -multiplier_[i] * rows_.side[held_rows_[i]];
    return wrong > floor ? wrong : 0.0;
  }
  // Releases a row, or turns it to its other bound when a step carried it across a narrow band.
  void leave(int row) {
    if (rows_.state[row] != Rows::kept && rows_.side[row] > 0 && rows_.value[row] < rows_.low[row])
      rows_.side[row] = -1;
    else if (rows_.state[row] != Rows::kept && rows_.side[row] < 0 && rows_.value[row] > rows_.up[row])
      rows_.side[row] = 1;
    else
      rows_.release(row);
  }
  // What of a multiplier is rounding error. Damping rows weigh against residuals of the level's own rows that they alone leave, and
  // those are known to the rounding of the rows' values.
  double floor_of(int k, double residual, double size) const {
    if (uneven_.known) return uneven_.multiplier_floor();
    const double floor = tolerance::multiplier_rounding * std::max(residual, tolerance::eps * size);
    return tentative(k) ? std::max(floor, tolerance::row_rounding * size) : floor;
  }
  // How many times rounding has to be exceeded after so many steps of length zero.
  double doubt_after(int idle) const {
    return idle > n_ ? std::min(std::pow(tolerance::idle_doubt, idle / n_), tolerance::largest_doubt) : 1.0;
  }
  bool tentative(int k) const { return k < p_ && tentative_[k] != 0; }
  // The row whose multiplier is most wrong, by Bland's rule the first such row; -1 at the optimum.
  // `doubt` times as wrong as rounding explains it has to be.
  int row_to_leave(int k, int held, int counted, double residual, double size, bool bland, double doubt) const {
    int worst = -1;
    double largest = 0.0;
    const auto consider = [&](int row, double wrong) {
      if (wrong > 0.0 && !stays_[row] && (worst < 0 || (bland ? row < worst : wrong > largest))) largest = wrong, worst = row;
    };
    for (int i = 0; i < counted; ++i) consider(counted_rows_[i], wrong_of_level(counted_rows_[i], size));
    if (residual > 0.0)
      for (int i = 0; i < held; ++i) consider(held_rows_[i], wrong_of_held(i, doubt * floor_of(k, residual, size)));
    return worst;
  }
  struct Crossed {
    int held;
    int rows;  // that entered or wanted to
  };
  // Every row that the step's end violates enters; `size` is that of the level's own rows, `now` the length of x there. What the level
  // seeks, which may be far beyond x, explains no violation of the others.
  Crossed enter_crossed(int end, int r0, int held, int most, double size, double now, double span) {
    int crossed = 0;
    for (int i = 0; i < end; ++i) {
      const bool own = i >= r0;
      if (rows_.working[i] || !rows_.takes_part(i, r0) || !rows_.beyond(i, own ? size : now + span)) continue;
      if (!own && std::fabs(rows_.change[i]) <= 2.0 * depends_ * rows_.norm[i] * span) continue;  // it depends on held rows
      ++crossed;
      if (!own && held >= most) continue;
      rows_.activate(i, rows_.value[i] > rows_.up[i] ? 1 : -1);
      if (!own) held_rows_[held++] = i;
    }
    return {held, crossed};
  }
  // Held rows become the guessed ones.
  int enter_guess(int k, int r0, int r1, bool last, int held, int c0) {
    turn_rows(0, r0, k);
    if (last) toward_goal(k, next_);
    guess_working_set(rows_, r0, r1, c0, n_ - c0, next_, workspace_);
    for (int i = 0; i < held; ++i) rows_.release(held_rows_[i]);
    int count = 0;
    for (int i = 0; i < r0; ++i) {
      if (!rows_.guess[i] || rows_.state[i] != Rows::kept || count >= n_ - c0) continue;
      rows_.activate(i, rows_.guess[i]);
      held_rows_[count++] = i;
    }
    return count;
  }

  // --- levels --------------------------------------------------------------------------------------------------------------

  struct Met {
    bool met, sound;
    int held, counted;
    double pivot, size;
  };
  // Steps to where all counted and held rows are at their bounds, and lets rows that this would violate enter.
  Met meet_level(int k, int r0, int r1, int held, int c0) {
    int counted = list_counted(r0, r1);
    for (int tried = 0; tried < reaches && iterations < limit_; ++tried) {
      const double begun = length(point_);
      const Reached reached = reach_level(k, r0, r1, held, counted, c0, begun);
      if (!reached.independent) break;
      ++iterations;
      from_free(k);
      const double span = length(step_);
      if (!(span > tolerance::step_rounding * (begun + reached.sought)))
        return {true, true, held, counted, reached.pivot, begun + reached.sought};
      const int outside = rows_.try_step(move_, r1, r0);
      const double now = try_next();
      const double size = now + reached.sought;
      bool missed = false;
      for (int i = 0; i < counted && !missed; ++i) missed = rows_.residual(counted_rows_[i], size) != 0.0;
      Crossed crossed{held, 0};
      if (!missed && outside) crossed = enter_crossed(r1, r0, held, n_ - c0, size, now, span);
      held = crossed.held;
      if (!missed && crossed.rows == 0) {
        const bool sound = move_to_next(now);
        if (!came_from_afar(r1, begun, now)) return {true, sound, held, counted, reached.pivot, size};
        continue;
      }
      rows_.set_length(r1, r0, 0.0);
      if (missed) break;
      counted = list_counted(r0, r1);
    }
    return {false, true, held, counted, 0.0, 0.0};
  }

  struct Searched {
    Outcome outcome = Outcome::solved;
    int held = 0, factored = 0, counted = 0;  // held rows, those of them in the last factorization, counted rows
    int reflectors = 0, rank = 0;             // of the counted rows
    double residual = 0.0, pivot = 0.0, size = 0.0;
    Turn turn = {};
  };
  // Minimizes level k; `pivoted` when the held rows are not those of the start any more.
  Searched search_level(int k, int r0, int r1, bool last, int held, int c0, bool pivoted) {
    const int end = r1;
    const int most = n_ - c0;
    unproven_ = k < p_ && uneven_levels_[k];  // those are answered row by row
    int blocks = block_pivots;
    int idle = 0, last_left = -1, newest = -1;
    bool guess = true;
    for (int i = 0; i < end; ++i) stays_[i] = passed_[i] = 0;
    uneven_.begin_level(r0, r1);
    for (int i = r0; i < r1; ++i) guess = guess && rows_.equality(i);
    for (;;) {
      const bool bland = idle > n_;
      if (++iterations > limit_) return {Outcome::iteration_limit};
      if (pivoted && guess) {
        guess = false;
        held = enter_guess(k, r0, r1, last, held, c0);
      }
      const int counted = list_counted(r0, r1);
      int top = held;
      held = factor_held(k, top, counted, c0, newest);
      newest = -1;
      const double begun = length(point_);
      Turn turn;
      const Minimized m = step_to_minimizer(k, r0, r1, last, top, held, counted, c0, begun, turn);
      double size = begun + m.sought;  // the rounding error of what the step is after counts like that of x
      from_free(k);
      const double span = length(step_);
      const bool moves = m.to_bounds || span > tolerance::step_rounding * size;
      if (moves)
        rows_.try_step(move_, end, r0);
      else
        rows_.stay(end, r0);
      if (blocks > 0) {
        --blocks;
        const double now = moves ? try_next() : begun;
        size = now + m.sought;
        const double residual = multipliers(top, held, counted, c0, last, size);
        const int before = held;
        int left = 0;
        for (int i = 0; i < counted; ++i)
          if (wrong_of_level(counted_rows_[i], size) > 0.0) {
            leave(counted_rows_[i]);
            ++left;
          }
        if (residual > 0.0)
          for (int i = 0; i < before; ++i)
            if (wrong_of_held(i, floor_of(k, residual, size)) > 0.0) {
              rows_.release(held_rows_[i]);
              ++left;
            }
        // `multiplier` stays in the order of the factorization: only where nothing left is it read again.
        int count = left ? rows_.compress(held_rows_, before) : before;
        const Crossed crossed = enter_crossed(end, r0, count, most, size, now, span);
        held = crossed.held;
        if (crossed.rows == 0) {
          if (moves && !move_to_next(now)) return {Outcome::not_finite};
          const bool stayed = left == 0 && !(moves && came_from_afar(end, begun, now));
          if (stayed && release_hidden(counted, residual)) {
            pivoted = true;
            continue;
          }
          if (stayed)
            return {Outcome::solved, held, before, counted, m.reflectors, m.rank, residual, m.pivot, size, turn};
        } else {
          rows_.set_length(end, r0, 0.0);
        }
        pivoted = true;
        if (blocks == 0) held = start_from_values(r0, r1, held, length(point_));
        continue;
      }
      typename Rows::Block block{1.0, -1, 0};
      if (moves) {
        const double slack = bland ? tolerance::bland_slack * std::min(doubt_after(idle), tolerance::largest_slack) * size : 0.0;
        block = rows_.first_to_block(end, r0, span, slack, depends_, passed_);
        rows_.set_length(end, r0, block.length);
        add_multiple(point_, move_, block.length, 0, width_);
        if (!finite(point_, n_)) return {Outcome::not_finite};
      }
      size = length(point_) + m.sought;
      idle = block.length * span <= tolerance::idle * size ? idle + 1 : 0;
      if (idle == 0)
        for (int i = 0; i < end; ++i) stays_[i] = passed_[i] = 0;
      else if (block.row >= 0 && block.row == last_left)
        stays_[block.row] = 1;  // with a multiplier of that sign it would have moved into its bounds
      last_left = -1;
      if (block.row >= 0) {
        rows_.activate(block.row, block.side);
        if (rows_.state[block.row] == Rows::kept) {
          held_rows_[held++] = block.row;
          if (idle > 0) newest = block.row;
        }
        continue;
      }
      const double residual = multipliers(top, held, counted, c0, last, size);
      const double doubt = doubt_after(idle);
      const int worst = row_to_leave(k, held, counted, residual, size, idle > n_, doubt);
      if (worst < 0 && release_hidden(counted, residual)) continue;
      if (worst < 0 && doubt > 1.0) smallest = 0.0;  // to be verified
      if (worst < 0) return {Outcome::solved, held, held, counted, m.reflectors, m.rank, residual, m.pivot, size, turn};
      leave(worst);
      last_left = worst;
      for (int i = 0; i < end; ++i) passed_[i] = 0;
      held = rows_.compress(held_rows_, held);
    }
  }

  struct Classified {
    int held, determined_held, determined;  // held rows that remain, held rows determined, all rows determined
    int contradicting;    // hard rows
  };
  // Sorts the rows of a finished level into those it determined (held rows with a multiplier first; listed in `counted_rows`) and kept ones.
  Classified classify_rows(int r0, int r1, int held, double residual, double size) {
    int count = 0;
    if (residual > 0.0) {
      // The residuals that the multipliers balance are known to the rounding of the rows' values.
      double pull = 0.0;
      for (int i = r0; i < r1; ++i)
        if (rows_.working[i]) pull = std::max(pull, rows_.norm[i] * rows_.norm[i]);
      const double floor = uneven_.known
                               ? uneven_.multiplier_floor()
                               : std::max(tolerance::multiplier_rounding * residual, tolerance::row_rounding * pull * size);
      int still = 0;
      for (int i = 0; i < held; ++i) {
        const int row = held_rows_[i];
        if (multiplier_[i] * rows_.side[row] > floor) {
          rows_.state[row] = Rows::fixed;
          counted_rows_[count++] = row;
        } else {
          held_rows_[still++] = row;
        }
      }
      held = still;
    }
    const int determined_held = count;
    int contradicting = 0;
    for (int i = r0; i < r1; ++i) {
      const bool working = rows_.working[i] != 0;
      const bool equality = rows_.equality(i);
      const bool hard = i < problem_.hard_rows;
      const double w = working && (hard || !equality) ? missed_by(i, size) : 0.0;
      if (working && (equality || w != 0.0)) {
        rows_.state[i] = Rows::fixed;
        counted_rows_[count++] = i;
      } else {
        rows_.state[i] = Rows::kept;
        rows_.low[i] = std::min(rows_.low[i], rows_.value[i]);
        rows_.up[i] = std::max(rows_.up[i], rows_.value[i]);
        if (working && held < n_)
          held_rows_[held++] = i;
        else if (working)
          rows_.release(i);
      }
      if (w != 0.0 && hard) {
        rows_.conflict[i] = 1;
        if (std::fabs(w) > tolerance::contradiction * (rows_.norm[i] * (size + 1.0) + std::fabs(rows_.bound(i)))) ++contradicting;
      }
    }
    return {held, determined_held, count, contradicting};
  }

  Outcome search_levels(bool go_on) {
    int contradicting = 0;
    int held = 0, c0 = 0;
    double size = length(point_);
    for (int k = 0; k <= p_; ++k) {
      const bool last = k == p_;
      const int r0 = last ? rows_.M : offsets_[k], r1 = last ? rows_.M : offsets_[k + 1];
      if (c0 == n_) break;
      rows_.set_values(point_, r0, r1);
      if (!enter_level(r0, r1, size) && !last) {  // met where the search stands
        uneven_.known = false;
        classify_rows(r0, r1, held, 0.0, size);
        keep_turns(k, 0, Turn{}, c0);
        continue;
      }
      turn_rows(r0, r1, k);
      const int started = held;
      held = enter_guessed(r0, held, n_ - c0);
      Searched s;
      uneven_.known = false;
      Met met{false, true, held, 0, 0.0, 0.0};
      if (!last) met = meet_level(k, r0, r1, held, c0);
      if (!met.sound) return Outcome::not_finite;
      if (met.met)
        s = {Outcome::solved, met.held, 0, met.counted, met.counted, met.counted, 0.0, met.pivot, met.size};
      else
        s = search_level(k, r0, r1, last, met.held, c0, met.held > started);
      if (s.outcome != Outcome::solved) return s.outcome;
      held = s.held;
      if (last) break;
      size = s.size;
      // What a damped level reaches is met, however near a singularity, and nothing later keeps where that was.
      if (!tentative_[k] && (k == 0 || !tentative_[k - 1])) smallest = std::min(smallest, s.pivot);
      if (tentative_[k]) {
        keep_reached(k, size);
        held = rows_.compress(held_rows_, held);
        keep_turns(k, 0, Turn{}, c0);
        continue;
      }
      const Classified classified = classify_rows(r0, r1, held, s.residual, size);
      held = classified.held;
      contradicting += classified.contradicting;
      if (contradicting && !go_on) return Outcome::infeasible;
      if (classified.determined == 0) {
        s.factored = s.reflectors = s.rank = 0;
        s.turn.r = 0;
      } else if (classified.determined_held < s.factored || classified.determined - classified.determined_held < s.counted) {
        factor_determined(k, r0, r1, classified, c0, s);
      }
      c0 += s.factored + s.rank;
      if (c0 < n_) keep_turns(k, s.factored + s.reflectors, s.turn, c0 - s.factored - s.rank);
    }
    if (contradicting) return Outcome::infeasible;
    for (int i = 0; i < problem_.hard_rows; ++i)
      if (rows_.conflict[i]) smallest = 0.0;  // by so little that it is no proof
    return smallest < tolerance::delicate ? Outcome::inaccurate : Outcome::solved;
  }

  // Factors what a level determined, where that is not the working set of its last step: held rows, then its own.
  void factor_determined(int k, int r0, int r1, const Classified& classified, int c0, Searched& s) {
    gather_counted(counted_rows_, classified.determined, 0);
    for (int i = 0; i < classified.determined_held; ++i) {
      const double norm = rows_.norm[counted_rows_[i]];
      if (norm > 0.0) scale_row(matrix_[i], 1.0 / norm, width_);
    }
    for (int i = 0; i < classified.determined; ++i) target_[i] = 0.0;
    s.factored = factor(0, classified.determined_held, c0, classified.determined, depends_, 0);
    const int own = classified.determined - classified.determined_held;
    const Factored f = factor_own(r0, r1, classified.determined_held, own, classified.determined, c0 + s.factored, s.factored);
    s.reflectors = f.reflectors;
    double pivot = 0.0;
    s.rank = answer_level(k, r0, r1, classified.determined_held, own, c0 + s.factored, f, s.turn, &pivot);
  }

  bool unproven_ = false;  // whether the level that is searched is not left to one QR, or that proved no rank

  const Problem& problem_;
  const Damped damped_;
  const W width_;
  const int n_, p_;  // p: levels that are searched, the hard rows among them
  const double tol_;
  const int limit_;
  const double depends_;
  Workspace& workspace_;
  Rows rows_;
  UnevenResiduals<W> uneven_;  // of the counted rows of a level whose rows are of very different length
  int* offsets_;
  int* uneven_levels_;  // of each level, whether its rows are of very different length
  int* tentative_;    // of each level, whether it is a damped one, followed by its own rows
  Matrix matrix_;     // held rows and counted rows of a step, factored
  Matrix V_;          // their reflectors, one for each column from the level's first on
  Matrix done_;       // reflectors of finished levels: first[k] ... first[k + 1] - 1, the first at column[k]
  Matrix* pages_;     // of each level, room for its singular vectors, once they were needed
  Turn* turns_;       // what singular values turned after them
  int *first_, *column_;
  int *held_rows_, *counted_rows_, *list_;
  int* passed_;       // rows that depend on held ones and stopped a step of length zero
  int* stays_;        // rows that came back at once when they left: their multiplier is rounding error until x moves
  double* origin_;    // which listed row stands where after the factorization's swaps
  double* target_;
  double* multiplier_;
  double* gradient_;
  double *work_, *lengths_;
  double *point_, *step_, *move_, *next_, *goal_;
};

}  // namespace HQP_ISA
}  // namespace hqp
