// Views of matrices whose rows are padded with zeros to whole lanes, and what is done to their rows.
#pragma once

#include "hqp_rp/lane.hpp"
#include "hqp_rp/workspace.hpp"

namespace hqp {
inline namespace HQP_ISA {

// Columns of a padded row.
constexpr int padded(int n) { return (n + lanes - 1) / lanes * lanes; }

// A row-major matrix whose rows begin on a cache line.
struct Matrix {
  double* data = nullptr;
  int stride = 0;
  HQP_INLINE double* operator[](int i) const { return data + static_cast<std::ptrdiff_t>(i) * stride; }
  HQP_INLINE Matrix below(int rows) const { return {(*this)[rows], stride}; }
};

HQP_INLINE Matrix make_matrix(Workspace& workspace, int rows, int columns) {
  const int stride = padded(columns);
  return {workspace.numbers(static_cast<std::size_t>(rows) * stride), stride};
}

// The loops below run over lanes `first / 8` to `width / 8`; a `Width` that is known when compiled (8, 16) unrolls them.
template <int Columns>
struct Width {
  HQP_INLINE constexpr operator int() const { return Columns; }
};

template <class W>
HQP_INLINE void fill(double* HQP_RESTRICT a, double value, W width) {
  const Lane v = Lane::all(value);
  for (int j = 0; j < width; j += lanes) v.store(a + j);
}

template <class W>
HQP_INLINE void copy(double* HQP_RESTRICT to, const double* HQP_RESTRICT from, W width) {
  for (int j = 0; j < width; j += lanes) Lane::load(from + j).store(to + j);
}

// a . b from the lane that holds column `first` on.
template <class W>
HQP_INLINE double dot(const double* a, const double* b, int first, W width) {
  int j = first / lanes * lanes;
  Lane s = Lane::load(a + j) * Lane::load(b + j);
  for (j += lanes; j < width; j += lanes) s = s + Lane::load(a + j) * Lane::load(b + j);
  return s.sum();
}

// out[r] <- row i + r of A . b for eight rows, at most `rows` of which there are: the last stands in for those behind it.
template <class W>
HQP_INLINE void eight_dots(Matrix A, int i, int rows, const double* b, double* out, W width) {
  const double* row[lanes];
  Lane s[lanes];
  const Lane first = Lane::load(b);
  for (int r = 0; r < lanes; ++r) {
    row[r] = A[i + r < rows ? i + r : rows - 1];
    s[r] = Lane::load(row[r]) * first;
  }
  for (int j = lanes; j < width; j += lanes) {
    const Lane x = Lane::load(b + j);
    for (int r = 0; r < lanes; ++r) s[r] = s[r] + Lane::load(row[r] + j) * x;
  }
  sums(s, out);
}

// a . b for n numbers of which only b stands on a boundary of 64 bytes.
HQP_INLINE double dot_anywhere(const double* a, const double* b, int n) {
  int j = 0;
  Lane s = Lane::all(0.0);
  for (; j + lanes <= n; j += lanes) s = s + Lane::load_anywhere(a + j) * Lane::load(b + j);
  double total = s.sum();
  for (; j < n; ++j) total += a[j] * b[j];
  return total;
}

// The same one number after the other, for vectors that are short and stand anywhere.
inline double product(const double* a, const double* b, int n) {
  double s = 0.0;
  for (int j = 0; j < n; ++j) s += a[j] * b[j];
  return s;
}
inline double length_of(const double* v, int n) { return std::sqrt(product(v, v, n)); }

// ||a[first:]||^2.
template <class W>
HQP_INLINE double square_from(const double* a, int first, W width) {
  int j = first / lanes * lanes;
  if (j >= width) return 0.0;
  Lane v = Lane::load(a + j) * ones_from(first);
  Lane s = v * v;
  for (j += lanes; j < width; j += lanes) {
    v = Lane::load(a + j);
    s = s + v * v;
  }
  return s.sum();
}

// a[first:] <- 0.
template <class W>
HQP_INLINE void clear_from(double* a, int first, W width) {
  int j = first / lanes * lanes;
  if (j >= width) return;
  (Lane::load(a + j) * (Lane::all(1.0) - ones_from(first))).store(a + j);
  for (j += lanes; j < width; j += lanes) Lane::all(0.0).store(a + j);
}

// a += factor b from the lane that holds column `first` on.
template <class W>
HQP_INLINE void add_multiple(double* a, const double* b, double factor, int first, W width) {
  const Lane f = Lane::all(factor);
  for (int j = first / lanes * lanes; j < width; j += lanes) (Lane::load(a + j) + f * Lane::load(b + j)).store(a + j);
}

template <class W>
HQP_INLINE void scale_row(double* a, double factor, W width) {
  const Lane f = Lane::all(factor);
  for (int j = 0; j < width; j += lanes) (Lane::load(a + j) * f).store(a + j);
}

template <class W>
HQP_INLINE void swap_rows(double* a, double* b, W width) {
  for (int j = 0; j < width; j += lanes) {
    const Lane v = Lane::load(a + j);
    Lane::load(b + j).store(a + j);
    v.store(b + j);
  }
}

// Row r of C (rows, columns) <- sum_j A[r][j] B[j], for j < inner; C is not A or B.
template <class W>
HQP_INLINE void multiply(Matrix C, Matrix A, Matrix B, int rows, int inner, W width) {
  constexpr int block = 4;  // lanes of two rows that stay in registers
  for (int l0 = 0; l0 < width; l0 += block * lanes) {
    const int wide = width - l0 < block * lanes ? (width - l0) / lanes : block;
    for (int i = 0; i < rows; i += 2) {
      const double *a = A[i], *b = A[i + 1 < rows ? i + 1 : i];
      Lane s[2 * block];
      for (int l = 0; l < 2 * block; ++l) s[l] = Lane::all(0.0);
      for (int j = 0; j < inner; ++j) {
        const Lane x = Lane::all(a[j]), y = Lane::all(b[j]);
        const double* row = B[j] + l0;
        for (int l = 0; l < block; ++l) {
          if (l >= wide) break;
          const Lane v = Lane::load(row + l * lanes);
          s[l] = s[l] + x * v;
          s[block + l] = s[block + l] + y * v;
        }
      }
      for (int l = 0; l < wide; ++l) s[l].store(C[i] + l0 + l * lanes);
      for (int l = 0; l < wide && i + 1 < rows; ++l) s[block + l].store(C[i + 1] + l0 + l * lanes);
    }
  }
}

// Zero times anything finite is zero; times nan or infinity it is nan, which no sum loses.
HQP_INLINE bool finite(const double* x, int n) {
  Lane part = Lane::all(0.0);
  int j = 0;
  for (; j + lanes <= n; j += lanes) part = part + Lane::load_anywhere(x + j) * Lane::all(0.0);
  double total = part.sum();
  for (; j < n; ++j) total += 0.0 * x[j];
  return total == 0.0;
}

}  // namespace HQP_ISA
}  // namespace hqp
