// Braking to rest within a bound on the change of acceleration, one step at a time, and how far that still goes.
//
// In units of one step: u the velocity, c its change in the last step, a = A dt the largest change, j = J dt^2 the largest change of the
// change, distances over dt. The stop is one rule,
//
//   c <- clip(-X(u), c - j, c + j) clipped to [-a, a],   u <- u + c,
//
// with X the longest step of `allowed_step` at j. It never reverses what is left once c has come to rest, e = u + (|c| - j) + (|c| - 2j) + ...
// with the sign of c: e keeps its sign, and the stop ends at u = c = 0 after finitely many steps.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

namespace hqp {

// N: after how many steps, each by a shorter than the one before, the rest at the distance d > 0 is reached; both finite.
inline double steps_to_rest(double d, double a) { return std::max(1.0, std::ceil((std::sqrt(1.0 + 8.0 * d / a) - 1.0) / 2.0)); }

// phi(d): the signed step towards a limit at the signed distance d; a = A dt^2, or infinite.
//
// phi(d) = sign(d) min(gain |d|, X(|d|)), X(d) = d / N + a (N - 1) / 2, N = max(1, ceil((sqrt(1 + 8 d / a) - 1) / 2)).
inline double allowed_step(double distance, double gain, double a) {
  const double size = std::fabs(distance);
  double longest = size;
  if (size < std::numeric_limits<double>::infinity() && a < std::numeric_limits<double>::infinity()) {
    const double steps = steps_to_rest(size, a);
    longest = size / steps + a * (steps - 1.0) / 2.0;
  }
  return std::copysign(std::min(gain * size, longest), distance);
}

struct JerkStop {
  double a = 0.0, j = 0.0;  // > 0, may be infinite

  // c of the next step of the stop.
  double next(double u, double c) const {
    return std::clamp(std::clamp(-allowed_step(u, 1.0, j), c - j, c + j), -a, a);
  }

  // The most that the position, over dt, comes to lie above where it is, while the stop goes on from u and c; >= 0.
  //
  // For a finite j. It grows with u and with c: of two stops, the one with the larger u and c has the larger u at every step.
  double rise(double u, double c) const {
    const double size = std::fabs(c), whole = std::floor(size / j), U = u / j, s = c / j;
    if (u + std::copysign(whole * size - j * whole * (whole + 1.0) / 2.0, c) < 0.0) {
      if (u <= 0.0) return 0.0;
      // Braked too hard to stop above 0: c goes up by j, and the top is where u + k c + j k (k + 1) / 2 becomes negative.
      const double b = -(s + 0.5), root = std::sqrt(std::max(0.0, b * b - 2.0 * U));
      return travelled(u, c, j, std::floor(2.0 * U / (b + root)));
    }
    // Full steps of c - j while what is left allows, then full steps of -a, then c = -X(u), -X(u) + j, ...
    const double S = std::ceil(s), part = S - s, left = U + S * (S - 1.0) / 2.0 - part * S;
    const double wanted = S + std::floor(std::sqrt(std::max(0.0, part * part + left)) - part);
    const double most = std::floor((c + a) / j), falling = std::max(0.0, std::min(wanted, most));
    double total = travelled(u, c, -j, falling);
    u += falling * (c - j * (falling + 1.0) / 2.0);
    if (wanted >= most) {
      const double m = std::floor(a / j), last = (m + 1.0) * (a - j * m / 2.0);  // of a, a - j, ...
      if (u >= last) {
        const double held = std::floor((u - last) / a) + 1.0;
        total += travelled(u, -a, 0.0, held);
        u -= held * a;
      }
    }
    const double steps = steps_to_rest(std::fabs(u), j);
    return std::max(0.0, total + (steps - 1.0) / 2.0 * (u - j * steps * (steps + 1.0) / 6.0));
  }

  // The largest u in [low, high] after which the stop rises no more than `distance` above where the step began; before: u of the step
  // before. low where none is.
  double largest(double before, double low, double high, double distance) const {
    const auto beyond = [&](double u) { return u + rise(u, u - before) - distance; };
    double above = beyond(high);
    if (above <= 0.0) return high;
    double below = beyond(low);
    if (!(below <= 0.0)) return low;
    // False position with halved ends, and bisection now and then; what is returned is on the safe side.
    constexpr double epsilon = std::numeric_limits<double>::epsilon();
    const double width = epsilon * (high - low), close = 2.0 * epsilon * std::fabs(distance);
    double left = below;  // at low; below and above are what the secant takes for it
    int side = 0;
    for (int i = 1; i < 100 && high - low > width && left < -close; ++i) {
      double u = i % 4 ? low - below * ((high - low) / (above - below)) : 0.5 * (low + high);
      if (!(u > low && u < high)) u = 0.5 * (low + high);
      const double value = beyond(u);
      if (value <= 0.0) {
        if (side < 0) above *= 0.5;
        low = u, left = below = value, side = -1;
      } else {
        if (side > 0) below *= 0.5;
        high = u, above = value, side = 1;
      }
    }
    return low;
  }

  double smallest(double before, double low, double high, double distance) const {
    return -largest(-before, -high, -low, -distance);
  }

 private:
  // The sum of u + k c + d k (k + 1) / 2 over k = 1 ... n.
  static double travelled(double u, double c, double d, double n) {
    return n * (u + (n + 1.0) / 2.0 * (c + d * (n + 2.0) / 3.0));
  }
};

}  // namespace hqp
