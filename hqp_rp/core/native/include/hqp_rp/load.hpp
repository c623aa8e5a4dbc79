// A level's rows loaded into padded rows, scaled by a power of two where their size would overflow when squared.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "hqp_rp/matrix.hpp"

namespace hqp {
inline namespace HQP_ISA {

// Row i of a contiguous (rows, n) matrix into a padded row; `rows_left`: rows from this one on, which may be read together.
template <class W>
HQP_INLINE void load_row(double* to, const double* from, int n, int rows_left, W width) {
  int j = 0;
  const std::ptrdiff_t readable = static_cast<std::ptrdiff_t>(n) * rows_left;
  for (; j + lanes <= n; j += lanes) Lane::load_anywhere(from + j).store(to + j);
  if (j >= width) return;
  if (j + lanes <= readable) {  // what stands behind belongs to the next row: it is read, and written as zero
    const Lane mask = Lane::all(1.0) - ones_from(n);
    (Lane::load_anywhere(from + j) * mask).store(to + j);
    return;
  }
  for (; j < n; ++j) to[j] = from[j];
  for (; j < width; ++j) to[j] = 0.0;
}

// The same times `factor`.
template <class W>
HQP_INLINE void load_scaled_row(double* to, const double* from, int n, int rows_left, double factor, W width) {
  const Lane f = Lane::all(factor);
  int j = 0;
  for (; j + lanes <= n; j += lanes) (Lane::load_anywhere(from + j) * f).store(to + j);
  if (j >= width) return;
  if (j + lanes <= static_cast<std::ptrdiff_t>(n) * rows_left) {
    (Lane::load_anywhere(from + j) * (f - ones_from(n) * f)).store(to + j);
    return;
  }
  for (; j < n; ++j) to[j] = from[j] * factor;
  for (; j < width; ++j) to[j] = 0.0;
}

// The squared length of such a row, where it stands.
HQP_INLINE double square_anywhere(const double* from, int n, int rows_left) {
  Lane s = Lane::all(0.0);
  int j = 0;
  for (; j + lanes <= n; j += lanes) {
    const Lane v = Lane::load_anywhere(from + j);
    s = s + v * v;
  }
  if (j < n && j + lanes <= static_cast<std::ptrdiff_t>(n) * rows_left) {
    const Lane v = Lane::load_anywhere(from + j) * (Lane::all(1.0) - ones_from(n));
    return (s + v * v).sum();
  }
  double total = s.sum();
  for (; j < n; ++j) total += from[j] * from[j];
  return total;
}

// The power of two that brings x, a normal number of which the inverse is one too, into [1/2, 1).
HQP_INLINE double inverse_power_of_two(double x) {
  const std::uint64_t exponent = std::bit_cast<std::uint64_t>(x) >> 52;
  return std::bit_cast<double>((2045 - exponent) << 52);
}

// A power of two that brings the largest entry of a matrix, > 0, near one without being itself out of range.
inline double scale_to_one(double largest) {
  int exponent = 0;
  std::frexp(largest, &exponent);
  return std::ldexp(1.0, exponent > 1000 ? -1000 : exponent < -1000 ? 1000 : -exponent);
}

struct Loaded {
  double scale;  // a power of two by which the rows were multiplied
  double norm;   // ||scale A_k||_F
  bool finite;
};

// The first m of `rows` rows of n numbers into A, with their norm. Their scale is 1 unless the norm is outside 1e-60 ... 1e60.
template <class W>
HQP_INLINE Loaded load_level(const double* matrix, int rows, int n, int m, Matrix A, W width) {
  Lane total = Lane::all(0.0);
  for (int i = 0; i < m; ++i) {
    load_row(A[i], matrix + static_cast<std::ptrdiff_t>(i) * n, n, rows - i, width);
    for (int j = 0; j < width; j += lanes) {
      const Lane v = Lane::load(A[i] + j);
      total = total + v * v;
    }
  }
  double square = total.sum();
  if (square > 1e-120 && square < 1e120) return {1.0, std::sqrt(square), true};
  double largest = 0.0;
  for (int i = 0; i < m; ++i)
    for (int j = 0; j < n; ++j) {
      const double a = std::fabs(matrix[static_cast<std::ptrdiff_t>(i) * n + j]);
      if (!(a < std::numeric_limits<double>::infinity())) return {1.0, a, false};
      largest = a > largest ? a : largest;
    }
  if (largest == 0.0) return {1.0, 0.0, true};
  const double scale = scale_to_one(largest);
  square = 0.0;
  for (int i = 0; i < m; ++i)
    for (int j = 0; j < width; ++j) {
      A[i][j] = j < n ? matrix[static_cast<std::ptrdiff_t>(i) * n + j] * scale : 0.0;
      square += A[i][j] * A[i][j];
    }
  return {scale, std::sqrt(square), true};
}

}  // namespace HQP_ISA
}  // namespace hqp
