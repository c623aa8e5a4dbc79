#include "objects.hpp"

namespace hqp::python {

namespace {

// The free vector (n,), or null for None.
const double* free_vector(nb::handle secondary, int n) {
  if (secondary.is_none()) return nullptr;
  const double* z = required<double>(secondary, 1, "secondary");
  if (length_of(secondary.ptr()) != n) throw nb::value_error("secondary does not have one number for each unknown.");
  return z;
}

// A closed form with its settings.
struct ClosedForm {
  Outcome (*const solve_)(const Problem&, const double*, double, const Damping&, double*, Workspace&);
  double rank_tolerance;
  Damping damping;

  // None where the problem is not one of equalities alone: the caller refuses it in a sentence.
  nb::object solve(nb::handle problem, nb::handle secondary) const {
    const auto& given = *nb::inst_ptr<ProblemObject>(problem);
    if (!given.is_equality || given.view.hard_rows) return nb::none();
    nb::object x = new_array({given.view.unknowns});
    const Outcome outcome = solve_(given.view, free_vector(secondary, given.view.unknowns), rank_tolerance, damping, numbers_in(x), thread_workspace());
    if (outcome != Outcome::solved) x = nb::none();
    return make_solution(problem, std::move(x), outcome, 0, nb::object(), secondary.is_none() ? nb::object() : nb::borrow(secondary));
  }
};

}  // namespace

void bind_closed_forms(nb::module_& module) {
  nb::class_<ClosedForm>(module, "ClosedForm", "A closed form on equality levels, with its settings.")
      .def("solve", &ClosedForm::solve, nb::arg("problem"), nb::arg("secondary").none(),
           "Its Solution; None for a problem with hard or two-sided rows. secondary: (n,) float64, or None.");
  module.def(
      "reverse_priority",
      [](double rank_tolerance, int kind, double first, double second) {
        return ClosedForm{kernels().reverse_priority, rank_tolerance, {kind, first, second}};
      },
      nb::arg("rank_tolerance"), nb::arg("kind"), nb::arg("first"), nb::arg("second"), "Reverse priority (23)-(29), damped in T_k.");
  module.def(
      "null_space",
      [](double rank_tolerance, int kind, double first, double second) {
        return ClosedForm{kernels().null_space, rank_tolerance, {kind, first, second}};
      },
      nb::arg("rank_tolerance"), nb::arg("kind"), nb::arg("first"), nb::arg("second"), "Null-space priority (9)-(11) as an orthogonal cascade.");
}

}  // namespace hqp::python
