// Rotations (3, 3), row-major: the logarithm of SO(3), and vectors in turned axes.
#pragma once

#include <algorithm>
#include <cmath>

#include "hqp_rp/dual.hpp"
#include "hqp_rp/tolerances.hpp"

namespace hqp {

// r (3,) <- log R, with 0 <= |r| <= pi, through the largest of the four forms of the quaternion (Shepperd 1978).
inline void rotation_vector(const double* R, double* r) {
  const double a = R[0], b = R[1], c = R[2], d = R[3], e = R[4], f = R[5], g = R[6], h = R[7], i = R[8];
  const double trace = a + e + i;
  const double largest = std::max(std::max(trace, a), std::max(e, i));
  double w, x, y, z;
  // Four times the product of one quaternion component with all of them; the common factor drops out below.
  if (largest == trace)
    w = 1.0 + trace, x = h - f, y = c - g, z = d - b;
  else if (largest == a)
    w = h - f, x = 1.0 + a - e - i, y = b + d, z = c + g;
  else if (largest == e)
    w = c - g, x = b + d, y = 1.0 - a + e - i, z = f + h;
  else
    w = d - b, x = c + g, y = f + h, z = 1.0 - a - e + i;
  if (w < 0.0) w = -w, x = -x, y = -y, z = -z;
  const double sine = std::sqrt(x * x + y * y + z * z);
  // atan2(s, w) / s tends to 1 / w: where s / w is this small the next term of the series, (s / w)^2 / 3, is lost in rounding.
  const double factor = sine > tolerance::small_angle * w ? 2.0 * std::atan2(sine, w) / sine : 2.0 / w;
  r[0] = factor * x, r[1] = factor * y, r[2] = factor * z;
}

// out (3,) <- R^T v.
template <class T>
inline void to_local(const T* R, const T* v, T* out) {
  const T x = v[0], y = v[1], z = v[2];
  for (int i = 0; i < 3; ++i) out[i] = R[i] * x + R[3 + i] * y + R[6 + i] * z;
}

// r (3,) <- log(R_target R^T).
inline void rotation_error(const double* R_target, const double* R, double* r) {
  double product[9];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      product[3 * i + j] = R_target[3 * i] * R[3 * j] + R_target[3 * i + 1] * R[3 * j + 1] + R_target[3 * i + 2] * R[3 * j + 2];
  rotation_vector(product, r);
}

// The same of the values alone: no task's rows depend on the rate of this error.
inline void rotation_error(const Dual* R_target, const Dual* R, Dual* r) {
  double target[9], own[9], error[3];
  for (int i = 0; i < 9; ++i) target[i] = R_target[i].value, own[i] = R[i].value;
  rotation_error(target, own, error);
  for (int i = 0; i < 3; ++i) r[i] = error[i];
}

}  // namespace hqp
