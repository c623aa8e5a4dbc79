#include "hqp_rp/reverse_priority.hpp"

#include "table.hpp"

namespace hqp {
inline namespace HQP_ISA {

Outcome call_reverse_priority(const Problem& problem, const double* z, double rank_tolerance, const Damping& damping, double* x,
                              Workspace& workspace) {
  return with_width(problem.unknowns,
                    [&](auto width) { return reverse_priority(problem, z, rank_tolerance, damping, x, workspace, width); });
}

}  // namespace HQP_ISA
}  // namespace hqp
