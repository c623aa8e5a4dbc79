// Householder reflectors on rows, H = I - v v^T with ||v||^2 = 2: one multiplication less than with a factor beside v.
#pragma once

#include <cmath>

#include "hqp_rp/matrix.hpp"

namespace hqp {
inline namespace HQP_ISA {

// v (padded) such that H maps row a, of length `norm` from `column` on, onto beta at `column`, and leaves columns before it alone.
// Returns beta = -sign(a_column) norm. Source: Golub and Van Loan 2013, algorithm 5.1.1; scaled so that v v^T needs no factor.
template <class W>
HQP_INLINE double make_reflector(const double* a, int column, double norm, double* v, W width) {
  const double alpha = a[column];
  const double beta = alpha >= 0.0 ? -norm : norm;
  const double scale = 1.0 / std::sqrt(norm * (norm + std::fabs(alpha)));  // 1 / sqrt(beta (beta - alpha))
  const Lane s = Lane::all(scale);
  int j = column / lanes * lanes;
  (Lane::load(a + j) * ones_from(column) * s).store(v + j);
  if (j > 0) Lane::all(0.0).store(v + j - lanes);  // reflectors of neighbouring columns are applied together
  for (j += lanes; j < width; j += lanes) (Lane::load(a + j) * s).store(v + j);
  v[column] = (alpha - beta) * scale;
  return beta;
}

// a <- a H for a reflector whose entries before `column` are zero (or whose lanes before it are not read).
template <class W>
HQP_INLINE void reflect(double* a, const double* v, int column, W width) {
  add_multiple(a, v, -dot(a, v, column, width), column, width);
}

// v <- Q^T v for Q = H_1 H_2 ..., `count` reflectors, row l of V at column c0 + l.
template <class W>
HQP_INLINE void apply_q_transpose(double* v, Matrix V, int count, int c0, W width) {
  for (int l = 0; l < count; ++l) reflect(v, V[l], c0 + l, width);
}

// v <- Q v.
template <class W>
HQP_INLINE void apply_q(double* v, Matrix V, int count, int c0, W width) {
  for (int l = count - 1; l >= 0; --l) reflect(v, V[l], c0 + l, width);
}

// Rows rows of A from row i on <- themselves times H, at once: their loads of v and additions overlap.
template <int Rows, class W>
HQP_INLINE void reflect_together(Matrix A, int i, const double* v, int column, W width) {
  const int first = column / lanes * lanes;
  Lane s[Rows];
  Lane w = Lane::load(v + first);
  for (int r = 0; r < Rows; ++r) s[r] = Lane::load(A[i + r] + first) * w;
  for (int j = first + lanes; j < width; j += lanes) {
    w = Lane::load(v + j);
    for (int r = 0; r < Rows; ++r) s[r] = s[r] + Lane::load(A[i + r] + j) * w;
  }
  for (int r = 0; r < Rows; ++r) s[r] = Lane::all(s[r].sum());
  for (int j = first; j < width; j += lanes) {
    w = Lane::load(v + j);
    for (int r = 0; r < Rows; ++r) (Lane::load(A[i + r] + j) - s[r] * w).store(A[i + r] + j);
  }
}

// Rows i ... i1 - 1 (fewer than four) of A <- A H_1 H_2 ..., reflector l of V at column c0 + l, for l = t ... count - 1.
template <class W>
HQP_INLINE void reflect_rest(Matrix A, int i, int i1, Matrix V, int t, int count, int c0, W width) {
  if (i1 - i == 3) {
    for (int l = t; l < count; ++l) reflect_together<3>(A, i, V[l], c0 + l, width);
  } else if (i1 - i == 2) {
    for (int l = t; l < count; ++l) reflect_together<2>(A, i, V[l], c0 + l, width);
  } else if (i < i1) {
    for (int l = t; l < count; ++l) reflect(A[i], V[l], c0 + l, width);
  }
}

// Rows i0 ... i1 - 1 of A <- A H.
template <class W>
HQP_INLINE void reflect_rows(Matrix A, int i0, int i1, const double* v, int column, W width) {
  int i = i0;
  for (; i + 4 <= i1; i += 4) reflect_together<4>(A, i, v, column, width);
  reflect_rest(A, i, i1, Matrix{const_cast<double*>(v), 0}, 0, 1, column, width);
}

// Rows a and b <- themselves times H_1 H_2 H_3 H_4, v1 ... v4 from neighbouring columns, the first of them `column`;
// g: their products v_i . v_j. Source: Bischof and Van Loan 1987, with the small triangle applied to each row's products.
template <class W>
HQP_INLINE void reflect_two_by_four(double* a, double* b, const double* v1, const double* v2, const double* v3, const double* v4,
                                    const double* g, int column, W width) {
  const int first = column / lanes * lanes;
  Lane s[8];
  for (int i = 0; i < 8; ++i) s[i] = Lane::all(0.0);
  for (int j = first; j < width; j += lanes) {
    const Lane x = Lane::load(a + j), y = Lane::load(b + j);
    Lane v = Lane::load(v1 + j);
    s[0] = s[0] + x * v, s[4] = s[4] + y * v;
    v = Lane::load(v2 + j);
    s[1] = s[1] + x * v, s[5] = s[5] + y * v;
    v = Lane::load(v3 + j);
    s[2] = s[2] + x * v, s[6] = s[6] + y * v;
    v = Lane::load(v4 + j);
    s[3] = s[3] + x * v, s[7] = s[7] + y * v;
  }
  double product[8];
  sums(s, product);
  const double a1 = product[0], b1 = product[4];
  const double a2 = product[1] - g[0] * a1, b2 = product[5] - g[0] * b1;
  const double a3 = product[2] - g[1] * a1 - g[3] * a2, b3 = product[6] - g[1] * b1 - g[3] * b2;
  const double a4 = product[3] - g[2] * a1 - g[4] * a2 - g[5] * a3, b4 = product[7] - g[2] * b1 - g[4] * b2 - g[5] * b3;
  const Lane fa1 = Lane::all(a1), fa2 = Lane::all(a2), fa3 = Lane::all(a3), fa4 = Lane::all(a4);
  const Lane fb1 = Lane::all(b1), fb2 = Lane::all(b2), fb3 = Lane::all(b3), fb4 = Lane::all(b4);
  for (int j = first; j < width; j += lanes) {
    const Lane p = Lane::load(v1 + j), q = Lane::load(v2 + j), r = Lane::load(v3 + j), u = Lane::load(v4 + j);
    (Lane::load(a + j) - fa1 * p - fa2 * q - fa3 * r - fa4 * u).store(a + j);
    (Lane::load(b + j) - fb1 * p - fb2 * q - fb3 * r - fb4 * u).store(b + j);
  }
}

// Rows i0 ... i1 - 1 of A <- A H_1 H_2 ... for `count` reflectors, row t of V from column c0 + t. Wide rows meet four at a time.
template <class W>
HQP_INLINE void reflect_rows_by_all(Matrix A, int i0, int i1, Matrix V, int count, int c0, W width) {
  int t = 0;
  if (width > 2 * lanes && i1 - i0 > 1) {
    for (; t + 4 <= count; t += 4) {
      const double *v1 = V[t], *v2 = V[t + 1], *v3 = V[t + 2], *v4 = V[t + 3];
      const int c = c0 + t;
      const double g[6] = {dot(v1, v2, c + 1, width), dot(v1, v3, c + 2, width), dot(v1, v4, c + 3, width),
                           dot(v2, v3, c + 2, width), dot(v2, v4, c + 3, width), dot(v3, v4, c + 3, width)};
      int i = i0;
      for (; i + 2 <= i1; i += 2) reflect_two_by_four(A[i], A[i + 1], v1, v2, v3, v4, g, c, width);
      for (; i < i1; ++i)
        for (int l = t; l < t + 4; ++l) reflect(A[i], V[l], c0 + l, width);
    }
  }
  int i = i0;
  for (; i + 4 <= i1; i += 4)
    for (int l = t; l < count; ++l) reflect_together<4>(A, i, V[l], c0 + l, width);
  reflect_rest(A, i, i1, V, t, count, c0, width);
}

}  // namespace HQP_ISA
}  // namespace hqp
