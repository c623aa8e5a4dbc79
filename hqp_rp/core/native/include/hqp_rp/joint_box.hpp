// The box on the velocity that position, velocity and acceleration limits leave; it is never empty.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "hqp_rp/jerk_stop.hpp"

namespace hqp {

struct JointBox {
  double gain = 0.0;          // 0: positions do not count
  double least = 0.0, greatest = 0.0;  // position
  double speed = 0.0;         // V
  double acceleration = 0.0;  // A, or infinite
  double jerk = std::numeric_limits<double>::infinity();  // J

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

  // The same within J, with the acceleration `before` of the step before: jerk yields to acceleration, position to all. Where a state lets
  // the bounds of one kind contradict another's, the one that yields is clipped into the other's interval.
  void at(double q, double v, double before, double dt, double* low, double* high) const {
    if (!(jerk < std::numeric_limits<double>::infinity())) return at(q, v, dt, low, high);
    JointBox others = *this;
    others.gain = 0.0;
    others.at(q, v, dt, low, high);
    const double j = jerk * dt * dt, change = before * dt;
    const double slowest = clip(v + change - j, *low, *high), fastest = clip(v + change + j, *low, *high);
    // What c = 0 is reached from at -V or V.
    const double top = clip(v + allowed_step(speed - v, 1.0, j), slowest, fastest);
    const double bottom = std::min(clip(v - allowed_step(speed + v, 1.0, j), slowest, fastest), top);
    *low = bottom, *high = top;
    if (!(gain > 0.0)) return;
    const JerkStop brake{acceleration * dt, j};
    const double stop = clip(v - allowed_step(v, 1.0, j), bottom, top);
    const double down = (least - q) / dt, up = (greatest - q) / dt;
    // Inside, the stop must end inside; outside, it must not end before the limit, and what is left of it must not lead further out. The gain
    // asks for no more than the stop.
    *high = up >= 0.0 ? std::min(brake.largest(v, bottom, top, up), std::max(gain * up, stop))
                      : std::min(std::max(brake.smallest(v, bottom, top, up), std::min(gain * up, stop)), stop);
    *low = down <= 0.0 ? std::max(brake.smallest(v, bottom, top, down), std::min(gain * down, stop))
                       : std::max(std::min(brake.largest(v, bottom, top, down), std::max(gain * down, stop)), stop);
    if (*low > *high) *low = *high = clip(stop, *high, *low);
  }

 private:
  // nan becomes low.
  static double clip(double value, double low, double high) { return value > low ? std::min(value, high) : low; }
};

}  // namespace hqp
