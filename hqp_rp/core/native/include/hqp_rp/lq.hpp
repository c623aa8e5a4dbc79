// Row-pivoted LQ factorization with a decision on rank: A Q = [L 0], Q = H_1 H_2 ... from Householder reflectors.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "hqp_rp/householder.hpp"
#include "hqp_rp/tolerances.hpp"

namespace hqp {
inline namespace HQP_ISA {

// ||rows r0 ... r1 - 1||_F of a loaded matrix.
template <class W>
HQP_INLINE double frobenius(Matrix A, int r0, int r1, W width) {
  double s = 0.0;
  for (int i = r0; i < r1; ++i) s += square_from(A[i], 0, width);
  return std::sqrt(s);
}

// Factors rows r0 ... r1 - 1 within columns c0 ... n - 1, in place: row r0 + j ends as L's row, zero behind column c0 + j.
//
// The longest remaining row is next; it stops where every one is no longer than `floor`. Rows change places together with their
// entries of `companion` (rows,). Reflector j goes to V[j]. Returns how many there are.
// Source: Golub and Van Loan 2013, 5.4.2 (its transpose); lengths are brought up to date as in LAPACK's xLAQPS.
template <class W>
HQP_INLINE int lq(Matrix A, int r0, int r1, int c0, int n, double* companion, double floor, Matrix V, double* lengths, W width) {
  int steps = std::min(r1 - r0, n - c0);
  // lengths[i]: squared, of what is left of row i; lengths[i + r1]: when it was last computed afresh.
  for (int i = r0; i < r1; ++i) lengths[2 * i] = lengths[2 * i + 1] = square_from(A[i], c0, width);
  for (int j = 0; j < steps; ++j) {
    const int c = c0 + j;
    const int top = r0 + j;
    int best = top;
    for (int i = top + 1; i < r1; ++i)
      if (lengths[2 * i] > lengths[2 * best]) best = i;
    const double norm = std::sqrt(j ? square_from(A[best], c, width) : lengths[2 * best]);
    if (!(norm > floor)) {
      steps = j;
      break;
    }
    if (best != top) {
      swap_rows(A[top], A[best], width);
      std::swap(companion[top], companion[best]);
      std::swap(lengths[2 * top], lengths[2 * best]);
      std::swap(lengths[2 * top + 1], lengths[2 * best + 1]);
    }
    double* a = A[top];
    double* v = V[j];
    const double beta = make_reflector(a, c, norm, v, width);
    clear_from(a, c, width);
    a[c] = beta;
    reflect_rows(A, top + 1, r1, v, c, width);
    for (int i = top + 1; i < r1; ++i) {
      lengths[2 * i] -= A[i][c] * A[i][c];
      if (!(lengths[2 * i] > tolerance::stale_length * lengths[2 * i + 1])) lengths[2 * i] = lengths[2 * i + 1] = square_from(A[i], c + 1, width);
    }
  }
  // Where it stopped early, what is left of the other rows is rounding error.
  if (steps < std::min(r1 - r0, n - c0))
    for (int i = r0 + steps; i < r1; ++i)
      clear_from(A[i], c0 + steps, width);
  return steps;
}

// T (r, m padded) <- L^T for L (m, r), which `lq` left in rows r0 ... r0 + m - 1 of A from column c0 on.
inline void transpose_triangle(Matrix T, Matrix A, int r0, int m, int c0, int r) {
  for (int j = 0; j < r; ++j)
    for (int i = 0; i < T.stride; ++i) T[j][i] = i >= j && i < m ? A[r0 + i][c0 + j] : 0.0;
}

// ||L^-1||_F, whose inverse is a rigorous bound below the smallest singular value of the leading r x r triangle. `column` (r,).
HQP_INLINE double inverse_norm(Matrix L, int r0, int c0, int r, double* column) {
  double total = 0.0;
  for (int j = 0; j < r; ++j) {
    for (int i = j; i < r; ++i) {
      const double* row = L[r0 + i] + c0;
      double s = i == j ? 1.0 : 0.0;
      for (int l = j; l < i; ++l) s -= row[l] * column[l];
      column[i] = s / row[i];
      total += column[i] * column[i];
    }
  }
  return std::sqrt(total);
}

// A rigorous bound above ||L^-1||_2 for the leading r x r triangle in r^2 operations: |L^-1| <= M(L)^-1 entry by entry, M(L) the
// comparison matrix. Source: Higham 2002, theorem 8.12. `y` (r,).
HQP_INLINE double inverse_bound(Matrix L, int r0, int c0, int r, double* y) {
  double largest = 0.0;
  for (int i = 0; i < r; ++i) {
    const double* row = L[r0 + i] + c0;
    double s = 1.0;
    for (int l = 0; l < i; ++l) s += std::fabs(row[l]) * y[l];
    y[i] = s / std::fabs(row[i]);
    largest = std::max(largest, y[i]);
  }
  return std::sqrt(static_cast<double>(r)) * largest;
}

struct Factored {
  int reflectors;   // and columns of L
  bool proven;      // no singular value counts as zero
  double smallest;  // of |L_jj|
};

// `lq` of rows r0 ... r1 - 1, and whether its triangle proves that no singular value is <= tol * norm, norm = ||A_k||_F before any
// transformation (so that the rule, which has ||A_k||_2, holds a fortiori).
template <class W>
HQP_INLINE Factored factor_level(Matrix A, int r0, int r1, int c0, int n, double* companion, double norm, double tol, Matrix V,
                                 double* lengths, W width) {
  const int m = r1 - r0;
  if (m == 0 || c0 >= n || norm == 0.0) return {0, true, std::numeric_limits<double>::infinity()};
  const double floor = std::min(tolerance::elimination, tol / std::sqrt(static_cast<double>(std::min(m, n)))) * norm;
  const int r = lq(A, r0, r1, c0, n, companion, floor, V, lengths, width);
  double smallest = std::numeric_limits<double>::infinity();
  for (int i = 0; i < r; ++i) smallest = std::min(smallest, std::fabs(A[r0 + i][c0 + i]));
  if (r == 0) return {0, true, smallest};
  // Pivoting leaves |L_ij| <= |L_jj| (up to rounding, hence 2), so that ||L^-1||_2 <= sqrt(4^r + 6 r - 1) / (3 min |L_jj|)
  // (Higham 2002, theorem 8.14).
  if (r <= 30 && 2.0 * tol * norm * std::sqrt(std::ldexp(1.0, 2 * r) + 6.0 * r - 1.0) < 3.0 * smallest) return {r, true, smallest};
  if (tol * norm * inverse_bound(A, r0, c0, r, lengths) < 1.0) return {r, true, smallest};
  return {r, tol * norm * inverse_norm(A, r0, c0, r, lengths) < 1.0, smallest};
}

}  // namespace HQP_ISA
}  // namespace hqp
