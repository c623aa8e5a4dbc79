#include <utility>

#include "objects.hpp"

namespace hqp::python {

namespace {

// A closed form with its settings.
struct ClosedForm {
  Outcome (*const solve_)(const Problem&, const double*, double, const Damping&, double*, Workspace&);
  void (*const solve_batch_)(const Batch&, double, const Damping&, Workspace&);
  double rank_tolerance;
  Damping damping;

  // Fills x (N, n) and codes (N,) without the interpreter's lock.
  void solve_many(nb::handle matrix, nb::handle rhs, nb::handle offsets, nb::handle secondary, nb::handle x, nb::handle codes) const {
    Batch batch;
    batch.matrix = required<double>(matrix, 3, "matrix");
    batch.rhs = required<double>(rhs, 2, "rhs");
    batch.shape.offsets = required<std::int64_t>(offsets, 1, "offsets");
    batch.x = writable<double>(x, 2, "x");
    batch.codes = static_cast<unsigned char*>(data_of(codes.ptr(), NPY_UINT8, 1));
    batch.count = length_of(matrix.ptr());
    batch.shape.rows = static_cast<int>(length_of(matrix.ptr(), 1));
    batch.shape.unknowns = static_cast<int>(length_of(matrix.ptr(), 2));
    batch.shape.levels = static_cast<int>(length_of(offsets.ptr()) - 1);
    const double* free = required<double>(secondary, 2, "secondary");
    const Py_ssize_t given = length_of(secondary.ptr());
    const bool fit = batch.codes && length_of(rhs.ptr()) == batch.count && length_of(rhs.ptr(), 1) == batch.shape.rows &&
                     length_of(x.ptr()) == batch.count && length_of(x.ptr(), 1) == batch.shape.unknowns &&
                     length_of(codes.ptr()) == batch.count && batch.shape.levels > 0 && batch.shape.offsets[0] == 0 &&
                     batch.shape.offsets[batch.shape.levels] == batch.shape.rows &&
                     length_of(secondary.ptr(), 1) == batch.shape.unknowns && (given == 1 || given == batch.count);
    if (!fit) throw nb::value_error("The arrays of the batch do not fit together.");
    bool any = false;
    for (Py_ssize_t i = 0; i < given * batch.shape.unknowns && !any; ++i) any = free[i] != 0.0;
    batch.free = any ? free : nullptr;
    batch.free_step = given == 1 ? 0 : batch.shape.unknowns;
    nb::gil_scoped_release released;
    solve_batch_(batch, rank_tolerance, damping, thread_workspace());
  }

  // The problems one after the other, so many times, without Python: what a benchmark times. x (N, n).
  void loop(nb::handle matrix, nb::handle rhs, nb::handle offsets, nb::handle x, int repeats) const {
    Problem problem;
    const double *A = required<double>(matrix, 3, "matrix"), *b = required<double>(rhs, 2, "rhs");
    problem.offsets = required<std::int64_t>(offsets, 1, "offsets");
    double* out = writable<double>(x, 2, "x");
    const Py_ssize_t N = length_of(matrix.ptr()), M = length_of(matrix.ptr(), 1), n = length_of(matrix.ptr(), 2);
    problem.rows = static_cast<int>(M), problem.unknowns = static_cast<int>(n), problem.levels = static_cast<int>(length_of(offsets.ptr()) - 1);
    if (length_of(rhs.ptr()) != N || length_of(rhs.ptr(), 1) != M || length_of(x.ptr()) != N || length_of(x.ptr(), 1) != n)
      throw nb::value_error("The arrays do not fit together.");
    for (int repeat = 0; repeat < repeats; ++repeat)
      for (Py_ssize_t i = 0; i < N; ++i) {
        problem.matrix = A + i * M * n;
        problem.lower = problem.upper = b + i * M;
        solve_(problem, nullptr, rank_tolerance, damping, out + i * n, thread_workspace());
      }
  }

  // None where the problem is not one of equalities alone, undamped: the caller refuses it in a sentence, or knows another way.
  nb::object solve(nb::handle problem, nb::handle secondary) const {
    const auto& given = *nb::inst_ptr<ProblemObject>(problem);
    if (!given.is_equality || given.view.hard_rows || !given.damping.is_none() || !given.metric.is_none()) return nb::none();
    nb::object x = new_array({given.view.unknowns});
    const Outcome outcome = solve_(given.view, secondary_in(secondary, given.view.unknowns), rank_tolerance, damping, numbers_in(x), thread_workspace());
    if (outcome != Outcome::solved) x = nb::none();
    return make_solution(problem, std::move(x), outcome, 0, nb::object(), secondary.is_none() ? nb::object() : nb::borrow(secondary));
  }
};

}  // namespace

void bind_closed_forms(nb::module_& module) {
  auto closed_form = nb::class_<ClosedForm>(module, "ClosedForm", "A closed form on equality levels, with its settings.")
      .def("solve", &ClosedForm::solve, nb::arg("problem"), nb::arg("secondary").none(),
           "Its Solution; None for a problem with hard or two-sided rows, with damping or with a metric. secondary: (n,) float64, or None.");
  closed_form.def("solve_many", &ClosedForm::solve_many, nb::arg("matrix"), nb::arg("rhs"), nb::arg("offsets"), nb::arg("secondary"),
                  nb::arg("x"), nb::arg("codes"),
                  "Solve N problems of one shape: (N, M, n), (N, M), (p + 1,), (N or 1, n); fills x (N, n) and codes (N,) uint8.");
  closed_form.def("loop", &ClosedForm::loop, nb::arg("matrix"), nb::arg("rhs"), nb::arg("offsets"), nb::arg("x"), nb::arg("repeats"),
                  "Solve (N, M, n), (N, M), (p + 1,) one by one into x (N, n), so many times: for benchmarks.");
  module.def(
      "reverse_priority",
      [](double rank_tolerance, int kind, double first, double second) {
        return ClosedForm{kernels().reverse_priority, kernels().reverse_priority_batch, rank_tolerance, {kind, first, second}};
      },
      nb::arg("rank_tolerance"), nb::arg("kind"), nb::arg("first"), nb::arg("second"), "Reverse priority (23)-(29), damped in T_k.");
  module.def(
      "null_space",
      [](double rank_tolerance, int kind, double first, double second) {
        return ClosedForm{kernels().null_space, kernels().null_space_batch, rank_tolerance, {kind, first, second}};
      },
      nb::arg("rank_tolerance"), nb::arg("kind"), nb::arg("first"), nb::arg("second"), "Null-space priority (9)-(11) as an orthogonal cascade.");
}

}  // namespace hqp::python
