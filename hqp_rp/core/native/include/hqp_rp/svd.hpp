// Singular values of small matrices by one-sided Jacobi rotations, to high relative accuracy.
#pragma once

#include <cmath>

#include "hqp_rp/householder.hpp"
#include "hqp_rp/problem.hpp"
#include "hqp_rp/damping.hpp"
#include "hqp_rp/tolerances.hpp"

namespace hqp {
inline namespace HQP_ISA {

// Turns the rows of T (r, m padded) until they are orthogonal: row j becomes sigma_j u_j^T, longest first, and V (r, r), if given,
// holds in row j the combination of T's rows that it is: with T = L^T, L = U S V^T and V[j] the j-th right singular vector.
// Source: Hestenes 1958; de Rijk 1989 for the order; Demmel and Veselic 1992 for the accuracy.
template <class W>
HQP_INLINE void orthogonalize_rows(Matrix T, int r, Matrix V, double* sigma, W width) {
  const int v_width = V.data ? V.stride : 0;
  for (int i = 0; i < r && V.data; ++i) {
    for (int j = 0; j < V.stride; ++j) V[i][j] = i == j ? 1.0 : 0.0;
  }
  for (int sweep = 0; sweep < 60; ++sweep) {
    bool turned = false;
    for (int i = 0; i < r - 1; ++i) {
      int longest = i;
      double most = square_from(T[i], 0, width);
      for (int j = i + 1; j < r; ++j) {
        const double s = square_from(T[j], 0, width);
        if (s > most) most = s, longest = j;
      }
      if (longest != i) {
        swap_rows(T[i], T[longest], width);
        if (V.data) swap_rows(V[i], V[longest], v_width);
      }
      for (int j = i + 1; j < r; ++j) {
        const double a = square_from(T[i], 0, width);
        const double b = square_from(T[j], 0, width);
        const double c = dot(T[i], T[j], 0, width);
        if (!(std::fabs(c) > tolerance::eps * std::sqrt(a) * std::sqrt(b)) || c == 0.0) continue;
        turned = true;
        const double zeta = (b - a) / (2.0 * c);
        const double t = (zeta >= 0.0 ? 1.0 : -1.0) / (std::fabs(zeta) + std::hypot(1.0, zeta));
        const double cosine = 1.0 / std::hypot(1.0, t);
        const double sine = cosine * t;
        const Lane co = Lane::all(cosine), si = Lane::all(sine);
        for (int l = 0; l < width; l += lanes) {
          const Lane p = Lane::load(T[i] + l), q = Lane::load(T[j] + l);
          (co * p - si * q).store(T[i] + l);
          (si * p + co * q).store(T[j] + l);
        }
        for (int l = 0; l < v_width; l += lanes) {
          const Lane p = Lane::load(V[i] + l), q = Lane::load(V[j] + l);
          (co * p - si * q).store(V[i] + l);
          (si * p + co * q).store(V[j] + l);
        }
      }
    }
    if (!turned) break;
  }
  for (int i = 0; i < r; ++i) sigma[i] = std::sqrt(square_from(T[i], 0, width));
}

// How many of r falling singular values exceed `zero`.
inline int count_above(const double* sigma, int r, double zero) {
  int count = 0;
  while (count < r && sigma[count] > zero) ++count;
  return count;
}

// ||A||_2 of `rows` rows (padded); A is left as it is.
inline double spectral(const double* data, int rows, int columns, int stride, Workspace& workspace) {
  Workspace::Scope scope(workspace);
  const bool wide = rows <= columns;
  const int r = wide ? rows : columns;
  const int m = wide ? columns : rows;
  if (r == 0) return 0.0;
  Matrix T = make_matrix(workspace, r, m);
  double* sigma = workspace.numbers(r);
  for (int i = 0; i < r; ++i)
    for (int j = 0; j < T.stride; ++j)
      T[i][j] = j >= m ? 0.0 : wide ? data[static_cast<std::ptrdiff_t>(i) * stride + j] : data[static_cast<std::ptrdiff_t>(j) * stride + i];
  orthogonalize_rows(T, r, Matrix{}, sigma, T.stride);
  double largest = 0.0;
  for (int i = 0; i < r; ++i) largest = largest > sigma[i] ? largest : sigma[i];
  return largest;
}

// eta of sigma / (sigma^2 + eta^2) for r falling singular values; of filtering that of the last one. `full`: these are all, so that the
// last one is sigma_m of (19); otherwise further ones are zero.
inline double damping_factor(const Damping& damping, const double* sigma, int r, bool full) {
  const double unit = damping.unit;
  if (damping.kind == Damping::constant) return damping.first * unit;
  if (damping.kind == Damping::variable || damping.kind == Damping::filtering) {
    const double ratio = full && r ? sigma[r - 1] / (damping.first * unit) : 0.0;
    return ratio >= 1.0 ? 0.0 : std::sqrt((1.0 - ratio) * (1.0 + ratio)) * damping.second * unit;
  }
  if (damping.kind == Damping::manipulability) {
    double w = full ? 1.0 : 0.0;
    for (int i = 0; i < r; ++i) w *= sigma[i] / unit;
    return w >= damping.first ? 0.0 : (1.0 - w / damping.first) * damping.second * unit;
  }
  return 0.0;
}

// sigma / (sigma^2 + factor^2), without squaring a large number; sigma > 0.
inline double damped_inverse(double sigma, double factor) {
  if (sigma > factor) {
    const double ratio = factor / sigma;
    return 1.0 / (sigma * (1.0 + ratio * ratio));
  }
  const double ratio = sigma / factor;
  return ratio / (factor * (1.0 + ratio * ratio));
}

}  // namespace HQP_ISA
}  // namespace hqp
