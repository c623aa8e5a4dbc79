// The native halves of hqp_rp.Problem and hqp_rp.Solution.
#pragma once

#include "hqp_rp/kernels.hpp"
#include "numpy_array.hpp"

namespace hqp::python {

// The arrays of a problem and a view of them. Hard rows stand on top of the levels' rows in the same arrays, or apart.
struct ProblemObject {
  hqp::Problem view;
  nb::object matrix, lower, upper, offsets;      // as they were given: with hard rows on top where `on_top`
  nb::object names;                              // of the levels
  nb::object hard;                               // the Level that was given apart, or None
  nb::object damping;                            // one policy or None for each level, or None where no level is damped
  nb::object metric;                             // W (n, n), or None
  nb::object kept;                               // what the Python side has made of it once, by name
  bool on_top = false;                           // whether the first rows of the arrays are the hard ones
  bool is_equality = false;                      // of every row of every level

  ProblemObject(nb::object matrix, nb::object lower, nb::object upper, nb::object offsets, nb::object names, int hard_rows,
                nb::object hard, bool is_equality, nb::object damping, nb::object metric);
};

struct SolutionObject {
  nb::object problem, x, status, message, secondary, held, kept;
  std::int64_t iterations = 0;
};

// A Solution of the Python class. outcome: its position in Status.
nb::object make_solution(nb::handle problem, nb::object x, Outcome outcome, std::int64_t iterations = 0);
nb::object make_solution(nb::handle problem, nb::object x, Outcome outcome, std::int64_t iterations, nb::object message,
                         nb::object secondary);

// The workspace of the calling thread: a solver that keeps nothing else may be shared by any number of threads.
inline Workspace& thread_workspace() {
  static thread_local Workspace workspace;
  return workspace;
}

void bind_objects(nb::module_& module);
void bind_closed_forms(nb::module_& module);
void bind_active_set(nb::module_& module);
void bind_qp_cascade(nb::module_& module);
void bind_task_rows(nb::module_& module);
void bind_torque_rows(nb::module_& module);
void bind_saturation(nb::module_& module);

}  // namespace hqp::python
