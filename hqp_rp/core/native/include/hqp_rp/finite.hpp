// Whether numbers are finite, in sums that do not wait for one another.
#pragma once

#include <cstddef>

namespace hqp {

// Zero times anything finite is zero; times nan or infinity it is nan, which no sum loses.
inline bool all_finite(const double* x, std::ptrdiff_t count) {
  double part[8] = {};
  std::ptrdiff_t i = 0;
  for (; i + 8 <= count; i += 8)
    for (int k = 0; k < 8; ++k) part[k] += 0.0 * x[i + k];
  for (; i < count; ++i) part[0] += 0.0 * x[i];
  return ((part[0] + part[4]) + (part[1] + part[5])) + ((part[2] + part[6]) + (part[3] + part[7])) == 0.0;
}

}  // namespace hqp
