// The native core by itself: problems in, answers out, nothing allocated after the first solve of a size.
//
//   hqp::Workspace workspace;
//   hqp::Problem problem{...};                        // views of arrays that you keep
//   hqp::Outcome outcome = hqp::null_space(problem, x, workspace);
#pragma once

#include "hqp_rp/kernels.hpp"
#include "hqp_rp/tolerances.hpp"

namespace hqp {

// Null-space priority (9)-(11) on equality levels; x (unknowns,). z: a free vector, null for none.
inline Outcome null_space(const Problem& problem, double* x, Workspace& workspace, const Damping& damping = {}, const double* z = nullptr) {
  return kernels().null_space(problem, z, tolerance::rank, damping, x, workspace);
}

// Reverse priority (23)-(29) on equality levels, damped in T_k.
inline Outcome reverse_priority(const Problem& problem, double* x, Workspace& workspace, const Damping& damping = {},
                                const double* z = nullptr) {
  return kernels().reverse_priority(problem, z, tolerance::rank, damping, x, workspace);
}

// The lexicographic optimum with two-sided rows at any level and hard rows. side (hard_rows + rows,): the bounds at which rows are active,
// -1, 0 or +1; with `warm` it and x hold the last answer. `inaccurate`: solved, but near a singularity, where it should be verified.
// damped: damping rows of levels, see `Damped`.
inline Outcome active_set(const Problem& problem, double* x, int* side, Workspace& workspace, bool warm = false, const double* z = nullptr,
                          const Damped& damped = {}) {
  ActiveSetCall call;
  call.problem = &problem;
  call.damped = damped;
  call.z = z;
  call.limit = 200 + 10 * (problem.hard_rows + problem.rows);
  call.guessed = warm;
  call.x = x;
  call.side = side;
  if (!warm)
    for (int j = 0; j < problem.unknowns; ++j) x[j] = 0.0;
  return kernels().active_set(call, workspace);
}

}  // namespace hqp
