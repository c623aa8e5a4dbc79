#include "hqp_rp/qp_cascade.hpp"

#include "table.hpp"

namespace hqp {
inline namespace HQP_ISA {

QPStages* make_qp_cascade(int unknowns, int hard_rows, const std::int64_t* offsets, int levels) {
  return new QPCascade(unknowns, hard_rows, offsets, levels);
}

void call_polish(const double* M, int curved, const double* c, const double* rows, const double* lower, const double* upper, int m, int n,
                 int soft, double* t, double* y, Workspace& workspace) {
  Workspace::Scope scope(workspace);
  Matrix own = make_matrix(workspace, curved, n);
  for (int i = 0; i < curved; ++i)
    for (int j = 0; j < own.stride; ++j) own[i][j] = j < n ? M[static_cast<std::ptrdiff_t>(i) * n + j] : 0.0;
  polish(SlackQP{n, curved, m, soft, own, c, rows, lower, upper}, t, y, workspace);
}

}  // namespace HQP_ISA
}  // namespace hqp
