// The rows of inverse dynamics: equation of motion, torque limits, contacts, and rows on accelerations put into their places.
//
// The unknown is x = (v-dot (nv), f / unit), f three forces for each point of each contact, in the contact's axes; tau = M v-dot + h - J^T f.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "hqp_rp/rotation.hpp"

namespace hqp {

// One contact; frames are numbers into the arrays of poses, on < 0 the world.
struct ContactItem {
  int frame = 0, on = -1;
  int points = 1;          // k
  int first_force = 0;     // 3 k unknowns from here
  int rows = 6;            // of its motion: 3, 5 or 6
  int first_row = 0;       // among the motion rows of all contacts
  const double* place = nullptr;  // (k, 3) points in the frame's axes
  const double* basis = nullptr;  // (rows, 6) what of the twist in the frame's axes the points determine; not used for 6
  const double* axes = nullptr;   // (3, 3) columns x, y, z of the contact in the axes of `on`
  double kd = 0.0;
  bool open = false;
};

class TorqueRows {
 public:
  int nv = 0, forces = 0;
  double unit = 1.0;
  std::vector<ContactItem> contacts;
  const double *rotations = nullptr, *origins = nullptr, *jacobians = nullptr;  // (F, 3, 3), (F, 3), (F, 6, nv)
  const double *twists = nullptr, *biases = nullptr;                            // (F, 6)

  // point_jacobian (forces, nv): velocities of all points in their contacts' axes. motion (R, n) and rate (R,): the motion rows, zeros for
  // open contacts. Rows of `motion` are `stride` apart; what is zero stays as it is.
  void contact_rows(double* point_jacobian, double* motion, double* rate, std::ptrdiff_t stride) {
    relative_.resize(static_cast<std::size_t>(6 * nv));
    for (const ContactItem& c : contacts) {
      const double *R = rotations + 9 * c.frame, *J = jacobians + static_cast<std::ptrdiff_t>(6) * nv * c.frame;
      double twist[6], wanted[6], axes[9];
      for (int k = 0; k < 6; ++k) twist[k] = twists[6 * c.frame + k], wanted[k] = -biases[6 * c.frame + k];
      if (c.on >= 0) {
        seen_from(c, twist, wanted);
        J = relative_.data();
      }
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
          axes[3 * i + j] = c.axes[3 * i + j];
          if (c.on < 0) continue;
          const double* S = rotations + 9 * c.on;
          axes[3 * i + j] = S[3 * i] * c.axes[j] + S[3 * i + 1] * c.axes[3 + j] + S[3 * i + 2] * c.axes[6 + j];
        }
      for (int p = 0; p < c.points; ++p) {
        const double* at = c.place + 3 * p;
        double lever[3];
        for (int k = 0; k < 3; ++k) lever[k] = R[3 * k] * at[0] + R[3 * k + 1] * at[1] + R[3 * k + 2] * at[2];
        for (int i = 0; i < 3; ++i) {
          // r . (u + omega x lever) = r . u + (lever x r) . omega
          const double r[3] = {axes[i], axes[3 + i], axes[6 + i]};
          const double s[3] = {lever[1] * r[2] - lever[2] * r[1], lever[2] * r[0] - lever[0] * r[2], lever[0] * r[1] - lever[1] * r[0]};
          double* row = point_jacobian + static_cast<std::ptrdiff_t>(c.first_force + 3 * p + i) * nv;
          for (int j = 0; j < nv; ++j)
            row[j] = r[0] * J[j] + r[1] * J[nv + j] + r[2] * J[2 * nv + j] + s[0] * J[3 * nv + j] + s[1] * J[4 * nv + j] + s[2] * J[5 * nv + j];
        }
      }
      double *out = rate + c.first_row, *rows = motion + c.first_row * stride;
      if (c.open) {
        for (int i = 0; i < c.rows; ++i) out[i] = 0.0;
        continue;
      }
      for (int k = 0; k < 6; ++k) wanted[k] -= c.kd * twist[k];
      if (c.rows == 6) {
        for (int i = 0; i < 6; ++i) {
          out[i] = wanted[i];
          for (int j = 0; j < nv; ++j) rows[i * stride + j] = J[i * nv + j];
        }
        continue;
      }
      // In axes that turn with the frame: what holds a point that is not the origin still as the frame turns about it.
      const double* w = twists + 6 * c.frame + 3;
      wanted[0] += w[1] * twist[2] - w[2] * twist[1];
      wanted[1] += w[2] * twist[0] - w[0] * twist[2];
      wanted[2] += w[0] * twist[1] - w[1] * twist[0];
      for (int i = 0; i < c.rows; ++i) {
        const double* B = c.basis + 6 * i;
        double r[6];
        for (int k = 0; k < 3; ++k) {
          r[k] = R[3 * k] * B[0] + R[3 * k + 1] * B[1] + R[3 * k + 2] * B[2];
          r[3 + k] = R[3 * k] * B[3] + R[3 * k + 1] * B[4] + R[3 * k + 2] * B[5];
        }
        out[i] = 0.0;
        for (int k = 0; k < 6; ++k) out[i] += r[k] * wanted[k];
        for (int j = 0; j < nv; ++j) {
          double sum = 0.0;
          for (int k = 0; k < 6; ++k) sum += r[k] * J[k * nv + j];
          rows[i * stride + j] = sum;
        }
      }
    }
  }

  // rows (m, nv + forces) <- rows `which` (m) of [M, -J^T unit].
  void torque_rows(const double* M, const double* point_jacobian, const std::int64_t* which, std::ptrdiff_t m, double* rows) const {
    const std::ptrdiff_t n = nv + forces;
    for (std::ptrdiff_t i = 0; i < m; ++i) {
      const std::int64_t at = which[i];
      for (int j = 0; j < nv; ++j) rows[i * n + j] = M[at * nv + j];
      for (int f = 0; f < forces; ++f) rows[i * n + nv + f] = -unit * point_jacobian[static_cast<std::ptrdiff_t>(f) * nv + at];
    }
  }

 private:
  // The frame's Jacobian, twist and what is wanted of its rate, less those of the place of its origin on the surface.
  void seen_from(const ContactItem& c, double* twist, double* wanted) {
    const double *J = jacobians + static_cast<std::ptrdiff_t>(6) * nv * c.frame, *S = jacobians + static_cast<std::ptrdiff_t>(6) * nv * c.on;
    const double *V = twists + 6 * c.on, *A = biases + 6 * c.on, *w = V + 3;
    double arm[3];
    for (int k = 0; k < 3; ++k) arm[k] = origins[3 * c.frame + k] - origins[3 * c.on + k];
    for (int k = 0; k < 3; ++k) {
      const int a = (k + 1) % 3, b = (k + 2) % 3;
      for (int j = 0; j < nv; ++j) {
        relative_[k * nv + j] = J[k * nv + j] - S[k * nv + j] - (S[(3 + a) * nv + j] * arm[b] - S[(3 + b) * nv + j] * arm[a]);
        relative_[(3 + k) * nv + j] = J[(3 + k) * nv + j] - S[(3 + k) * nv + j];
      }
    }
    double apart[3], seen[6];
    for (int k = 0; k < 3; ++k) apart[k] = twist[k] - V[k];
    for (int k = 0; k < 3; ++k) {
      const int a = (k + 1) % 3, b = (k + 2) % 3;
      seen[k] = apart[k] - (w[a] * arm[b] - w[b] * arm[a]);
      seen[3 + k] = twist[3 + k] - w[k];
      wanted[k] += A[k] + (A[3 + a] * arm[b] - A[3 + b] * arm[a]) + (w[a] * apart[b] - w[b] * apart[a]);
      wanted[3 + k] += A[3 + k];
    }
    for (int k = 0; k < 6; ++k) twist[k] = seen[k];
  }

  std::vector<double> relative_;
};

}  // namespace hqp
