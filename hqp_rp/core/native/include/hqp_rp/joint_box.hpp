// The box on the velocity that position, velocity and acceleration limits leave; it is never empty.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

namespace hqp {

// phi(d): the signed step towards a limit at the signed distance d; a = A dt^2, or infinite.
//
// phi(d) = sign(d) min(gain |d|, X(|d|)), X(d) = d / N + a (N - 1) / 2, N = max(1, ceil((sqrt(1 + 8 d / a) - 1) / 2)).
inline double allowed_step(double distance, double gain, double a) {
  const double size = std::fabs(distance);
  double longest = size;
  if (size < std::numeric_limits<double>::infinity() && a < std::numeric_limits<double>::infinity()) {
    const double steps = std::max(1.0, std::ceil((std::sqrt(1.0 + 8.0 * size / a) - 1.0) / 2.0));
    longest = size / steps + a * (steps - 1.0) / 2.0;
  }
  return std::copysign(std::min(gain * size, longest), distance);
}

struct JointBox {
  double gain = 0.0;          // 0: positions do not count
  double least = 0.0, greatest = 0.0;  // position
  double speed = 0.0;         // V
  double acceleration = 0.0;  // A, or infinite

  // low and high of the velocity during dt, at position q and velocity v before. Acceleration yields to velocity, position to both.
  void at(double q, double v, double dt, double* low, double* high) const {
    const bool accelerated = acceleration < std::numeric_limits<double>::infinity();
    *low = -speed, *high = speed;
    if (accelerated) {
      // A velocity beyond V comes back to V at once: the clip moves both bounds there.
      const double change = acceleration * dt;
      *low = std::min(std::max(v - change, -speed), speed);
      *high = std::min(std::max(v + change, -speed), speed);
    }
    if (!(gain > 0.0)) return;
    double down = least - q, up = greatest - q;
    if (accelerated) {
      down = allowed_step(down, gain, acceleration * (dt * dt)) / dt;
      up = allowed_step(up, gain, acceleration * (dt * dt)) / dt;
    } else {
      down = down * (gain / dt), up = up * (gain / dt);
    }
    up = std::max(down, up);  // the step grows with the distance, but rounding may swap two that are equal
    const double low_before = *low, high_before = *high;
    *low = std::min(std::max(down, low_before), high_before);
    *high = std::max(std::min(up, high_before), low_before);
  }
};

}  // namespace hqp
