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

// --- active set -----------------------------------------------------------------------------------------------------------

// What rounding may add to the value of a row, as a part of ||a_i|| ||x|| + |bound|.
constexpr double row_rounding = 64.0 * eps;

// A step shorter than this part of ||x|| is rounding error.
constexpr double step_rounding = 4.0 * eps;

// A multiplier of the wrong sign below this part of the level's residual is rounding error.
constexpr double multiplier_rounding = 1e-13;

// A kept row of length one is held beside rows that are all met when this much of it is left in the freedom behind them.
constexpr double apart = 1e-3;

// A kept row of which less than this part is free depends on the working set.
constexpr double depends = 1e-12;

// After a step of length zero has repeated, a row this near to its bound blocks (Bland's rule), as a part of its size.
constexpr double bland_slack = 1e-12;

// A step shorter than this part of ||x|| counts as one of length zero.
constexpr double idle = 1e-13;

// x has come from so far (in lengths of what it is now) that values of rows carry the rounding of where it was.
constexpr double afar = 16.0;

// Hard rows that their least violation still misses by more than this, relative, contradict each other; by less, it is no proof.
constexpr double contradiction = 1e-9;

// An answer with a pivot (of rows of length about one) below this is verified before it is called solved.
constexpr double delicate = 1e-6;

// A warm start that met a pivot below this is solved once more without it: rounding might have decided differently.
constexpr double delicate_warm = 1e-4;

// Of the guess by the strictly convex level: weight of directions that the level does not see, what counts as violated and as
// dependent in units of a row's length, and where elimination ends as a part of the level's norm.
constexpr double guess_weight = 1e-4;
constexpr double guess_violated = 1e-9;
constexpr double guess_dependent = 1e-12;
constexpr double guess_elimination = 1e-8;

}  // namespace hqp::tolerance
