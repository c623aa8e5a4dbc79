// Every tolerance of the native core: what it means, and in which unit.
#pragma once

namespace hqp::tolerance {

// The distance from 1 to the next double.
constexpr double eps = 2.220446049250313e-16;

// The rank rule: a singular value of A_k restricted to the remaining freedom counts as zero when it is <= this * ||A_k||_2.
constexpr double rank = 1e-12;

// A row that is shorter than this part of ||A_k||_F after elimination holds rounding error alone: factorizations stop there.
constexpr double elimination = 64.0 * eps;

// A squared length that has been brought up to date is computed afresh below this part of what it was.
constexpr double stale_length = 1e-6;

// Levels whose sizes are further apart than this ratio weigh as this far apart: what is beyond is rounding error.
constexpr double largest_ratio = 1125899906842624.0;  // 2^50

// A step that leaves less than one part in this many of what was there before shows that part's rounding error.
constexpr double cancellation = 4.0;

// Up to this condition lower rows are inverted rather than eliminated anew for each level above them.
constexpr double well_conditioned = 1e5;

// --- active set -----------------------------------------------------------------------------------------------------------

// What rounding may add to the value of a row, as a part of ||a_i|| ||x|| + |bound|.
constexpr double row_rounding = 64.0 * eps;

// A row of a damped level that misses its bound by more than this part of ||a_i|| ||x|| + |bound| keeps the value it has.
constexpr double reached = 1e-12;

// An answer that passes a hard row by more than this part of ||a_i|| ||x|| + |bound| is not called solved.
constexpr double hard_kept = 1e-10;

// Rows of a level whose lengths are further apart than this: what a long one misses by can balance what a short one misses by, although
// it is less than the rounding error of the long row's value.
constexpr double uneven = 100.0;

// Rows at their bound that could hide this part of a level's pull behind their rounding error are not all counted.
constexpr double hidden_pull = 1e-6;

// Where rounding may move a row of an uneven level by this part of ||a_i|| ||x|| + |bound|, the answer is verified.
constexpr double hidden_row = 1e-9;

// A step shorter than this part of ||x|| is rounding error.
constexpr double step_rounding = 4.0 * eps;

// A multiplier of the wrong sign below this part of the level's residual is rounding error.
constexpr double multiplier_rounding = 1e-13;

// As often as the search has made as many steps of length zero as there are unknowns, a multiplier has to be this much more wrong to
// count, and at most so much: what goes round in circles is rounding error.
constexpr double idle_doubt = 10.0;
constexpr double largest_doubt = 1e6;
constexpr double largest_slack = 1e3;  // of bland_slack

// A kept row of length one is held beside rows that are all met when this much of it is left in the freedom behind them.
constexpr double apart = 1e-3;

// A kept row of which less than this part is free depends on the working set.
constexpr double depends = 1e-12;

// After a step of length zero has repeated, a row this near to its bound blocks (Bland's rule), as a part of its size.
constexpr double bland_slack = 1e-12;

// What of a row's bound counts as its size there.
constexpr double bland_bound = 1e-3;

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

// --- quick proof that an answer is optimal ----------------------------------------------------------------------------------

// What a move d costs, beside what it removes from a level: this times ||A_k|| ||d||, as in `certify`.
constexpr double step_cost = 1e-5;

// Half of the least that `certify` allows for what rounding turns.
constexpr double proof_noise = 8.0 * eps;

// Rows of a level of which ||a_i|| ||x|| + |bound_i| are further apart than this are judged by themselves too, as in `certify`.
constexpr double far_targets = 1e6;

// A multiplier above this part of its level's pull keeps its row at the bound for every later level.
constexpr double firm = 1e-4;

// What is left of a row's normal, of length one, when judged levels hold it already.
constexpr double short_normal = 1e-9;

// What is left of a firm row's normal, of length one, when it depends on rows that are fixed already.
constexpr double dependent_normal = 1e-10;

// Rows this near to a bound, relative, count as active whatever tolerance is asked for.
constexpr double near_bound = 1e-9;

// A weight that a step has brought to this part of what it was is zero.
constexpr double vanished_weight = 1e-15;

// --- cascade of QPs ---------------------------------------------------------------------------------------------------------

// Up to this condition a level's own triangle is the QP's curvature as it is; beyond, its singular directions are scaled.
constexpr double qp_condition = 100.0;

// Singular directions are scaled up to this part of the largest singular value, by at most `qp_largest_scale`, so that kept rows do not
// blow up near a singularity.
constexpr double qp_scaled = 1e-2;
constexpr double qp_largest_scale = 1e3;

// A kept row, of length one, with no more than this left in the free directions is rounding noise.
constexpr double qp_unfelt = 1e-10;

// The same once a stage is finished: such a row is used up.
constexpr double qp_used_up = 1e-12;

// A row whose multiplier or violation in a QP of size one exceeds this stays where it is at later levels.
constexpr double qp_strong = 1e-6;

// Polishing: multipliers and violations above this count as active at first; rounding of rows, relative to their terms; rows of length
// one that depend on others; the rank of the least squares; how far active rows may miss; how much worse the objective may become.
constexpr double polish_active = 1e-7;
constexpr double polish_feasible = 1e-13;
constexpr double polish_dependent = 1e-10;
constexpr double polish_rank = 1e-12;
constexpr double polish_missed = 1e-11;
constexpr double polish_worse = 1e-7;

// A bound at or beyond this is none: the convention of ProxQP and OSQP.
constexpr double no_bound = 1e20;

// --- rows of tasks ---------------------------------------------------------------------------------------------------------

// Half angles below this, in rad, have a series whose second term is lost in rounding.
constexpr double small_angle = 1e-9;

// --- saturation in the null space --------------------------------------------------------------------------------------------

// What rounding may add to an unknown, as a part of its size.
constexpr double saturation_slack = 1e-12;

// An unknown below this counts as of this size there.
constexpr double smallest_unknown = 1e-30;

// Saturated unknowns whose rows, of length at most one, leave no more than this beside each other depend on each other.
constexpr double saturation_dependent = 1e-10;

// A row of which no more than this share is new counts as a combination of the others.
constexpr double saturation_combination = 1e-9;

// An unknown that changes by no more than this part of a step does not move.
constexpr double saturation_still = 1e-14;

// A slope below this is none.
constexpr double no_slope = 1e-300;

// What a solved level may be off its scaled task: this times ||A_k||_F ||x|| + ||b_k||, the tolerance that the solver declares.
constexpr double saturation_missed = 1e-9;

// --- batches ---------------------------------------------------------------------------------------------------------------

// A problem with a singular value below this part of its level's norm is solved by itself, with pivoting: rounding shows there.
constexpr double side_by_side = 1e-6;

}  // namespace hqp::tolerance
