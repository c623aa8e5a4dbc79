#include <algorithm>

#include "hqp_rp/least_squares.hpp"

#include "table.hpp"

namespace hqp {
inline namespace HQP_ISA {

void call_damped_least_squares(const double* A, const double* b, int m, int n, double eta, double* x, Workspace& workspace) {
  Workspace::Scope scope(workspace);
  const int rows = m + n;
  Matrix T = make_matrix(workspace, n, rows);  // [A; eta I] transposed
  double* right = workspace.numbers(T.stride);
  std::fill(right, right + T.stride, 0.0);
  std::copy(b, b + m, right);
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < m; ++i) T[j][i] = A[static_cast<std::ptrdiff_t>(i) * n + j];
    for (int i = m; i < T.stride; ++i) T[j][i] = i == m + j ? eta : 0.0;
  }
  tall_least_squares(T, n, rows, right, x, workspace);
}

}  // namespace HQP_ISA
}  // namespace hqp
