#include <cstdlib>
#include <cstring>

#include "hqp_rp/kernels.hpp"

namespace hqp {

namespace baseline { extern const Kernels table; }
#if defined(HQP_X86)
namespace v3 { extern const Kernels table; }
namespace v4 { extern const Kernels table; }
#endif

namespace {

const Kernels& choose() {
#if defined(HQP_X86)
  __builtin_cpu_init();
  const bool v3 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2");
  const bool v4 = v3 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                  __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512cd");
  const char* asked = std::getenv("HQP_RP_ISA");
  if (asked && std::strcmp(asked, "baseline") == 0) return baseline::table;
  if (v3 && asked && std::strcmp(asked, "v3") == 0) return v3::table;
  if (v4) return v4::table;
  if (v3) return v3::table;
#endif
  return baseline::table;
}

}  // namespace

const Kernels& kernels() {
  static const Kernels& chosen = choose();
  return chosen;
}

}  // namespace hqp
