#include "hqp_rp/proof.hpp"

#include "table.hpp"

namespace hqp {
inline namespace HQP_ISA {

bool call_proven_optimal(const Problem& problem, const double* x, const double* zeta, double accept, double rank_tolerance,
                         Workspace& workspace) {
  workspace.reserve(room(problem, 8));
  Workspace::Scope scope(workspace);
  return Proof(problem, workspace).accepts(x, zeta, accept, rank_tolerance);
}

}  // namespace HQP_ISA
}  // namespace hqp
