#include <utility>

#include "hqp_rp/finite.hpp"
#include "hqp_rp/metric.hpp"
#include "objects.hpp"

#include <nanobind/stl/string.h>

namespace hqp::python {

namespace {

// What Python registers when hqp_rp is imported: the classes that solvers return, and the members of Status.
struct Registered {
  PyObject* solution = nullptr;
  PyObject* status[6] = {};
  PyObject* no_message = nullptr;
};
Registered registered;

}  // namespace

ProblemObject::ProblemObject(nb::object matrix_, nb::object lower_, nb::object upper_, nb::object offsets_, nb::object names_,
                             int hard_rows, nb::object hard_, bool is_equality_, nb::object damping_, nb::object metric_)
    : matrix(std::move(matrix_)), lower(std::move(lower_)), upper(std::move(upper_)), offsets(std::move(offsets_)),
      names(std::move(names_)), hard(std::move(hard_)), damping(std::move(damping_)),
      metric(std::move(metric_)), kept(nb::none()), on_top(hard_rows > 0), is_equality(is_equality_) {
  const double* A = required<double>(matrix, 2, "matrix");
  const double* low = required<double>(lower, 1, "lower");
  const double* up = required<double>(upper, 1, "upper");
  const std::int64_t* starts = required<std::int64_t>(offsets, 1, "offsets");
  const Py_ssize_t rows = length_of(matrix.ptr()), n = length_of(matrix.ptr(), 1), p = length_of(offsets.ptr()) - 1;
  bool fit = length_of(lower.ptr()) == rows && length_of(upper.ptr()) == rows && n > 0 && p > 0 && hard_rows >= 0 &&
             starts[0] == 0 && starts[p] == rows - hard_rows;
  for (Py_ssize_t k = 0; fit && k < p; ++k) fit = starts[k] <= starts[k + 1];
  if (!fit) throw nb::value_error("matrix, lower, upper and offsets do not fit together.");
  const std::ptrdiff_t above = static_cast<std::ptrdiff_t>(hard_rows) * n;
  view.matrix = A + above;
  view.lower = low + hard_rows;
  view.upper = up + hard_rows;
  view.offsets = starts;
  view.rows = static_cast<int>(rows - hard_rows);
  view.unknowns = static_cast<int>(n);
  view.levels = static_cast<int>(p);
  view.hard_matrix = A;
  view.hard_lower = low;
  view.hard_upper = up;
  view.hard_rows = hard_rows;
  if (!hard.is_none()) {  // a Level of its own
    nb::object hard_A = hard.attr("A"), hard_low = hard.attr("lower"), hard_up = hard.attr("upper");
    view.hard_matrix = required<double>(hard_A, 2, "hard.A");
    view.hard_lower = required<double>(hard_low, 1, "hard.lower");
    view.hard_upper = required<double>(hard_up, 1, "hard.upper");
    view.hard_rows = static_cast<int>(length_of(hard_A.ptr()));
    if (length_of(hard_A.ptr(), 1) != n || length_of(hard_low.ptr()) != view.hard_rows || length_of(hard_up.ptr()) != view.hard_rows)
      throw nb::value_error("The hard rows do not fit the levels.");
  }
  if (!metric.is_none()) {
    required<double>(metric, 2, "metric");
    if (length_of(metric.ptr()) != n || length_of(metric.ptr(), 1) != n) throw nb::value_error("The metric does not fit the levels.");
  }
}

nb::object make_solution(nb::handle problem, nb::object x, Outcome outcome, std::int64_t iterations, nb::object message,
                         nb::object secondary) {
  nb::object made = nb::inst_alloc(nb::handle(registered.solution));
  auto* solution = nb::inst_ptr<SolutionObject>(made);
  new (solution) SolutionObject();
  solution->problem = nb::borrow(problem);
  solution->x = std::move(x);
  solution->status = nb::borrow(registered.status[static_cast<int>(outcome)]);
  solution->message = message.is_valid() ? std::move(message) : nb::borrow(registered.no_message);
  solution->secondary = secondary.is_valid() ? std::move(secondary) : nb::none();
  solution->held = nb::none();
  solution->kept = nb::none();
  solution->iterations = iterations;
  nb::inst_mark_ready(made);
  return made;
}

nb::object make_solution(nb::handle problem, nb::object x, Outcome outcome, std::int64_t iterations) {
  return make_solution(problem, std::move(x), outcome, iterations, nb::object(), nb::object());
}

void bind_objects(nb::module_& module) {
  nb::class_<ProblemObject>(module, "Problem", "The native half of `hqp_rp.Problem`: its arrays, and a view of them.")
      .def(nb::init<nb::object, nb::object, nb::object, nb::object, nb::object, int, nb::object, bool, nb::object, nb::object>(), nb::arg("matrix"),
           nb::arg("lower"), nb::arg("upper"), nb::arg("offsets"), nb::arg("names"), nb::arg("hard_rows"), nb::arg("hard").none(),
           nb::arg("is_equality"), nb::arg("damping").none() = nb::none(), nb::arg("metric").none() = nb::none(),
           "Takes arrays as they are, hard rows on top of the levels' rows (hard_rows of them) or apart (hard, a Level). "
           "TypeError and ValueError for arrays that do not fit.")
      .def_prop_ro("n", [](const ProblemObject& self) { return self.view.unknowns; }, "Number of unknowns.")
      .def_prop_ro("p", [](const ProblemObject& self) { return self.view.levels; }, "Number of levels.")
      .def_prop_ro("rows", [](const ProblemObject& self) { return self.view.rows; }, "Rows of all levels, M.")
      .def_prop_ro("hard_rows", [](const ProblemObject& self) { return self.view.hard_rows; }, "How many rows are hard.")
      .def_ro("is_equality", &ProblemObject::is_equality, "Whether every row of every level is an equality.")
      .def_ro("names", &ProblemObject::names, "One name for each level.")
      .def_ro("given", &ProblemObject::matrix, "The matrix as it was given, with hard rows on top where `on_top`.")
      .def_ro("given_lower", &ProblemObject::lower)
      .def_ro("given_upper", &ProblemObject::upper)
      .def_ro("given_offsets", &ProblemObject::offsets)
      .def_ro("given_hard", &ProblemObject::hard, "The hard rows that were given apart, or None.")
      .def_ro("damping", &ProblemObject::damping, "One policy or None for each level, or None where no level is damped.")
      .def_ro("metric", &ProblemObject::metric, "W (n, n) of the norm of the unknown, or None for the plain one.")
      .def_ro("on_top", &ProblemObject::on_top, "Whether hard rows stand on top of the levels' rows in `given`.")
      .def_rw("kept", &ProblemObject::kept, nb::for_setter(nb::arg("value").none()), "What Python made of it once.");

  nb::class_<SolutionObject>(module, "Solution", "The native half of `hqp_rp.Solution`.")
      .def("__init__",
           [](SolutionObject* self, nb::object problem, nb::object x, nb::object status, std::int64_t iterations, nb::object message,
              nb::object secondary) {
             new (self) SolutionObject{std::move(problem), std::move(x), std::move(status), std::move(message), std::move(secondary),
                                       nb::none(), nb::none(), iterations};
           },
           nb::arg("problem"), nb::arg("x").none(), nb::arg("status"), nb::arg("iterations") = 0, nb::arg("message") = "",
           nb::arg("secondary") = nb::none())
      .def_rw("problem", &SolutionObject::problem)
      .def_rw("x", &SolutionObject::x, nb::for_setter(nb::arg("value").none()))
      .def_rw("status", &SolutionObject::status)
      .def_rw("iterations", &SolutionObject::iterations)
      .def_rw("message", &SolutionObject::message)
      .def_rw("secondary", &SolutionObject::secondary, nb::for_setter(nb::arg("value").none()))
      .def_rw("held", &SolutionObject::held, nb::for_setter(nb::arg("value").none()))
      .def_rw("kept", &SolutionObject::kept, nb::for_setter(nb::arg("value").none()));

  module.def(
      "register_solution",
      [](nb::object solution, nb::tuple statuses) {
        if (statuses.size() != 6) throw nb::value_error("Status has six members.");
        registered.solution = solution.release().ptr();
        for (int i = 0; i < 6; ++i) registered.status[i] = nb::object(statuses[i]).release().ptr();
        registered.no_message = nb::str("").release().ptr();
      },
      nb::arg("solution"), nb::arg("statuses"), "Say which class solvers return, and the members of `Status` in their order.");
  module.def(
      "metric_root",
      [](nb::handle metric) -> nb::object {
        const double* W = required<double>(metric, 2, "metric");
        const auto n = static_cast<npy_intp>(length_of(metric.ptr()));
        if (length_of(metric.ptr(), 1) != n) throw nb::value_error("metric must be square.");
        nb::object root = new_array({n, n}), inverse = new_array({n, n});
        if (!metric_root(W, static_cast<int>(n), numbers_in(root), numbers_in(inverse))) return nb::none();
        return nb::make_tuple(root, inverse);
      },
      nb::arg("metric"), "R and its inverse, upper triangular, of W = R^T R; None where W (n, n) is not positive definite.");
  module.def(
      "damped_least_squares",
      [](nb::handle A, nb::handle b, double eta) {
        const double *matrix = required<double>(A, 2, "A"), *right = required<double>(b, 1, "b");
        const auto m = static_cast<int>(length_of(A.ptr())), n = static_cast<int>(length_of(A.ptr(), 1));
        if (length_of(b.ptr()) != m || !(eta > 0.0)) throw nb::value_error("A, b and eta > 0 do not fit together.");
        nb::object x = new_array({n});
        kernels().damped_least_squares(matrix, right, m, n, eta, numbers_in(x), thread_workspace());
        return x;
      },
      nb::arg("A"), nb::arg("b"), nb::arg("eta"), "x (n,) of min ||A x - b||^2 + ||eta x||^2 for A (m, n).");
  module.def(
      "is_finite",
      [](nb::handle array) {
        const nb::object numbers = as_numbers(array);
        return all_finite(numbers_in(numbers), PyArray_SIZE(reinterpret_cast<PyArrayObject*>(numbers.ptr())));
      },
      nb::arg("array"), "Whether every number of an array of any shape is finite.");
  module.def(
      "finite_numbers",
      [](nb::handle given, Py_ssize_t size) -> nb::object {
        PyObject* found = PyArray_FROMANY(given.ptr(), NPY_DOUBLE, 0, 0, NPY_ARRAY_CARRAY_RO | NPY_ARRAY_ENSUREARRAY);
        if (!found) {
          if (!PyErr_ExceptionMatches(PyExc_TypeError) && !PyErr_ExceptionMatches(PyExc_ValueError)) throw nb::python_error();
          PyErr_Clear();
          return nb::none();
        }
        const nb::object vector = nb::steal(found);
        const bool fits = PyArray_NDIM(reinterpret_cast<PyArrayObject*>(found)) == 1 && length_of(found) == size;
        return fits && all_finite(numbers_in(vector), size) ? vector : nb::none();
      },
      nb::arg("given").none(), nb::arg("size"),
      "The same numbers as a C-contiguous float64 vector (size,), the object itself where it is one; None where they are not so many finite\n"
      "ones that float64 holds without loss.");
  module.def(
      "take_configuration",
      [](nb::handle q, nb::handle out, nb::handle quaternions, double least) {
        const auto* place = required<std::int64_t>(quaternions, 1, "quaternions");
        double* into = writable<double>(out, 1, "out");
        const Py_ssize_t size = length_of(out.ptr());
        const auto* from = static_cast<const double*>(data_of(q.ptr(), NPY_DOUBLE, 1));
        if (!from || length_of(q.ptr()) != size || !all_finite(from, size)) return false;
        for (Py_ssize_t i = 0; i < length_of(quaternions.ptr()); ++i) {
          const double* x = from + place[i];
          if (!(x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + x[3] * x[3] > least)) return false;
        }
        std::copy(from, from + size, into);
        return true;
      },
      nb::arg("q").none(), nb::arg("out"), nb::arg("quaternions"), nb::arg("least"),
      "Copy a configuration if it is finite and of the length of `out`, and the squared norm of every quaternion, beginning at these places,\n"
      "is above `least`; whether it was.");
  module.def("instruction_set", [] { return kernels().instruction_set; }, "For which instruction set the kernels in use were compiled.");
  module.def("workspace_allocations", [] { return thread_workspace().allocations(); },
             "How many blocks of memory this thread's workspace has allocated so far.");
}

}  // namespace hqp::python
