#include "hqp_rp/reverse_priority.hpp"

#include "hqp_rp/batch.hpp"
#include "table.hpp"

namespace hqp {
inline namespace HQP_ISA {

Outcome call_reverse_priority(const Problem& problem, const double* z, double rank_tolerance, const Damping& damping, double* x,
                              Workspace& workspace) {
  workspace.reserve(room(problem, 8));
  return with_width(problem.unknowns,
                    [&](auto width) { return reverse_priority(problem, z, rank_tolerance, damping, x, workspace, width); });
}

void call_reverse_priority_batch(const Batch& batch, double rank_tolerance, const Damping& damping, Workspace& workspace) {
  workspace.reserve(room(batch.shape, 16));
  const auto one = [&](const Problem& problem, const double* z, double* x) {
    return call_reverse_priority(problem, z, rank_tolerance, damping, x, workspace);
  };
  solve_batch(batch, rank_tolerance, damping.kind == Damping::none, true, one, workspace);
}

}  // namespace HQP_ISA
}  // namespace hqp
