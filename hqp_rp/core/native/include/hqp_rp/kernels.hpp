// What is compiled once for each instruction set, as a table of functions; the table that this processor can run is chosen when loaded.
#pragma once

#include "hqp_rp/damping.hpp"
#include "hqp_rp/problem.hpp"
#include "hqp_rp/workspace.hpp"

namespace hqp {

struct Kernels {
  const char* instruction_set;
  Outcome (*null_space)(const Problem&, const double* z, double rank_tolerance, const Damping&, double* x, Workspace&);
  Outcome (*reverse_priority)(const Problem&, const double* z, double rank_tolerance, const Damping&, double* x, Workspace&);
  void (*null_space_batch)(const Batch&, double rank_tolerance, const Damping&, Workspace&);
  void (*reverse_priority_batch)(const Batch&, double rank_tolerance, const Damping&, Workspace&);
};

// The kernels for this processor. HQP_RP_ISA=baseline, v3 or v4 in the environment asks for others; one that cannot run is ignored.
const Kernels& kernels();

}  // namespace hqp
