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
  for (j += lanes; j < width; j += lanes) (Lane::load(a + j) * s).store(v + j);
  v[column] = (alpha - beta) * scale;
  return beta;
}

// a <- a H for a reflector whose entries before `column` are zero (or whose lanes before it are not read).
template <class W>
HQP_INLINE void reflect(double* a, const double* v, int column, W width) {
  add_multiple(a, v, -dot(a, v, column, width), column, width);
}

// The same for four rows at once, whose loads of v and additions overlap.
template <class W>
HQP_INLINE void reflect_four(double* a, double* b, double* c, double* d, const double* v, int column, W width) {
  const int first = column / lanes * lanes;
  Lane w = Lane::load(v + first);
  Lane sa = Lane::load(a + first) * w, sb = Lane::load(b + first) * w;
  Lane sc = Lane::load(c + first) * w, sd = Lane::load(d + first) * w;
  for (int j = first + lanes; j < width; j += lanes) {
    w = Lane::load(v + j);
    sa = sa + Lane::load(a + j) * w;
    sb = sb + Lane::load(b + j) * w;
    sc = sc + Lane::load(c + j) * w;
    sd = sd + Lane::load(d + j) * w;
  }
  const Lane fa = Lane::all(sa.sum()), fb = Lane::all(sb.sum()), fc = Lane::all(sc.sum()), fd = Lane::all(sd.sum());
  for (int j = first; j < width; j += lanes) {
    w = Lane::load(v + j);
    (Lane::load(a + j) - fa * w).store(a + j);
    (Lane::load(b + j) - fb * w).store(b + j);
    (Lane::load(c + j) - fc * w).store(c + j);
    (Lane::load(d + j) - fd * w).store(d + j);
  }
}

// Rows i0 ... i1 - 1 of A <- A H.
template <class W>
HQP_INLINE void reflect_rows(Matrix A, int i0, int i1, const double* v, int column, W width) {
  int i = i0;
  for (; i + 4 <= i1; i += 4) reflect_four(A[i], A[i + 1], A[i + 2], A[i + 3], v, column, width);
  for (; i < i1; ++i) reflect(A[i], v, column, width);
}

// The same for `count` reflectors, row t of V from column c0 + t: a row meets all of them before the next is fetched.
template <class W>
HQP_INLINE void reflect_rows_by_all(Matrix A, int i0, int i1, Matrix V, int count, int c0, W width) {
  int i = i0;
  for (; i + 4 <= i1; i += 4)
    for (int t = 0; t < count; ++t) reflect_four(A[i], A[i + 1], A[i + 2], A[i + 3], V[t], c0 + t, width);
  for (; i < i1; ++i)
    for (int t = 0; t < count; ++t) reflect(A[i], V[t], c0 + t, width);
}

}  // namespace HQP_ISA
}  // namespace hqp
