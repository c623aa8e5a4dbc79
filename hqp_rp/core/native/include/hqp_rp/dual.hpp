// Numbers with a derivative: what is computed from them is differentiated along.
#pragma once

#include <cmath>

namespace hqp {

struct Dual {
  double value = 0.0, rate = 0.0;
  Dual() = default;
  Dual(double v) : value(v) {}
  Dual(double v, double r) : value(v), rate(r) {}
};

inline Dual operator+(Dual a, Dual b) { return {a.value + b.value, a.rate + b.rate}; }
inline Dual operator-(Dual a, Dual b) { return {a.value - b.value, a.rate - b.rate}; }
inline Dual operator-(Dual a) { return {-a.value, -a.rate}; }
inline Dual operator*(Dual a, Dual b) { return {a.value * b.value, a.rate * b.value + a.value * b.rate}; }
inline Dual operator/(Dual a, Dual b) {
  const double q = a.value / b.value;
  return {q, (a.rate - q * b.rate) / b.value};
}
inline Dual& operator+=(Dual& a, Dual b) { return a = a + b; }
inline Dual& operator-=(Dual& a, Dual b) { return a = a - b; }
inline Dual& operator*=(Dual& a, Dual b) { return a = a * b; }
inline bool operator>(Dual a, double b) { return a.value > b; }
inline bool operator!=(Dual a, double b) { return a.value != b; }
inline bool operator==(Dual a, double b) { return a.value == b; }
inline Dual sqrt(Dual a) {
  const double root = std::sqrt(a.value);
  return {root, root > 0.0 ? 0.5 * a.rate / root : 0.0};
}
inline Dual hypot(Dual a, Dual b) { return sqrt(a * a + b * b); }
inline Dual atan2(Dual y, Dual x) {
  const double square = x.value * x.value + y.value * y.value;
  return {std::atan2(y.value, x.value), square > 0.0 ? (x.value * y.rate - y.value * x.rate) / square : 0.0};
}

}  // namespace hqp
