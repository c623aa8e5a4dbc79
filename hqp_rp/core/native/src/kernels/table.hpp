// The functions that fill `Kernels`, one file for each family; all are compiled once for each instruction set, HQP_ISA.
#pragma once

#include "hqp_rp/kernels.hpp"
#include "hqp_rp/matrix.hpp"

namespace hqp {
inline namespace HQP_ISA {

Outcome call_null_space(const Problem&, const double*, double, const Damping&, double*, Workspace&);
Outcome call_reverse_priority(const Problem&, const double*, double, const Damping&, double*, Workspace&);

void call_null_space_batch(const Batch&, double, const Damping&, Workspace&);
void call_reverse_priority_batch(const Batch&, double, const Damping&, Workspace&);

Outcome call_active_set(ActiveSetCall&, Workspace&);

bool call_proven_optimal(const Problem&, const double*, const double*, double, double, Workspace&);

QPStages* make_qp_cascade(int, int, const std::int64_t*, int);

void call_polish(const double*, int, const double*, const double*, const double*, const double*, int, int, int, double*, double*, Workspace&);

void call_serial_arm(const SerialArm&, const double*, std::int64_t, int, double*, double*, double*, Workspace&);

bool call_saturation(SaturationCall&, Workspace&);

void call_damped_least_squares(const double*, const double*, int, int, double, double*, Workspace&);

// Calls with a width known to the compiler where rows fit one lane.
template <class Function>
HQP_INLINE auto with_width(int n, Function function) {
#ifndef HQP_ANY_WIDTH
  if (n <= lanes) return function(Width<lanes>{});
  if (n <= 2 * lanes) return function(Width<2 * lanes>{});
#endif
  return function(padded(n));
}

}  // namespace HQP_ISA
}  // namespace hqp
