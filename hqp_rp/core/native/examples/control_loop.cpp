// A control loop of a 7-joint arm at 1 kHz without Python: the tool follows a circle, then its orientation is kept, then a posture;
// joint velocities are bounded. Null-space priority and the active set solve the same step, and nothing is allocated on the way.
//
//   control_loop [steps]      prints the median and the 99.99th percentile of a step, and how far the tool was from its target
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "hqp_rp/hqp_rp.hpp"

namespace {

constexpr int n = 7;
constexpr double dt = 1e-3;     // s
constexpr double fastest = 1.5;  // rad/s

// A 7-joint arm with a spherical shoulder and wrist; lengths in m.
constexpr double offset[n] = {0.34, 0.0, 0.40, 0.0, 0.40, 0.0, 0.126};
constexpr double twist[n] = {-1.5707963267948966, 1.5707963267948966, 1.5707963267948966, -1.5707963267948966,
                             -1.5707963267948966, 1.5707963267948966, 0.0};

// Tool position p (3,), the direction z (3,) in which it points, and the Jacobian J (6, n), linear over angular.
void kinematics(const double* q, double* p, double* z_tool, double* J) {
  double R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, o[3] = {0, 0, 0};
  double axis[n][3], place[n][3];
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < 3; ++k) axis[i][k] = R[3 * k + 2], place[i][k] = o[k];
    const double c = std::cos(q[i]), s = std::sin(q[i]), ca = std::cos(twist[i]), sa = std::sin(twist[i]);
    for (int k = 0; k < 3; ++k) {
      const double x = R[3 * k], y = R[3 * k + 1], z = R[3 * k + 2];
      const double turned_x = c * x + s * y, turned_y = c * y - s * x;
      o[k] += offset[i] * z;
      R[3 * k] = turned_x;
      R[3 * k + 1] = ca * turned_y + sa * z;
      R[3 * k + 2] = ca * z - sa * turned_y;
    }
  }
  for (int k = 0; k < 3; ++k) p[k] = o[k], z_tool[k] = R[3 * k + 2];
  for (int i = 0; i < n; ++i) {
    const double d[3] = {p[0] - place[i][0], p[1] - place[i][1], p[2] - place[i][2]};
    for (int k = 0; k < 3; ++k) {
      J[k * n + i] = axis[i][(k + 1) % 3] * d[(k + 2) % 3] - axis[i][(k + 2) % 3] * d[(k + 1) % 3];
      J[(3 + k) * n + i] = axis[i][k];
    }
  }
}

struct Step {
  double rows[(3 + 2 + n) * n];  // position, pointing, posture
  double rate[3 + 2 + n];
  double identity[n * n], low[n], high[n];
};

}  // namespace

int main(int count, char** arguments) {
  const int steps = count > 1 ? std::atoi(arguments[1]) : 20000;
  static Step step;
  const std::int64_t offsets[] = {0, 3, 5, 5 + n};
  for (int i = 0; i < n * n; ++i) step.identity[i] = i % (n + 1) == 0;
  for (int i = 0; i < n; ++i) step.low[i] = -fastest, step.high[i] = fastest;
  hqp::Problem equalities;
  equalities.matrix = step.rows;
  equalities.lower = equalities.upper = step.rate;
  equalities.offsets = offsets;
  equalities.rows = 5 + n;
  equalities.unknowns = n;
  equalities.levels = 3;
  hqp::Problem limited = equalities;
  limited.hard_matrix = step.identity;
  limited.hard_lower = step.low;
  limited.hard_upper = step.high;
  limited.hard_rows = n;

  double q[n] = {0.2, 0.6, -0.3, -1.4, 0.1, 0.9, 0.0}, home[n];
  std::copy(q, q + n, home);
  double p[3], z[3], J[6 * n], center[3];
  kinematics(q, center, z, J);
  double direction[3] = {z[0], z[1], z[2]};

  hqp::Workspace workspace;
  double free_motion[n], x[n];
  int side[n + 5 + n] = {};
  std::vector<double> times(static_cast<std::size_t>(steps));
  int allocated = 0, failed = 0;
  double farthest = 0.0;
  for (int i = 0; i < steps; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    const double phase = 2.0 * 3.14159265358979323846 * i * dt / 4.0;
    kinematics(q, p, z, J);
    const double target[3] = {center[0] + 0.05 * (std::cos(phase) - 1.0), center[1] + 0.05 * std::sin(phase), center[2]};
    std::copy(J, J + 3 * n, step.rows);
    double error = 0.0;
    for (int k = 0; k < 3; ++k) {
      const double e = target[k] - p[k];
      error += e * e;
      step.rate[k] = 20.0 * e;
    }
    // The tool keeps pointing: of z x direction the two components across z.
    double a[3] = {std::fabs(z[0]) < 0.9 ? 1.0 : 0.0, std::fabs(z[0]) < 0.9 ? 0.0 : 1.0, 0.0};
    const double along = a[0] * z[0] + a[1] * z[1] + a[2] * z[2];
    for (int k = 0; k < 3; ++k) a[k] -= along * z[k];
    const double length = std::sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
    for (double& value : a) value /= length;
    const double b[3] = {z[1] * a[2] - z[2] * a[1], z[2] * a[0] - z[0] * a[2], z[0] * a[1] - z[1] * a[0]};
    const double turn[3] = {z[1] * direction[2] - z[2] * direction[1], z[2] * direction[0] - z[0] * direction[2],
                            z[0] * direction[1] - z[1] * direction[0]};
    for (int j = 0; j < n; ++j) {
      step.rows[3 * n + j] = a[0] * J[3 * n + j] + a[1] * J[4 * n + j] + a[2] * J[5 * n + j];
      step.rows[4 * n + j] = b[0] * J[3 * n + j] + b[1] * J[4 * n + j] + b[2] * J[5 * n + j];
    }
    step.rate[3] = 10.0 * (a[0] * turn[0] + a[1] * turn[1] + a[2] * turn[2]);
    step.rate[4] = 10.0 * (b[0] * turn[0] + b[1] * turn[1] + b[2] * turn[2]);
    std::copy(step.identity, step.identity + n * n, step.rows + 5 * n);
    for (int j = 0; j < n; ++j) step.rate[5 + j] = home[j] - q[j];

    hqp::Outcome outcome = hqp::null_space(equalities, free_motion, workspace);
    failed += outcome != hqp::Outcome::solved;
    outcome = hqp::active_set(limited, x, side, workspace, i > 0);
    if (outcome == hqp::Outcome::solved || outcome == hqp::Outcome::inaccurate)
      for (int j = 0; j < n; ++j) q[j] += dt * x[j];
    else
      ++failed;  // hold
    times[static_cast<std::size_t>(i)] = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    if (i == 0) allocated = workspace.allocations();
    if (i * dt > 1.0) farthest = std::max(farthest, std::sqrt(error));
  }
  std::sort(times.begin(), times.end());
  std::printf("%s kernels, %d steps: median %.2f us, 99.99 %% %.2f us, within %.2f mm of the target, %d failed, %d blocks allocated after the first step\n",
              hqp::kernels().instruction_set, steps, 1e6 * times[times.size() / 2],
              1e6 * times[std::min(times.size() - 1, static_cast<std::size_t>(0.9999 * static_cast<double>(times.size())))], 1e3 * farthest, failed,
              workspace.allocations() - allocated);
  return failed || workspace.allocations() != allocated || farthest > 0.02;
}
