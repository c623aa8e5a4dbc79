// What is compiled once for each instruction set, as a table of functions; the table that this processor can run is chosen when loaded.
#pragma once

#include "hqp_rp/damping.hpp"
#include "hqp_rp/problem.hpp"
#include "hqp_rp/qp_stages.hpp"
#include "hqp_rp/tolerances.hpp"
#include "hqp_rp/workspace.hpp"

namespace hqp {

// What an active-set search is given, and what it says beside its outcome; `inaccurate` asks for the answer to be verified.
struct ActiveSetCall {
  const Problem* problem = nullptr;
  Damped damped;
  const double* z = nullptr;     // (unknowns,) what x should be near to; null means 0
  double rank_tolerance = tolerance::rank;
  int limit = 1000;              // working sets factored
  bool least_violation = false;  // go on over the points that violate contradicting hard rows least
  bool guessed = false;          // whether `side` says at which bound rows are thought to be active
  double* x = nullptr;           // (unknowns,): where to start, then the answer
  int* side = nullptr;           // (hard rows and rows,): -1, 0, +1; then the active bounds, or 1 for hard rows in conflict
  int iterations = 0;
  bool delicate = false;         // a pivot was so small that rounding may have decided which rows are active
};

// Saturation in the null space: what it is given and what it says. A level that was not finished, or that rounding kept from its scaled
// task, is named by its number; -1 for none.
struct SaturationCall {
  const Problem* problem = nullptr;  // of equalities; its hard rows are the box
  const double *low = nullptr, *high = nullptr, *zeta = nullptr;  // (unknowns,)
  double rank_tolerance = tolerance::rank;
  bool optimal = false;
  double* x = nullptr;       // (unknowns,)
  double* scales = nullptr;  // (levels,)
  int tried = 0, unfinished = -1, missed = -1;
};

// Denavit-Hartenberg rows of a serial arm, (joints,) each.
struct SerialArm {
  int joints = 0;
  const double *d = nullptr, *a = nullptr, *cos_alpha = nullptr, *sin_alpha = nullptr;
};

struct Kernels {
  const char* instruction_set;
  Outcome (*null_space)(const Problem&, const double* z, double rank_tolerance, const Damping&, double* x, Workspace&);
  Outcome (*reverse_priority)(const Problem&, const double* z, double rank_tolerance, const Damping&, double* x, Workspace&);
  Outcome (*active_set)(ActiveSetCall&, Workspace&);
  bool (*proven_optimal)(const Problem&, const double* x, const double* zeta, double accept, double rank_tolerance, Workspace&);
  QPStages* (*make_qp_cascade)(int unknowns, int hard_rows, const std::int64_t* offsets, int levels);
  // A QP's answer (t, y) refined on its active rows: M (curved, n), c (curved,), rows (m, n), bounds (m,).
  void (*polish)(const double* M, int curved, const double* c, const double* rows, const double* lower, const double* upper, int m, int n,
                 int soft, double* t, double* y, Workspace&);
  // Pose and Jacobian of a frame at Q (N, joints): rotations (N, 3, 3), origins (N, 3), jacobians (N, 6, joints).
  void (*serial_arm)(const SerialArm&, const double* Q, std::int64_t N, int frame, double* rotations, double* origins, double* jacobians,
                     Workspace&);
  bool (*saturation)(SaturationCall&, Workspace&);  // false: not finite
  // x (n,) of min ||A x - b||^2 + ||eta x||^2 for A (m, n), eta > 0.
  void (*damped_least_squares)(const double* A, const double* b, int m, int n, double eta, double* x, Workspace&);
  void (*null_space_batch)(const Batch&, double rank_tolerance, const Damping&, Workspace&);
  void (*reverse_priority_batch)(const Batch&, double rank_tolerance, const Damping&, Workspace&);
};

// The kernels for this processor. HQP_RP_ISA=baseline, v3 or v4 in the environment asks for others; one that cannot run is ignored.
const Kernels& kernels();

}  // namespace hqp
