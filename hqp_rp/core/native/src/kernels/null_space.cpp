#include "hqp_rp/null_space.hpp"

#include "hqp_rp/batch.hpp"
#include "table.hpp"

namespace hqp {
inline namespace HQP_ISA {

Outcome call_null_space(const Problem& problem, const double* z, double rank_tolerance, const Damping& damping, double* x,
                        Workspace& workspace) {
  workspace.reserve(room(problem, 4));
  return with_width(problem.unknowns,
                    [&](auto width) { return null_space(problem, z, rank_tolerance, damping, x, workspace, width); });
}

void call_null_space_batch(const Batch& batch, double rank_tolerance, const Damping& damping, Workspace& workspace) {
  workspace.reserve(room(batch.shape, 16));
  const auto one = [&](const Problem& problem, const double* z, double* x) {
    return call_null_space(problem, z, rank_tolerance, damping, x, workspace);
  };
  solve_batch(batch, rank_tolerance, damping.kind == Damping::none, false, one, workspace);
}

}  // namespace HQP_ISA
}  // namespace hqp
