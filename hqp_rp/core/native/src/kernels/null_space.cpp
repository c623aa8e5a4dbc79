#include "hqp_rp/null_space.hpp"

#include "table.hpp"

namespace hqp {
inline namespace HQP_ISA {

Outcome call_null_space(const Problem& problem, const double* z, double rank_tolerance, const Damping& damping, double* x,
                        Workspace& workspace) {
  return with_width(problem.unknowns,
                    [&](auto width) { return null_space(problem, z, rank_tolerance, damping, x, workspace, width); });
}

}  // namespace HQP_ISA
}  // namespace hqp
