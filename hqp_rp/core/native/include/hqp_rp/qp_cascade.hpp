// Levels solved one after another as small QPs, by a back end that is asked for each: `begin`, then `answer` until nothing is asked.
//
// Stage 0 are the hard rows (maybe none), 1 ... p the levels, p + 1 the distance to the start. A stage minimizes the violation of its
// rows in the directions z that finished stages leave free, an orthonormal basis of which is the last columns of Q:
//
//     min 1/2 ||M z - c||^2 + 1/2 ||s||^2    subject to its two-sided rows with slack s and the rows kept from earlier stages,
//
// with M a triangle of its equalities, M^T M = Z^T A^T A Z, so that no matrix is squared before the back end is asked, H = M^T M. Where
// M is ill conditioned its directions are scaled (see `qp_scaled`). Rows that must stay where they are (equalities, rows violated at
// the optimum, rows with a multiplier) are then eliminated; the others are kept as rows.
// Source: Kanoun, Lamiraux and Wieber 2011; Escande, Mansard and Wieber 2014 for the basis and the slacks.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "hqp_rp/load.hpp"
#include "hqp_rp/qp_polish.hpp"
#include "hqp_rp/qp_stages.hpp"

namespace hqp {
inline namespace HQP_ISA {

class QPCascade final : public QPStages {
 public:
  QPCascade(int n, int hard, const std::int64_t* offsets, int levels) : n_(n), hard_(hard), p_(levels), M_(hard + static_cast<int>(offsets[levels])) {
    const int size = std::max(M_, n_) + 1;
    offsets_ = memory_.counts(p_ + 3);
    offsets_[0] = 0;
    for (int k = 0; k <= p_; ++k) offsets_[k + 1] = hard + static_cast<int>(offsets[k]);
    for (Matrix* A : {&A_, &kept_, &kept_turned_, &soft_turned_, &work_, &V_}) *A = make_matrix(memory_, size, n);
    for (Matrix* A : {&Q_, &own_, &turn_}) *A = make_matrix(memory_, n + 1, n);
    guess_x_ = make_matrix(memory_, p_ + 2, n);
    for (double** v : {&low_, &up_, &kept_low_, &kept_up_, &order_, &residual_, &kept_length_, &values_, &c_})
      *v = memory_.numbers(size);
    lengths_ = memory_.numbers(2 * static_cast<std::size_t>(size) + n);
    guess_y_ = memory_.numbers(static_cast<std::size_t>(p_ + 2) * (M_ + 1));
    for (double** v : {&x_, &start_, &least_, &z_, &d_scale_}) *v = memory_.numbers(padded(n) + lanes);
    for (int** v : {&kept_ids_, &E_, &S_, &leaves_, &side_}) *v = memory_.counts(size);
    known_ = memory_.counts(p_ + 2);
    for (int k = 0; k < p_ + 2; ++k) known_[k] = 0;
    const int full = n + M_;
    qp_.hessian = memory_.numbers(static_cast<std::size_t>(full) * full);
    qp_.gradient = memory_.numbers(full);
    qp_.rows = memory_.numbers(static_cast<std::size_t>(M_ + 1) * full);
    qp_.slack_rows = memory_.numbers(static_cast<std::size_t>(M_ + 1) * full);
    qp_.lower = memory_.numbers(M_ + 1);
    qp_.upper = memory_.numbers(M_ + 1);
    qp_.start = memory_.numbers(full);
    qp_.y = memory_.numbers(M_ + 1);
  }

  Asked begin(const Problem& problem, const double* start, double accept, double rank_tolerance, bool polish) override {
    problem_ = &problem;
    accept_ = accept, tol_ = rank_tolerance, polish_ = polish;
    for (int j = 0; j < padded(n_); ++j) x_[j] = start_[j] = least_[j] = j < n_ && start ? start[j] : 0.0;
    for (int i = 0; i < M_; ++i) side_[i] = 0;
    for (int i = 0; i < n_; ++i)
      for (int j = 0; j < Q_.stride; ++j) Q_[i][j] = i == j ? 1.0 : 0.0;
    c0_ = kept_count_ = 0;
    stage_ = -1;
    violated_ = false;
    return advance();
  }

  // Takes t (n of the QP or more,) and y (m,) as answer to what was asked, refined where `polish`; without one (t null) x stays.
  Asked answer(const double* t, const double* y) override {
    const int m = qp_.m, nt = qp_.n;
    double total = 0.0;
    for (int j = 0; j < nt; ++j) total += 0.0 * (t ? t[j] : 0.0);
    for (int i = 0; i < m; ++i) total += 0.0 * (y ? y[i] : 0.0);
    const bool found = t && total == 0.0;
    for (int j = 0; j < nt; ++j) qp_.start[j] = found ? t[j] : 0.0;
    for (int i = 0; i < m; ++i) qp_.y[i] = found && y ? y[i] : 0.0;
    if (found && polish_) {
      SlackQP qp{nt, rank_, m, qp_.soft, own_, c_, qp_.rows, qp_.lower, qp_.upper};
      polish(qp, qp_.start, qp_.y, memory_);
    }
    known_[stage_] = 1;
    double* kept_y = guess_y_ + static_cast<std::ptrdiff_t>(stage_) * (M_ + 1);
    for (int i = 0; i < M_; ++i) kept_y[i] = 0.0;
    for (int i = 0; i < qp_.soft; ++i) kept_y[S_[i]] = qp_.y[i] * size_;
    for (int i = qp_.soft; i < m; ++i) {
      const double length = kept_length_[i - qp_.soft];
      kept_y[kept_ids_[i - qp_.soft]] = qp_.y[i] * size_ / (length > 0.0 ? length : 1.0);
    }
    const int stage = stage_;
    finish_stage(found ? qp_.start : nullptr);
    copy(guess_x_[stage], x_, guess_x_.stride);
    return advance();
  }

  Asked go_on() override { return advance(); }
  const QP& qp() const override { return qp_; }
  const double* x() const override { return x_; }
  const double* least() const override { return least_; }
  const int* side() const override { return side_; }
  int stage() const override { return stage_; }

 private:
  // The stages that need no QP, up to one that does or to the end.
  Asked advance() {
    if (!violated_ && stage_ == 0) {
      copy(least_, x_, padded(n_));
      if (left_violated()) {
        violated_ = true;
        return Asked::violated;
      }
    }
    while (stage_ < p_ + 1 && c0_ < n_) {  // else nothing can move any more
      ++stage_;
      const bool last = stage_ == p_ + 1;
      const int r0 = last ? M_ : offsets_[stage_], r1 = last ? M_ : offsets_[stage_ + 1];
      if (!last && r0 == r1) continue;
      if (!last && !scale_rows(r0, r1)) return Asked::not_finite;
      prepare(r0, r1, last);
      if (qp_.n > 0 && size_ > 0.0) return qp_.m > 0 ? Asked::rows : Asked::plain;
      finish_stage(nullptr);
      if (stage_ == 0) return advance();
    }
    return finite(x_, n_) ? Asked::nothing : Asked::not_finite;
  }

  // Rows r0 ... r1 - 1 times powers of two: a level as a whole, hard rows each by its own; false on overflow.
  bool scale_rows(int r0, int r1) {
    const Problem& p = *problem_;
    const double* matrix = r0 < hard_ ? p.hard_matrix + static_cast<std::ptrdiff_t>(r0) * n_ : p.matrix + static_cast<std::ptrdiff_t>(r0 - hard_) * n_;
    const double* lower = r0 < hard_ ? p.hard_lower + r0 : p.lower + (r0 - hard_);
    const double* upper = r0 < hard_ ? p.hard_upper + r0 : p.upper + (r0 - hard_);
    double whole = 0.0;
    bool fits = true;
    for (std::ptrdiff_t i = 0; i < static_cast<std::ptrdiff_t>(r1 - r0) * n_; ++i) whole = std::max(whole, std::fabs(matrix[i]));
    for (int i = r0; i < r1; ++i) {
      const double* from = matrix + static_cast<std::ptrdiff_t>(i - r0) * n_;
      double big = whole;
      if (stage_ == 0) {
        big = 0.0;
        for (int j = 0; j < n_; ++j) big = std::max(big, std::fabs(from[j]));
      }
      int e = 0;
      if (big > 0.0) std::frexp(big, &e);
      const double half = std::ldexp(1.0, -e / 2), rest = std::ldexp(1.0, -e - -e / 2);  // the whole power may overflow
      for (int j = 0; j < A_.stride; ++j) A_[i][j] = j < n_ ? from[j] * half * rest : 0.0;
      low_[i] = lower[i - r0] * half * rest;
      up_[i] = upper[i - r0] * half * rest;
      fits = fits && low_[i] < infinity && up_[i] > -infinity;
    }
    return fits;
  }

  // Whether a hard row is violated beyond the tolerance after its stage.
  bool left_violated() const {
    const double x_size = std::sqrt(square_from(x_, 0, padded(n_)));
    for (int i = 0; i < hard_; ++i) {
      const double value = dot(A_[i], x_, 0, A_.stride);
      const double bound = std::min(std::max(value, low_[i]), up_[i]);
      const double reach = std::sqrt(square_from(A_[i], 0, A_.stride)) * x_size + std::fabs(bound);
      if (value != bound && !(std::fabs(value - bound) <= accept_ * reach)) return true;  // what is no number counts as violated
    }
    return false;
  }

  // The QP of the stage, with what its answer needs; qp.n == 0 or size == 0: nothing is left to do.
  void prepare(int r0, int r1, bool last) {
    int mE = 0, mS = 0;
    for (int i = r0; i < r1; ++i) {
      if (low_[i] == up_[i])
        E_[mE++] = i;
      else if (low_[i] > -infinity || up_[i] < infinity)
        S_[mS++] = i;
    }
    bool met = mE == 0 && !last;
    for (int i = 0; i < mS; ++i) {
      values_[i] = dot(A_[S_[i]], x_, 0, A_.stride);
      met = met && low_[S_[i]] <= values_[i] && values_[i] <= up_[S_[i]];
      times_Q(A_[S_[i]], soft_turned_[i]);
    }
    const int K = kept_count_, count = mS + K;
    qp_.soft = mS, qp_.m = count, qp_.n = 0;
    rank_ = 0;
    size_ = 0.0;
    if (met) return;
    double noise = 0.0;
    if (last) {
      rank_ = n_ - c0_;
      fill(z_, 0.0, padded(n_));
      for (int i = 0; i < n_; ++i) add_multiple(z_, Q_[i], start_[i] - x_[i], 0, Q_.stride);
      for (int i = 0; i < rank_; ++i) {
        fill(own_[i], 0.0, own_.stride);
        own_[i][i] = 1.0;
        c_[i] = z_[c0_ + i];
        d_scale_[i] = 1.0;
      }
      noise = 8.0 * tolerance::eps * (std::sqrt(square_from(start_, 0, padded(n_))) + std::sqrt(square_from(x_, 0, padded(n_))));
    } else if (mE) {
      factor_equalities(mE, r0, r1, mS, K);
      double b = 0.0, square = 0.0;
      for (int i = 0; i < mE; ++i) {
        b += low_[E_[i]] * low_[E_[i]];
        square += square_from(A_[E_[i]], 0, A_.stride);
      }
      noise = 8.0 * tolerance::eps * (std::sqrt(b) + std::sqrt(square * square_from(x_, 0, padded(n_))));
    }
    const int t = rank_ + keep_felt(mS, K, c0_ + rank_);
    if (t == 0) return;
    qp_.n = t;
    double largest = 0.0, total = 0.0;
    for (int i = 0; i < rank_; ++i) total += c_[i] * c_[i];
    if (std::sqrt(total) > noise) {
      for (int i = 0; i < rank_; ++i) largest = std::max(largest, std::fabs(c_[i]));
    } else {
      for (int i = 0; i < rank_; ++i) c_[i] = 0.0;
    }
    for (int i = 0; i < count; ++i) {
      const double* turned = i < mS ? soft_turned_[i] : kept_turned_[i - mS];
      double* row = qp_.rows + static_cast<std::ptrdiff_t>(i) * t;
      for (int j = 0; j < t; ++j) row[j] = turned[c0_ + j] * (j < rank_ ? d_scale_[j] : 1.0);
      if (i < mS) {
        const int own = S_[i];
        const double within = std::sqrt(square_from(turned, c0_, soft_turned_.stride));
        // Earlier levels have used the row up: nothing here may follow it.
        if (within <= tol_ * std::sqrt(square_from(A_[own], 0, A_.stride)))
          for (int j = 0; j < t; ++j) row[j] = 0.0;
        qp_.lower[i] = low_[own] - values_[i];
        qp_.upper[i] = up_[own] - values_[i];
        largest = std::max({largest, qp_.lower[i], -qp_.upper[i]});
        continue;
      }
      const double value = dot(kept_[i - mS], x_, 0, kept_.stride);
      double length = 0.0;
      for (int j = 0; j < t; ++j) length += row[j] * row[j];
      length = std::sqrt(length);
      kept_length_[i - mS] = length;
      const double unit = length > 0.0 ? length : 1.0;
      for (int j = 0; j < t; ++j) row[j] /= unit;
      // The start is feasible by construction: a bound passed by rounding moves to where the point is.
      qp_.lower[i] = std::min(kept_low_[i - mS] - value, 0.0) / unit;
      qp_.upper[i] = std::max(kept_up_[i - mS] - value, 0.0) / unit;
    }
    if (!(largest > 0.0) || !(largest < infinity)) return;
    int e = 0;
    std::frexp(largest, &e);
    size_ = std::ldexp(1.0, e);
    for (int i = 0; i < rank_; ++i) c_[i] /= size_;
    for (int i = 0; i < count; ++i) {
      qp_.lower[i] = std::max(qp_.lower[i] / size_, -tolerance::no_bound);
      qp_.upper[i] = std::min(qp_.upper[i] / size_, tolerance::no_bound);
    }
    fill_qp();
    guess();
  }

  // Hessian M^T M and gradient -M^T c on (t, s), and the rows on (t, s): [G I; G 0].
  void fill_qp() {
    const int t = qp_.n, full = t + qp_.soft;
    for (std::ptrdiff_t i = 0; i < static_cast<std::ptrdiff_t>(full) * full; ++i) qp_.hessian[i] = 0.0;
    for (int i = 0; i < rank_; ++i)
      for (int j = 0; j <= i; ++j) {
        double s = 0.0;
        for (int l = 0; l < rank_; ++l) s += own_[l][i] * own_[l][j];
        qp_.hessian[static_cast<std::ptrdiff_t>(i) * full + j] = qp_.hessian[static_cast<std::ptrdiff_t>(j) * full + i] = s;
      }
    for (int i = t; i < full; ++i) qp_.hessian[static_cast<std::ptrdiff_t>(i) * full + i] = 1.0;
    for (int j = 0; j < full; ++j) {
      double s = 0.0;
      for (int l = 0; l < rank_ && j < rank_; ++l) s -= own_[l][j] * c_[l];
      qp_.gradient[j] = s;
    }
    for (int i = 0; i < qp_.m; ++i) {
      double* row = qp_.slack_rows + static_cast<std::ptrdiff_t>(i) * full;
      for (int j = 0; j < full; ++j) row[j] = j < t ? qp_.rows[static_cast<std::ptrdiff_t>(i) * t + j] : j - t == i ? 1.0 : 0.0;
    }
  }

  // What an earlier answer of this stage says of this QP's; qp.guessed.
  void guess() {
    const int t = qp_.n;
    double total = 0.0;
    for (int j = 0; j < t + qp_.soft; ++j) qp_.start[j] = 0.0;
    for (int i = 0; i < qp_.m; ++i) qp_.y[i] = 0.0;
    qp_.guessed = false;
    if (!known_[stage_]) return;
    fill(z_, 0.0, padded(n_));
    for (int i = 0; i < n_; ++i) add_multiple(z_, Q_[i], (guess_x_[stage_][i] - x_[i]) / size_, 0, Q_.stride);
    for (int j = 0; j < t; ++j) {
      qp_.start[j] = z_[c0_ + j] / (j < rank_ ? d_scale_[j] : 1.0);
      total += 0.0 * qp_.start[j];
    }
    const double* kept_y = guess_y_ + static_cast<std::ptrdiff_t>(stage_) * (M_ + 1);
    for (int i = 0; i < qp_.m; ++i) {
      const double y = i < qp_.soft ? kept_y[S_[i]] : kept_y[kept_ids_[i - qp_.soft]] * kept_length_[i - qp_.soft];
      qp_.y[i] = y / size_;
      total += 0.0 * qp_.y[i];
      if (i < qp_.soft) qp_.start[t + i] = -qp_.y[i];
    }
    qp_.guessed = total == 0.0;
    if (qp_.guessed) return;
    for (int j = 0; j < t + qp_.soft; ++j) qp_.start[j] = 0.0;
    for (int i = 0; i < qp_.m; ++i) qp_.y[i] = 0.0;
  }

  void times_Q(const double* row, double* out) const {
    fill(out, 0.0, Q_.stride);
    for (int i = 0; i < n_; ++i)
      if (row[i] != 0.0) add_multiple(out, Q_[i], row[i], 0, Q_.stride);
  }
  // Q, the kept rows and the stage's two-sided rows times the first `count` reflectors, from column c0 on.
  void turn_all(int count, int c0, int mS, int K) {
    reflect_rows_by_all(Q_, 0, n_, V_, count, c0, Q_.stride);
    reflect_rows_by_all(kept_turned_, 0, K, V_, count, c0, Q_.stride);
    reflect_rows_by_all(soft_turned_, 0, mS, V_, count, c0, Q_.stride);
  }
  void turn_all_by(const Turn& turn, int mS, int K) {
    for (int i = 0; i < n_; ++i) turn.forward(Q_[i], lengths_);
    for (int i = 0; i < K; ++i) turn.forward(kept_turned_[i], lengths_);
    for (int i = 0; i < mS; ++i) turn.forward(soft_turned_[i], lengths_);
  }

  // M (own), c and d_scale from the stage's equalities; rank. z = d_scale t in the first `rank` free columns of Q.
  void factor_equalities(int mE, int r0, int r1, int mS, int K) {
    Workspace::Scope scope(memory_);
    for (int i = 0; i < mE; ++i) {
      times_Q(A_[E_[i]], work_[i]);
      order_[i] = i;
    }
    const double norm = frobenius(A_, r0, r1, A_.stride);
    const Factored f = factor_level(work_, 0, mE, c0_, n_, order_, norm, tol_, V_, lengths_, work_.stride);
    const int r = f.reflectors;
    for (int i = 0; i < mE; ++i) {
      const int e = E_[static_cast<int>(order_[i])];
      residual_[i] = low_[e] - dot(A_[e], x_, 0, A_.stride);
    }
    rank_ = r;
    if (r == 0) return;
    turn_all(r, c0_, mS, K);
    double size = 0.0;
    for (int i = 0; i < r; ++i)
      for (int j = 0; j <= i; ++j) size += work_[i][c0_ + j] * work_[i][c0_ + j];
    if (f.proven && std::sqrt(size) * inverse_norm(work_, 0, c0_, r, lengths_) <= tolerance::qp_condition) {
      for (int j = 0; j < r; ++j) d_scale_[j] = 1.0;
      if (r == mE) {
        for (int i = 0; i < r; ++i) {
          for (int j = 0; j < own_.stride; ++j) own_[i][j] = j <= i ? work_[i][c0_ + j] : 0.0;
          c_[i] = residual_[i];
        }
        return;
      }
      // More rows than columns: R and Q^T residual of a QR serve as well.
      TallSystem tall(r, mE, memory_);
      tall.load_triangle(work_, 0, c0_, residual_);
      tall.factor();
      tall.turn(tall.right);
      for (int i = 0; i < r; ++i) {
        fill(own_[i], 0.0, own_.stride);
        for (int j = i; j < r; ++j) own_[i][static_cast<int>(tall.order[j])] = tall.T[j][i];
        c_[i] = tall.right[i];
      }
      return;
    }
    // Singular values: the rank by the library's rule, and directions scaled so that the QP is well conditioned.
    Matrix T = make_matrix(memory_, r, mE);
    double* sigma = memory_.numbers(r);
    transpose_triangle(T, work_, 0, mE, c0_, r);
    Turn turn{turn_, r, c0_};
    orthogonalize_rows(T, r, turn_, sigma, T.stride);
    const double zero = f.proven ? 0.0 : tol_ * spectral(A_[r0], r1 - r0, n_, A_.stride, memory_);
    rank_ = count_above(sigma, r, zero);
    turn_all_by(turn, mS, K);
    for (int i = 0; i < rank_; ++i) {
      double s = 0.0;
      for (int l = 0; l < mE; ++l) s += T[i][l] * residual_[l];
      c_[i] = s / sigma[i];
      d_scale_[i] = std::min(std::max(1.0, tolerance::qp_scaled * sigma[0] / sigma[i]), tolerance::qp_largest_scale);
      fill(own_[i], 0.0, own_.stride);
      own_[i][i] = sigma[i] * d_scale_[i];
    }
  }

  // Turns the free columns from c0 on so that some row feels the first f of them and none the others; returns f. Rows are measured at
  // length one. Along columns that no row feels the QP would be free to run away.
  int keep_felt(int mS, int K, int c0) {
    const int count = mS + K, d = n_ - c0;
    if (d == 0 || count == 0) return 0;
    for (int i = 0; i < count; ++i) {
      const double* from = i < mS ? soft_turned_[i] : kept_turned_[i - mS];
      double length = 1.0;
      if (i < mS) length = std::sqrt(square_from(A_[S_[i]], 0, A_.stride));
      copy(work_[i], from, work_.stride);
      if (length > 0.0 && length != 1.0) scale_row(work_[i], 1.0 / length, work_.stride);
      order_[i] = i;
    }
    const int f = lq(work_, 0, count, c0, n_, order_, tolerance::qp_unfelt, V_, lengths_, work_.stride);
    if (f < d) turn_all(f, c0, mS, K);
    return f;
  }

  // The first `count` rows of `work` take their directions from the columns c0 ...; returns the first column still free. by_rule: their
  // rank is decided by the rank rule of the stage's rows, else rows of length one are noise below `qp_unfelt`.
  int take_leave(int count, int c0, int r0, int r1, bool by_rule, int mS, int K) {
    Workspace::Scope scope(memory_);
    for (int i = 0; i < count; ++i) order_[i] = i;
    if (!by_rule) {
      const int r = lq(work_, 0, count, c0, n_, order_, tolerance::qp_unfelt, V_, lengths_, work_.stride);
      turn_all(r, c0, mS, K);
      return c0 + r;
    }
    const Factored f =
        factor_level(work_, 0, count, c0, n_, order_, frobenius(A_, r0, r1, A_.stride), tol_, V_, lengths_, work_.stride);
    const int r = f.reflectors;
    turn_all(r, c0, mS, K);
    if (f.proven) return c0 + r;
    Matrix T = make_matrix(memory_, r, count);
    double* sigma = memory_.numbers(r);
    transpose_triangle(T, work_, 0, count, c0, r);
    orthogonalize_rows(T, r, turn_, sigma, T.stride);
    const double zero = tol_ * spectral(A_[r0], r1 - r0, n_, A_.stride, memory_);
    const int rank = count_above(sigma, r, zero);
    turn_all_by(Turn{turn_, r, c0}, mS, K);
    return c0 + rank;
  }

  // Moves x by the answer (null: there is none), lets go what must stay where it is, keeps satisfied rows. `side` is written for rows
  // that now leave, +1 at their upper bound, -1 at their lower one. A kept row is never tighter than the point reached.
  void finish_stage(const double* t) {
    const bool last = stage_ == p_ + 1;
    const int r0 = last ? M_ : offsets_[stage_], r1 = last ? M_ : offsets_[stage_ + 1];
    const int mS = qp_.soft, K = kept_count_;
    if (t && size_ > 0.0) {
      fill(z_, 0.0, padded(n_));
      for (int j = 0; j < qp_.n; ++j) z_[c0_ + j] = t[j] * size_ * (j < rank_ ? d_scale_[j] : 1.0);
      for (int i = 0; i < n_; ++i) x_[i] += dot(Q_[i], z_, 0, Q_.stride);
    }
    int c0 = c0_ + rank_;
    int leaving = 0;
    for (int i = 0; i < mS; ++i) {
      const int row = S_[i];
      const double value = dot(A_[row], x_, 0, A_.stride);
      values_[i] = value;
      leaves_[i] = size_ > 0.0 && std::max(low_[row] - value, value - up_[row]) > tolerance::qp_strong * size_;
      if (!leaves_[i]) continue;
      side_[row] = value > up_[row] ? 1 : -1;
      if (c0 < n_) copy(work_[leaving++], soft_turned_[i], work_.stride);
    }
    if (leaving) c0 = take_leave(leaving, c0, r0, r1, true, mS, K);
    leaving = 0;
    for (int i = 0; i < K; ++i) {
      values_[mS + i] = dot(kept_[i], x_, 0, kept_.stride);
      const double y = t ? qp_.y[mS + i] : 0.0;
      leaves_[mS + i] = std::fabs(y) > tolerance::qp_strong;
      if (!leaves_[mS + i]) continue;
      side_[kept_ids_[i]] = y > 0.0 ? 1 : -1;
      if (c0 < n_) copy(work_[leaving++], kept_turned_[i], work_.stride);
    }
    if (leaving) c0 = take_leave(leaving, c0, r0, r1, false, mS, K);
    c0_ = c0;
    int q = 0;
    const auto still_free = [&](const double* turned, double length) {
      return c0 < n_ && std::sqrt(square_from(turned, c0, Q_.stride)) > tolerance::qp_used_up * length;
    };
    for (int i = 0; i < K; ++i) {
      if (leaves_[mS + i] || !still_free(kept_turned_[i], 1.0)) continue;
      if (q != i) {
        copy(kept_[q], kept_[i], kept_.stride);
        copy(kept_turned_[q], kept_turned_[i], kept_.stride);
      }
      kept_low_[q] = std::min(kept_low_[i], values_[mS + i]);
      kept_up_[q] = std::max(kept_up_[i], values_[mS + i]);
      kept_ids_[q++] = kept_ids_[i];
    }
    for (int i = 0; i < mS; ++i) {
      const int row = S_[i];
      const double length = std::sqrt(square_from(A_[row], 0, A_.stride));
      if (leaves_[i] || !(length > 0.0) || !still_free(soft_turned_[i], length)) continue;
      copy(kept_[q], A_[row], kept_.stride);
      scale_row(kept_[q], 1.0 / length, kept_.stride);
      copy(kept_turned_[q], soft_turned_[i], kept_.stride);
      scale_row(kept_turned_[q], 1.0 / length, kept_.stride);
      kept_low_[q] = std::min(low_[row], values_[i]) / length;
      kept_up_[q] = std::max(up_[row], values_[i]) / length;
      kept_ids_[q++] = row;
    }
    kept_count_ = q;
  }

  static constexpr double infinity = std::numeric_limits<double>::infinity();
  const int n_, hard_, p_, M_;
  Workspace memory_;
  const Problem* problem_ = nullptr;
  double accept_ = 0.0, tol_ = 0.0, size_ = 0.0;
  bool polish_ = true, violated_ = false;  // violated: has been said
  int stage_ = -1, c0_ = 0, kept_count_ = 0, rank_ = 0;
  int* offsets_;  // of the stages 0 ... p
  Matrix A_;      // (M, n): rows of the stages so far, scaled
  Matrix kept_, kept_turned_, soft_turned_;  // rows of length one that stay within bounds; the same times Q; two-sided rows times Q
  Matrix work_, V_;
  Matrix Q_;      // (n, n): x = start + Q y; the columns from c0 on are free
  Matrix own_;    // M
  Matrix turn_;
  Matrix guess_x_;
  double *low_, *up_, *kept_low_, *kept_up_, *order_, *residual_, *kept_length_, *values_, *c_, *lengths_, *guess_y_;
  double *x_, *start_, *least_, *z_, *d_scale_;
  int *kept_ids_, *E_, *S_, *leaves_, *side_, *known_;
  QP qp_;
};

}  // namespace HQP_ISA
}  // namespace hqp
