// Every tolerance of the native core: what it means, and in which unit.
#pragma once

namespace hqp::tolerance {

// The distance from 1 to the next double.
constexpr double eps = 2.220446049250313e-16;

// The rank rule: a singular value of A_k restricted to the remaining freedom counts as zero when it is <= this * ||A_k||_2.
constexpr double rank = 1e-12;

// A row that is shorter than this part of ||A_k||_F after elimination holds rounding error alone: factorizations stop there.
constexpr double elimination = 64.0 * eps;

// Levels whose sizes are further apart than this ratio weigh as this far apart: what is beyond is rounding error.
constexpr double largest_ratio = 1125899906842624.0;  // 2^50

// A step that leaves less than one part in this many of what was there before shows that part's rounding error.
constexpr double cancellation = 4.0;

// Up to this condition lower rows are inverted rather than eliminated anew for each level above them.
constexpr double well_conditioned = 1e5;

}  // namespace hqp::tolerance
