#include <cstdlib>
#include <cstring>

#include "hqp_rp/kernels.hpp"

#if defined(HQP_X86)
#include <cpuid.h>
#endif

namespace hqp {

namespace baseline { extern const Kernels table; }
#if defined(HQP_X86)
namespace v3 { extern const Kernels table; }
namespace v4 { extern const Kernels table; }
#endif

namespace {

#if defined(HQP_X86)
// What this processor and its operating system can run: x86-64-v3 and v4, as the System V psABI lists them. Asked for directly, since what
// compilers offer for it is not initialized with all of them.
struct Processor {
  bool v3 = false, v4 = false;

  Processor() {
    unsigned a = 0, b = 0, c = 0, d = 0;
    if (!__get_cpuid(1, &a, &b, &c, &d)) return;
    const bool fma = c >> 12 & 1, movbe = c >> 22 & 1, saves = c >> 27 & 1, avx = c >> 28 & 1, f16c = c >> 29 & 1;
    if (!saves) return;
    unsigned low = 0, high = 0;
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    if (!__get_cpuid_count(7, 0, &a, &b, &c, &d)) return;
    const bool bmi1 = b >> 3 & 1, avx2 = b >> 5 & 1, bmi2 = b >> 8 & 1;
    const bool avx512 = (b >> 16 & 1) && (b >> 17 & 1) && (b >> 28 & 1) && (b >> 30 & 1) && (b >> 31 & 1);  // f, dq, cd, bw, vl
    const bool lzcnt = __get_cpuid(0x80000001, &a, &b, &c, &d) && (c >> 5 & 1);
    v3 = (low & 0x6) == 0x6 && avx && avx2 && fma && movbe && f16c && bmi1 && bmi2 && lzcnt;
    v4 = v3 && (low & 0xe6) == 0xe6 && avx512;
  }
};
#endif

const Kernels& choose() {
#if defined(HQP_X86)
  const Processor can;
  const char* asked = std::getenv("HQP_RP_ISA");
  if (asked && std::strcmp(asked, "baseline") == 0) return baseline::table;
  if (can.v3 && asked && std::strcmp(asked, "v3") == 0) return v3::table;
  if (can.v4) return v4::table;
  if (can.v3) return v3::table;
#endif
  return baseline::table;
}

}  // namespace

const Kernels& kernels() {
  static const Kernels& chosen = choose();
  return chosen;
}

}  // namespace hqp
