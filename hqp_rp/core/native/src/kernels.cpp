// Compiled once for each instruction set: HQP_ISA names it, and the compiler's flags make it.
#include "hqp_rp/kernels.hpp"

#include "hqp_rp/null_space.hpp"

namespace hqp {
inline namespace HQP_ISA {
namespace {

// Calls with a width known to the compiler where rows fit one or two lanes.
template <class Function>
HQP_INLINE auto with_width(int n, Function function) {
  if (n <= lanes) return function(Width<lanes>{});
  if (n <= 2 * lanes) return function(Width<2 * lanes>{});
  return function(padded(n));
}

Outcome call_null_space(const Problem& problem, const double* z, double rank_tolerance, const Damping& damping, double* x,
                        Workspace& workspace) {
  return with_width(problem.unknowns,
                    [&](auto width) { return null_space(problem, z, rank_tolerance, damping, x, workspace, width); });
}

}  // namespace

#define HQP_TEXT_OF(name) #name
#define HQP_TEXT(name) HQP_TEXT_OF(name)

extern const Kernels table;
const Kernels table{HQP_TEXT(HQP_ISA), call_null_space};

}  // namespace HQP_ISA
}  // namespace hqp
