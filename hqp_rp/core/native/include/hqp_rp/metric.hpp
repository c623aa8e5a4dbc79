// The change of variables y = R x of a metric W = R^T R.
#pragma once

#include <cmath>
#include <cstddef>

namespace hqp {

// R (n, n) upper triangular with W = R^T R, and its inverse; false where W is not positive definite. Only the upper triangle of W counts.
inline bool metric_root(const double* W, int n, double* R, double* inverse) {
  const auto at = [n](int i, int j) { return static_cast<std::ptrdiff_t>(i) * n + j; };
  for (std::ptrdiff_t i = 0; i < static_cast<std::ptrdiff_t>(n) * n; ++i) R[i] = inverse[i] = 0.0;
  for (int i = 0; i < n; ++i) {
    for (int j = i; j < n; ++j) R[at(i, j)] = W[at(i, j)];
    for (int k = 0; k < i; ++k) {
      const double r = R[at(k, i)];
      if (r != 0.0)
        for (int j = i; j < n; ++j) R[at(i, j)] -= r * R[at(k, j)];
    }
    const double pivot = R[at(i, i)];
    if (!(pivot > 0.0) || !std::isfinite(pivot)) return false;
    const double scale = 1.0 / std::sqrt(pivot);
    R[at(i, i)] = std::sqrt(pivot);
    for (int j = i + 1; j < n; ++j) R[at(i, j)] *= scale;
  }
  // R inverse = I, the last row first.
  for (int i = n - 1; i >= 0; --i) {
    const double scale = 1.0 / R[at(i, i)];
    if (!std::isfinite(scale)) return false;
    inverse[at(i, i)] = scale;
    for (int k = i + 1; k < n; ++k) {
      const double r = R[at(i, k)] * scale;
      if (r != 0.0)
        for (int j = k; j < n; ++j) inverse[at(i, j)] -= r * inverse[at(k, j)];
    }
  }
  return true;
}

}  // namespace hqp
