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

// What few problems need stays out of the way of the others.
#if defined(_MSC_VER) && !defined(__clang__)
#define HQP_APART __declspec(noinline)
#else
#define HQP_APART __attribute__((noinline))
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
#define HQP_SHUFFLE_TWO(v, w, ...) __builtin_shufflevector(v, w, __VA_ARGS__)
#elif defined(__GNUC__)
typedef long long RegisterIndex __attribute__((vector_size(8 * register_width)));
#define HQP_SHUFFLE(v, ...) __builtin_shuffle(v, RegisterIndex{__VA_ARGS__})
#define HQP_SHUFFLE_TWO(v, w, ...) __builtin_shuffle(v, w, RegisterIndex{__VA_ARGS__})
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

// out (8,) <- the sums of eight lanes: three rounds of pairs cost less than eight sums.
HQP_INLINE void sums(const Lane* lane, double* out) {
#if defined(HQP_SHUFFLE_TWO) && defined(__AVX512F__)
  Register pair[4], four[2];
  for (int i = 0; i < 4; ++i) {
    const Register a = lane[2 * i].part[0], b = lane[2 * i + 1].part[0];
    pair[i] = HQP_SHUFFLE_TWO(a, b, 0, 8, 2, 10, 4, 12, 6, 14) + HQP_SHUFFLE_TWO(a, b, 1, 9, 3, 11, 5, 13, 7, 15);
  }
  for (int i = 0; i < 2; ++i) {
    const Register a = pair[2 * i], b = pair[2 * i + 1];
    four[i] = HQP_SHUFFLE_TWO(a, b, 0, 1, 8, 9, 4, 5, 12, 13) + HQP_SHUFFLE_TWO(a, b, 2, 3, 10, 11, 6, 7, 14, 15);
  }
  const Register all = HQP_SHUFFLE_TWO(four[0], four[1], 0, 1, 2, 3, 8, 9, 10, 11) +
                       HQP_SHUFFLE_TWO(four[0], four[1], 4, 5, 6, 7, 12, 13, 14, 15);
  std::memcpy(out, &all, sizeof all);
#elif defined(HQP_SHUFFLE_TWO) && defined(__AVX__)
  for (int half = 0; half < 8; half += 4) {
    Register pair[2];
    for (int i = 0; i < 2; ++i) {
      const Register a = lane[half + 2 * i].part[0] + lane[half + 2 * i].part[1];
      const Register b = lane[half + 2 * i + 1].part[0] + lane[half + 2 * i + 1].part[1];
      pair[i] = HQP_SHUFFLE_TWO(a, b, 0, 4, 2, 6) + HQP_SHUFFLE_TWO(a, b, 1, 5, 3, 7);
    }
    const Register all = HQP_SHUFFLE_TWO(pair[0], pair[1], 0, 1, 4, 5) + HQP_SHUFFLE_TWO(pair[0], pair[1], 2, 3, 6, 7);
    std::memcpy(out + half, &all, sizeof all);
  }
#else
  for (int i = 0; i < 8; ++i) out[i] = lane[i].sum();
#endif
}

// Zeros before entry `column % 8`, ones from there on.
alignas(64) constexpr double from_table[16] = {0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1};
HQP_INLINE Lane ones_from(int column) { return Lane::load_anywhere(from_table + 8 - column % 8); }

}  // namespace HQP_ISA
}  // namespace hqp
