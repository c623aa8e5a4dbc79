#include "hqp_rp/saturation_optimal.hpp"

#include "table.hpp"

namespace hqp {
inline namespace HQP_ISA {

bool call_saturation(SaturationCall& call, Workspace& workspace) {
  workspace.reserve(room(*call.problem, 10));
  return saturation_null_space(call, workspace);
}

}  // namespace HQP_ISA
}  // namespace hqp
