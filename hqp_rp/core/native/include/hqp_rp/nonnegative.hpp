// Least squares with non-negative unknowns, small and dense: multipliers of the right sign.
#pragma once

#include <algorithm>
#include <cmath>

#include "hqp_rp/least_squares.hpp"

namespace hqp {
inline namespace HQP_ISA {

// rest (d,) <- y - sum_i w_i c_i for a w (k,) >= 0 that makes it short, c_i the rows of C (k, d padded): any w >= 0 gives an upper
// bound. Ends where ||rest|| <= enough. Source: Lawson and Hanson 1974, algorithm NNLS, begun with the least squares of all columns.
inline void nonnegative_least_squares(Matrix C, int k, int d, const double* y, double* w, double* rest, double enough,
                                      Workspace& workspace) {
  Workspace::Scope scope(workspace);
  Matrix T = make_matrix(workspace, k, d);
  double* right = workspace.numbers(padded(d));
  double* found = workspace.numbers(k);
  double* trial = workspace.numbers(k);
  double* following = workspace.numbers(d);
  int* passive = workspace.counts(k);
  int* index = workspace.counts(k);
  // found (count,) <- least squares on the passive rows, listed in `index`; -1 where there are more of them than y has entries.
  const auto on_passive = [&]() {
    int count = 0;
    for (int i = 0; i < k; ++i)
      if (passive[i]) index[count++] = i;
    if (count > d) return -1;
    if (count == 0) return 0;
    for (int i = 0; i < count; ++i) copy(T[i], C[index[i]], T.stride);
    for (int j = 0; j < T.stride; ++j) right[j] = j < d ? y[j] : 0.0;
    tall_least_squares(T, count, d, right, found, workspace);
    return count;
  };
  const auto rest_of = [&](const double* weights, double* out) {
    for (int j = 0; j < d; ++j) out[j] = y[j];
    for (int i = 0; i < k; ++i)
      if (weights[i] > 0.0)
        for (int j = 0; j < d; ++j) out[j] -= weights[i] * C[i][j];
  };
  for (int i = 0; i < k; ++i) passive[i] = 1;
  for (;;) {  // those of negative weight are dropped until none is
    const int count = on_passive();
    if (count < 0)
      for (int i = 0; i < k; ++i) passive[i] = 0;
    for (int i = 0; i < k; ++i) w[i] = 0.0;
    bool agreed = true;
    for (int i = 0; i < count; ++i) {
      if (found[i] < 0.0)
        passive[index[i]] = 0, agreed = false;
      else
        w[index[i]] = found[i];
    }
    if (agreed) break;
  }
  rest_of(w, rest);
  const double least = tolerance::multiplier_rounding * length_of(y, d);
  for (int round = 0; round < 3 * k + 10; ++round) {
    if (length_of(rest, d) <= enough) break;
    int entering = -1;
    double most = least;
    for (int i = 0; i < k; ++i) {
      if (passive[i]) continue;
      double pull = 0.0;
      for (int j = 0; j < d; ++j) pull += C[i][j] * rest[j];
      if (pull > most) most = pull, entering = i;
    }
    if (entering < 0) break;
    passive[entering] = 1;
    for (int i = 0; i < k; ++i) trial[i] = w[i];
    int count = 0;
    for (int inner = 0; inner <= k; ++inner) {
      count = on_passive();
      if (count <= 0) break;
      double step = 1.0;
      for (int i = 0; i < count; ++i) {
        const double old = trial[index[i]];
        if (found[i] <= 0.0) step = std::min(step, old > found[i] ? old / (old - found[i]) : 0.0);
      }
      for (int i = 0; i < count; ++i) {
        double& value = trial[index[i]];
        value += step * (found[i] - value);
        if (found[i] <= 0.0 && value <= tolerance::vanished_weight * std::fabs(found[i])) value = 0.0, passive[index[i]] = 0;
      }
      if (step == 1.0 || (!passive[entering] && step == 0.0)) break;
    }
    if (count < 0) break;
    for (int i = 0; i < k; ++i) trial[i] = trial[i] > 0.0 ? trial[i] : 0.0;
    rest_of(trial, following);
    if (!(length_of(following, d) < length_of(rest, d))) break;
    for (int i = 0; i < k; ++i) w[i] = trial[i];
    for (int j = 0; j < d; ++j) rest[j] = following[j];
  }
}

}  // namespace HQP_ISA
}  // namespace hqp
