// Eight numbers side by side: the unit in which rows are padded and loops run, whatever the processor's registers hold.
//
// Plain C++ with the vector types that g++ and clang share; elsewhere loops that a compiler may vectorize. Everything here is
// compiled once for each instruction set, in a namespace of its own (HQP_ISA), so that no linker mixes them.
#pragma once

#include <cmath>
#include <cstring>

#ifndef HQP_ISA
#define HQP_ISA baseline
#endif

#if defined(_MSC_VER)
#define HQP_INLINE __forceinline
#define HQP_RESTRICT __restrict
#else
#define HQP_INLINE inline __attribute__((always_inline))
#define HQP_RESTRICT __restrict__
#endif

namespace hqp {
inline namespace HQP_ISA {

constexpr int lanes = 8;

#if defined(__AVX512F__)
constexpr int register_width = 8;
#elif defined(__AVX__)
constexpr int register_width = 4;
#else
constexpr int register_width = 2;
#endif
constexpr int registers = lanes / register_width;

#if defined(__GNUC__) || defined(__clang__)
typedef double Register __attribute__((vector_size(8 * register_width)));
#else
struct Register {
  double v[register_width];
  double& operator[](int i) { return v[i]; }
  double operator[](int i) const { return v[i]; }
};
HQP_INLINE Register operator+(Register a, Register b) { for (int i = 0; i < register_width; ++i) a.v[i] += b.v[i]; return a; }
HQP_INLINE Register operator-(Register a, Register b) { for (int i = 0; i < register_width; ++i) a.v[i] -= b.v[i]; return a; }
HQP_INLINE Register operator*(Register a, Register b) { for (int i = 0; i < register_width; ++i) a.v[i] *= b.v[i]; return a; }
HQP_INLINE Register operator/(Register a, Register b) { for (int i = 0; i < register_width; ++i) a.v[i] /= b.v[i]; return a; }
#endif

// Eight doubles.
struct Lane {
  Register part[registers];

  HQP_INLINE static Lane load(const double* p) {  // p on a boundary of 64 bytes
    Lane out;
    for (int i = 0; i < registers; ++i) out.part[i] = reinterpret_cast<const Register*>(p)[i];
    return out;
  }
  HQP_INLINE static Lane load_anywhere(const double* p) {
    Lane out;
    std::memcpy(&out, p, sizeof(Lane));
    return out;
  }
  HQP_INLINE static Lane all(double value) {
    Lane out;
    for (int i = 0; i < registers; ++i)
      for (int j = 0; j < register_width; ++j) out.part[i][j] = value;
    return out;
  }
  HQP_INLINE void store(double* p) const {
    for (int i = 0; i < registers; ++i) reinterpret_cast<Register*>(p)[i] = part[i];
  }
  HQP_INLINE double sum() const;
};

HQP_INLINE Lane operator+(Lane a, Lane b) { for (int i = 0; i < registers; ++i) a.part[i] = a.part[i] + b.part[i]; return a; }
HQP_INLINE Lane operator-(Lane a, Lane b) { for (int i = 0; i < registers; ++i) a.part[i] = a.part[i] - b.part[i]; return a; }
HQP_INLINE Lane operator*(Lane a, Lane b) { for (int i = 0; i < registers; ++i) a.part[i] = a.part[i] * b.part[i]; return a; }
HQP_INLINE Lane operator/(Lane a, Lane b) { for (int i = 0; i < registers; ++i) a.part[i] = a.part[i] / b.part[i]; return a; }

#if defined(__clang__)
#define HQP_SHUFFLE(v, ...) __builtin_shufflevector(v, v, __VA_ARGS__)
#elif defined(__GNUC__)
typedef long long RegisterIndex __attribute__((vector_size(8 * register_width)));
#define HQP_SHUFFLE(v, ...) __builtin_shuffle(v, RegisterIndex{__VA_ARGS__})
#endif

HQP_INLINE double Lane::sum() const {
  Register s = part[0];
  for (int i = 1; i < registers; ++i) s = s + part[i];
#if defined(HQP_SHUFFLE) && defined(__AVX512F__)
  s = s + HQP_SHUFFLE(s, 4, 5, 6, 7, 0, 1, 2, 3);
  s = s + HQP_SHUFFLE(s, 2, 3, 0, 1, 6, 7, 4, 5);
  s = s + HQP_SHUFFLE(s, 1, 0, 3, 2, 5, 4, 7, 6);
  return s[0];
#elif defined(HQP_SHUFFLE) && defined(__AVX__)
  s = s + HQP_SHUFFLE(s, 2, 3, 0, 1);
  return s[0] + s[1];
#else
  double total = 0.0;
  for (int i = 0; i < register_width; ++i) total += s[i];
  return total;
#endif
}

// Zeros before entry `column % 8`, ones from there on.
alignas(64) constexpr double from_table[16] = {0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1};
HQP_INLINE Lane ones_from(int column) { return Lane::load_anywhere(from_table + 8 - column % 8); }

}  // namespace HQP_ISA
}  // namespace hqp
