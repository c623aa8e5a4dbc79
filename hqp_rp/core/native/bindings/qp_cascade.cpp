#include <algorithm>
#include <memory>

#include "objects.hpp"

namespace hqp::python {

namespace {

// The stages of a cascade of QPs for problems of one shape, with the warm starts of the last one.
class QPCascadeObject {
 public:
  QPCascadeObject(int unknowns, int hard_rows, nb::handle offsets) {
    const std::int64_t* starts = required<std::int64_t>(offsets, 1, "offsets");
    unknowns_ = unknowns;
    rows_ = hard_rows + static_cast<int>(starts[length_of(offsets.ptr()) - 1]);
    stages_.reset(kernels().make_qp_cascade(unknowns, hard_rows, starts, static_cast<int>(length_of(offsets.ptr())) - 1));
  }

  nb::tuple begin(nb::object problem, nb::handle secondary, double accept, double rank_tolerance, bool polish) {
    problem_ = problem;
    const Problem& view = nb::inst_ptr<ProblemObject>(problem)->view;
    if (view.unknowns != unknowns_ || view.hard_rows + view.rows != rows_) throw nb::value_error("The problem is of another shape.");
    const double* start = secondary.is_none() ? nullptr : required<double>(secondary, 1, "secondary");
    return asked(stages_->begin(view, start, accept, rank_tolerance, polish));
  }
  nb::tuple answer(nb::handle t, nb::handle y) {
    const QP& qp = stages_->qp();
    const double *found = t.is_none() ? nullptr : required<double>(t, 1, "t"), *multipliers = nullptr;
    if (found && length_of(t.ptr()) < qp.n) throw nb::value_error("t is too short.");
    if (found && qp.m) {
      multipliers = required<double>(y, 1, "y");
      if (length_of(y.ptr()) != qp.m) throw nb::value_error("y does not have one number for each row.");
    }
    return asked(stages_->answer(found, multipliers));
  }
  nb::tuple go_on() { return asked(stages_->go_on()); }

  // Views of the QP that is asked for: hessian, gradient, rows, slack_rows, lower, upper, start, y.
  static nb::tuple views(nb::handle self) {
    const QP& qp = nb::inst_ptr<QPCascadeObject>(self)->stages_->qp();
    const int full = qp.n + qp.soft;
    const auto view = [&](std::initializer_list<npy_intp> shape, double* data) {
      PyObject* made = PyArray_SimpleNewFromData(static_cast<int>(shape.size()), const_cast<npy_intp*>(shape.begin()), NPY_DOUBLE, data);
      if (!made) throw nb::python_error();
      PyArray_SetBaseObject(reinterpret_cast<PyArrayObject*>(made), nb::borrow(self).release().ptr());
      return nb::steal(made);
    };
    return nb::make_tuple(view({full, full}, qp.hessian), view({full}, qp.gradient), view({qp.m, qp.n}, qp.rows),
                          view({qp.m, full}, qp.slack_rows), view({qp.m}, qp.lower), view({qp.m}, qp.upper), view({full}, qp.start),
                          view({qp.m}, qp.y));
  }
  nb::object x() const { return numbers(stages_->x(), unknowns_); }
  nb::object least() const { return numbers(stages_->least(), unknowns_); }
  nb::object side() const { return as_int8(stages_->side(), rows_); }
  int stage() const { return stages_->stage(); }

 private:
  nb::tuple asked(QPStages::Asked what) const {
    const QP& qp = stages_->qp();
    return nb::make_tuple(static_cast<int>(what), qp.n, qp.m, qp.soft, qp.guessed);
  }
  static nb::object numbers(const double* from, int n) {
    nb::object made = new_array({n});
    std::copy(from, from + n, numbers_in(made));
    return made;
  }

  std::unique_ptr<QPStages> stages_;
  nb::object problem_;  // its arrays are read until the last answer
  int unknowns_ = 0, rows_ = 0;
};

}  // namespace

void bind_qp_cascade(nb::module_& module) {
  module.def(
      "polish",
      [](nb::object M, nb::object c, nb::object rows, nb::object lower, nb::object upper, int soft, nb::object t, nb::object y) {
        const double *own = required<double>(M, 2, "M"), *target = required<double>(c, 1, "c"), *G = required<double>(rows, 2, "rows");
        const double *low = required<double>(lower, 1, "lower"), *up = required<double>(upper, 1, "upper");
        double *found = writable<double>(t, 1, "t"), *multipliers = writable<double>(y, 1, "y");
        const Py_ssize_t n = length_of(t.ptr()), m = length_of(y.ptr()), curved = length_of(M.ptr());
        const bool fit = length_of(M.ptr(), 1) == n && length_of(c.ptr()) == curved && length_of(rows.ptr()) == m &&
                         length_of(rows.ptr(), 1) == n && length_of(lower.ptr()) == m && length_of(upper.ptr()) == m && 0 <= soft && soft <= m;
        if (!fit) throw nb::value_error("The arrays of the QP do not fit together.");
        kernels().polish(own, static_cast<int>(curved), target, G, low, up, static_cast<int>(m), static_cast<int>(n), soft, found,
                         multipliers, thread_workspace());
      },
      nb::arg("M"), nb::arg("c"), nb::arg("rows"), nb::arg("lower"), nb::arg("upper"), nb::arg("soft"), nb::arg("t"), nb::arg("y"),
      "Refine t (n,) and y (m,), an answer to min ||M t - c||^2 / 2 + ||s||^2 / 2 under lower <= rows t + [s; 0] <= upper, in place.");

  nb::class_<QPCascadeObject>(module, "QPCascade", "The stages of a cascade of QPs for problems of one shape; not to be shared between threads.")
      .def(nb::init<int, int, nb::handle>(), nb::arg("unknowns"), nb::arg("hard_rows"), nb::arg("offsets"))
      .def("begin", &QPCascadeObject::begin, nb::arg("problem"), nb::arg("secondary").none(), nb::arg("accept"),
           nb::arg("rank_tolerance"), nb::arg("polish"),
           "(what is asked, unknowns, rows, soft rows, whether there is a guess): 0 nothing, 1 not finite, 2 a QP without rows, 3 one "
           "with rows, 4 hard rows remain violated.")
      .def("answer", &QPCascadeObject::answer, nb::arg("t").none(), nb::arg("y").none(), "Takes the back end's answer; what is asked next.")
      .def("go_on", &QPCascadeObject::go_on, "After 4: the levels over points that violate hard rows least.")
      .def_prop_ro("views", [](nb::handle self) { return QPCascadeObject::views(self); },
                   "(hessian, gradient, rows, slack_rows, lower, upper, start, y) of the QP that is asked for, as views.")
      .def_prop_ro("x", &QPCascadeObject::x, "A copy of the point reached (n,).")
      .def_prop_ro("least", &QPCascadeObject::least, "The point (n,) where the hard rows' stage ended.")
      .def_prop_ro("side", &QPCascadeObject::side, "(hard rows and rows,) int8: the bounds at which rows have left.")
      .def_prop_ro("stage", &QPCascadeObject::stage, "The stage that asked: 0 the hard rows, 1 ... p the levels, p + 1 the last one.");
}

}  // namespace hqp::python
