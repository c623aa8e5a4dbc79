// Kinematics of a serial arm from its Denavit-Hartenberg rows, on eight configurations side by side.
#pragma once

#include <cmath>

#include "hqp_rp/batch.hpp"
#include "hqp_rp/kernels.hpp"

namespace hqp {
inline namespace HQP_ISA {

// u <- c u + s v, v <- c v - s u, each three lanes.
HQP_INLINE void turn(Lane* u, Lane* v, Lane c, Lane s) {
  for (int k = 0; k < 3; ++k) {
    const Lane old = u[k];
    u[k] = c * old + s * v[k];
    v[k] = c * v[k] - s * old;
  }
}

// Pose and Jacobian of one frame at Q (N, n). Frame i < n is fixed to link i + 1, with origin and z axis on its joint; frame n is the
// tool. Row i of the table carries frame i - 1 to frame i by Rot_z(q_i) Trans_z(d_i) Trans_x(a_i) Rot_x(alpha_i). Column k of the
// Jacobian, for a joint at or before the frame, is [z_k x (p - o_k); z_k], z_k and o_k axis and origin of joint k; zero for later ones.
// Source: Denavit and Hartenberg 1955; Siciliano, Sciavicco, Villani and Oriolo 2009, sections 2.8 and 3.1.
inline void serial_arm(const SerialArm& arm, const double* Q, std::int64_t N, int frame, double* rotations, double* origins,
                       double* jacobians, Workspace& workspace) {
  Workspace::Scope scope(workspace);
  const int n = arm.joints;
  const int moving = frame + 1 < n ? frame + 1 : n;
  Lane* axes = reinterpret_cast<Lane*>(workspace.numbers(static_cast<std::size_t>(3) * n * lanes));
  Lane* places = reinterpret_cast<Lane*>(workspace.numbers(static_cast<std::size_t>(3) * n * lanes));
  double* columns = workspace.numbers(static_cast<std::size_t>(6) * n * lanes);
  for (std::int64_t first = 0; first < N; first += lanes) {
    Lane x[3], y[3], z[3], o[3];
    for (int k = 0; k < 3; ++k) {
      x[k] = Lane::all(k == 0), y[k] = Lane::all(k == 1), z[k] = Lane::all(k == 2);
      o[k] = Lane::all(0.0);
    }
    for (int i = 0; i < moving; ++i) {
      alignas(64) double angle[lanes], c[lanes], s[lanes];
      for (int lane = 0; lane < lanes; ++lane) {
        const std::int64_t at = first + lane < N ? first + lane : N - 1;
        angle[lane] = Q[at * n + i];
      }
      for (int lane = 0; lane < lanes; ++lane) {
        c[lane] = std::cos(angle[lane]);
        s[lane] = std::sin(angle[lane]);
      }
      turn(x, y, Lane::load(c), Lane::load(s));
      for (int k = 0; k < 3; ++k) axes[3 * i + k] = z[k], places[3 * i + k] = o[k];
      if (i == frame) break;
      for (int k = 0; k < 3; ++k) o[k] = o[k] + Lane::all(arm.d[i]) * z[k] + Lane::all(arm.a[i]) * x[k];
      turn(y, z, Lane::all(arm.cos_alpha[i]), Lane::all(arm.sin_alpha[i]));
    }
    for (int k = 0; k < moving; ++k)
      for (int r = 0; r < 3; ++r) {
        const int i = (r + 1) % 3, j = (r + 2) % 3;
        const Lane* a = axes + 3 * k;
        const Lane* p = places + 3 * k;
        (a[i] * (o[j] - p[j]) - a[j] * (o[i] - p[i])).store(columns + (6 * k + r) * lanes);
        a[r].store(columns + (6 * k + 3 + r) * lanes);
      }
    alignas(64) double pose[12][lanes];
    for (int k = 0; k < 3; ++k) {
      x[k].store(pose[3 * k]), y[k].store(pose[3 * k + 1]), z[k].store(pose[3 * k + 2]);
      o[k].store(pose[9 + k]);
    }
    const int here = N - first < lanes ? static_cast<int>(N - first) : lanes;
    for (int lane = 0; lane < here; ++lane) {
      double *R = rotations + 9 * (first + lane), *p = origins + 3 * (first + lane), *J = jacobians + 6 * n * (first + lane);
      for (int k = 0; k < 9; ++k) R[k] = pose[k][lane];
      for (int k = 0; k < 3; ++k) p[k] = pose[9 + k][lane];
      for (int r = 0; r < 6; ++r)
        for (int k = 0; k < n; ++k) J[r * n + k] = k < moving ? columns[(6 * k + r) * lanes + lane] : 0.0;
    }
  }
}

}  // namespace HQP_ISA
}  // namespace hqp
