#include <utility>

#include "hqp_rp/acceleration_rows.hpp"
#include "hqp_rp/kinematics.hpp"
#include "hqp_rp/task_rows.hpp"
#include "objects.hpp"

namespace hqp::python {

namespace {

// The frames of a MuJoCo state, read where MuJoCo keeps them; the arrays given are kept alive.
class KinematicsObject {
 public:
  // frames (F, 2): 0 for a body, 1 for a site, -1 for the centre of mass, and its number. chains: F arrays of dofs, the nearest first.
  // dofs (nv, 6): axis (0 ... 2 of the world, 3 ... 5 of the body's columns, 6 of the joint), joint, whether it turns, body, parent dof,
  // carrier (see `Kinematics::Dof`). bodies (B, 3): itself, its parent and the nearest dof, leaves first.
  KinematicsObject(nb::handle frames, nb::list chains, nb::handle dofs, nb::handle bodies, double mass, nb::dict state) : kept_(state) {
    const double *xmat = of("xmat", 2), *xpos = of("xpos", 2), *site_xmat = of("site_xmat", 2), *site_xpos = of("site_xpos", 2);
    const double *xanchor = of("xanchor", 2), *xaxis = of("xaxis", 2), *xipos = of("xipos", 2), *body_mass = of("body_mass", 1);
    static const double world[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    const std::int64_t* frame = required<std::int64_t>(frames, 2, "frames");
    for (Py_ssize_t f = 0; f < length_of(frames.ptr()); ++f) {
      Kinematics::Frame made{nullptr, nullptr, {}};
      const std::int64_t kind = frame[2 * f], number = frame[2 * f + 1];
      if (kind >= 0) {
        made.rotation = (kind ? site_xmat : xmat) + 9 * number;
        made.origin = (kind ? site_xpos : xpos) + 3 * number;
      }
      for (nb::handle dof : nb::list(chains[f])) made.dofs.push_back(nb::cast<int>(dof));
      tree_.frames.push_back(std::move(made));
    }
    const std::int64_t* dof = required<std::int64_t>(dofs, 2, "dofs");
    for (Py_ssize_t j = 0; j < length_of(dofs.ptr()); ++j, dof += 6) {
      const std::int64_t axis = dof[0], joint = dof[1], body = dof[3];
      const double* from = axis < 3 ? world + 3 * axis : axis < 6 ? xmat + 9 * body + (axis - 3) : xaxis + 3 * joint;
      tree_.dofs.push_back({from, axis >= 3 && axis < 6 ? 3 : 1, xanchor + 3 * joint, dof[2] != 0, static_cast<int>(body),
                            static_cast<int>(dof[4]), static_cast<int>(dof[5])});
    }
    const std::int64_t* body = required<std::int64_t>(bodies, 2, "bodies");
    for (Py_ssize_t i = 0; i < length_of(bodies.ptr()); ++i, body += 3)
      tree_.bodies.push_back({static_cast<int>(body[0]), static_cast<int>(body[1]), body_mass + body[0], xipos + 3 * body[0],
                              static_cast<int>(body[2])});
    tree_.mass = mass;
    tree_.carried.resize(4 * static_cast<std::size_t>(length_of(nb::object(kept_["xpos"]).ptr())));
  }

  void read(nb::handle rotations, nb::handle origins, nb::handle jacobians) {
    double *R = writable<double>(rotations, 3, "rotations"), *p = writable<double>(origins, 2, "origins");
    double* J = writable<double>(jacobians, 3, "jacobians");
    const auto F = static_cast<Py_ssize_t>(tree_.frames.size());
    if (length_of(rotations.ptr()) != F || length_of(origins.ptr()) != F || length_of(jacobians.ptr()) != F ||
        length_of(jacobians.ptr(), 2) != static_cast<Py_ssize_t>(tree_.dofs.size()))
      throw nb::value_error("The arrays do not fit the frames.");
    tree_.read(R, p, J);
  }

  void motion(nb::handle v, nb::handle twists, nb::handle biases) {
    const double* velocity = required<double>(v, 1, "v");
    double *V = writable<double>(twists, 2, "twists"), *A = writable<double>(biases, 2, "biases");
    const auto F = static_cast<Py_ssize_t>(tree_.frames.size());
    if (length_of(v.ptr()) != static_cast<Py_ssize_t>(tree_.dofs.size()) || length_of(twists.ptr()) != F || length_of(biases.ptr()) != F ||
        length_of(twists.ptr(), 1) != 6 || length_of(biases.ptr(), 1) != 6)
      throw nb::value_error("The arrays do not fit the frames.");
    tree_.motion(velocity, V, A);
  }

  Kinematics& tree() { return tree_; }

 private:
  const double* of(const char* name, int axes) { return required<double>(nb::object(kept_[name]), axes, name); }

  nb::dict kept_;
  Kinematics tree_;
};

// The native rows of one stack on one robot: arrays that stay where they are, and what is read at each step.
class RowsObject {
 public:
  // items (K, 7): kind, rows, first row, where its numbers begin, frame, frame of its axes, where its indices begin.
  RowsObject(nb::object items, nb::object index, nb::object numbers, nb::object values, nb::object rotations, nb::object origins,
             nb::object jacobians, nb::object kinematics, nb::object q, int time)
      : kept_(nb::make_tuple(items, index, numbers, values, rotations, origins, jacobians, kinematics, q)), items_(items) {
    rows_.index = required<std::int64_t>(index, 1, "index");
    rows_.numbers = required<double>(numbers, 1, "numbers");
    rows_.values = values_ = writable<double>(values, 1, "values");
    rows_.rotations = rotations_ = writable<double>(rotations, 3, "rotations");
    rows_.origins = origins_ = writable<double>(origins, 2, "origins");
    rows_.jacobians = jacobians_ = writable<double>(jacobians, 3, "jacobians");
    rows_.n = static_cast<int>(length_of(jacobians.ptr(), 2));
    time_ = time;
    if (!kinematics.is_none()) tree_ = &nb::inst_ptr<KinematicsObject>(kinematics)->tree();
    if (!q.is_none()) {
      q_ = required<double>(q, 1, "q");
      nq_ = length_of(q.ptr());
    }
    place();
  }

  // Takes up the table of items again: where the rows of each begin has changed.
  void place() {
    const std::int64_t* item = required<std::int64_t>(items_, 2, "items");
    rows_.items.clear();
    for (Py_ssize_t k = 0; k < length_of(items_.ptr()); ++k, item += 7)
      rows_.items.push_back({static_cast<int>(item[0]), static_cast<int>(item[1]), static_cast<int>(item[2]), item[3],
                             static_cast<int>(item[4]), static_cast<int>(item[5]), item[6]});
  }

  bool fill(nb::handle matrix, nb::handle lower, nb::handle upper, double dt, bool plain) {
    double *A = writable<double>(matrix, 2, "matrix"), *low = writable<double>(lower, 1, "lower");
    double* up = upper.is_none() ? nullptr : writable<double>(upper, 1, "upper");
    const Py_ssize_t M = length_of(matrix.ptr());
    if (length_of(matrix.ptr(), 1) != rows_.n || length_of(lower.ptr()) != M || (up && length_of(upper.ptr()) != M))
      throw nb::value_error("matrix, lower and upper do not fit together.");
    for (Py_ssize_t i = 0; i < nq_; ++i) values_[i] = q_[i];
    values_[time_] = dt;
    if (tree_) tree_->read(rotations_, origins_, jacobians_);
    return rows_.fill(A, low, up, M, plain);
  }

  // The same on accelerations, for v (n,): see `AccelerationRows`. rates: as the numbers. gains (2, K): kp and kd of every row. biases
  // (F, 6): Jdot v of every frame, read where kinematics are native, given elsewhere.
  bool fill_acceleration(nb::handle matrix, nb::handle lower, nb::handle upper, double dt, nb::handle v, nb::handle rates, nb::handle gains,
                         nb::handle biases) {
    const double* velocity = required<double>(v, 1, "v");
    const double *change = required<double>(rates, 1, "rates"), *gain = required<double>(gains, 2, "gains");
    double* bias = writable<double>(biases, 2, "biases");
    const Py_ssize_t F = length_of(nb::object(kept_[5]).ptr()), size = length_of(nb::object(kept_[2]).ptr()), K = length_of(gains.ptr(), 1);
    std::int64_t rows = 0;
    for (const RowItem& item : rows_.items) rows += item.rows;
    if (length_of(v.ptr()) != rows_.n || length_of(rates.ptr()) != size || length_of(gains.ptr()) != 2 || K != rows ||
        length_of(biases.ptr()) != F || (F && length_of(biases.ptr(), 1) != 6))
      throw nb::value_error("v, rates, gains or biases do not fit the rows.");
    const bool sound = fill(matrix, lower, upper, dt, false);
    twists_.resize(static_cast<std::size_t>(6 * F));
    if (tree_) {
      tree_->motion(velocity, twists_.data(), bias);
    } else {
      const double* J = jacobians_;
      for (double& twist : twists_) {
        twist = 0.0;
        for (int j = 0; j < rows_.n; ++j) twist += J[j] * velocity[j];
        J += rows_.n;
      }
    }
    accelerations_.number_rates = change;
    accelerations_.kp = gain;
    accelerations_.kd = gain + K;
    double* up = upper.is_none() ? nullptr : writable<double>(upper, 1, "upper");
    double* low = writable<double>(lower, 1, "lower");
    accelerations_.fill(rows_, twists_.data(), bias, velocity, dt, static_cast<std::size_t>(size), static_cast<std::size_t>(F), low, up);
    double total = 0.0;
    for (const RowItem& item : rows_.items)
      for (int i = 0; item.kind != RowItem::box && i < item.rows; ++i) total += 0.0 * low[item.first + i];
    return sound && total == 0.0;
  }

  // The same at N configurations, equalities alone; the number of the first whose rows no solver can take, -1 where there is none.
  std::int64_t fill_many(nb::handle rotations, nb::handle origins, nb::handle jacobians, nb::handle values, nb::handle matrices,
                         nb::handle lowers) const {
    TaskRows rows = rows_;
    rows.rotations = required<double>(rotations, 4, "rotations");
    rows.origins = required<double>(origins, 3, "origins");
    rows.jacobians = required<double>(jacobians, 4, "jacobians");
    rows.values = required<double>(values, 2, "values");
    double *A = writable<double>(matrices, 3, "matrices"), *low = writable<double>(lowers, 2, "lowers");
    const Py_ssize_t N = length_of(matrices.ptr()), M = length_of(matrices.ptr(), 1), F = length_of(rotations.ptr(), 1);
    const Py_ssize_t width = length_of(values.ptr(), 1);
    if (length_of(rotations.ptr()) != N || length_of(origins.ptr()) != N || length_of(jacobians.ptr()) != N || length_of(values.ptr()) != N ||
        length_of(lowers.ptr()) != N || length_of(lowers.ptr(), 1) != M || length_of(matrices.ptr(), 2) != rows.n ||
        length_of(jacobians.ptr(), 3) != rows.n)
      throw nb::value_error("The arrays do not fit together.");
    nb::gil_scoped_release released;
    for (Py_ssize_t i = 0; i < N; ++i) {
      if (!rows.fill(A + i * M * rows.n, low + i * M, nullptr, M, false)) return i;
      rows.rotations += 9 * F, rows.origins += 3 * F, rows.jacobians += 6 * F * rows.n, rows.values += width;
    }
    return -1;
  }

 private:
  nb::tuple kept_;
  nb::object items_;
  TaskRows rows_;
  Kinematics* tree_ = nullptr;
  double *values_ = nullptr, *rotations_ = nullptr, *origins_ = nullptr, *jacobians_ = nullptr;
  const double* q_ = nullptr;
  Py_ssize_t nq_ = 0;
  int time_ = 0;
  AccelerationRows accelerations_;
  std::vector<double> twists_;
};

}  // namespace

void bind_task_rows(nb::module_& module) {
  nb::class_<KinematicsObject>(module, "Kinematics", "Poses and Jacobians of frames, read out of MuJoCo's own memory.")
      .def(nb::init<nb::handle, nb::list, nb::handle, nb::handle, double, nb::dict>(), nb::arg("frames"), nb::arg("chains"), nb::arg("dofs"),
           nb::arg("bodies"), nb::arg("mass"), nb::arg("state"))
      .def("read", &KinematicsObject::read, nb::arg("rotations"), nb::arg("origins"), nb::arg("jacobians"),
           "Fill (F, 3, 3), (F, 3) and (F, 6, nv); what is always zero is left as it is.")
      .def("motion", &KinematicsObject::motion, nb::arg("v"), nb::arg("twists"), nb::arg("biases"),
           "Fill J v (F, 6) and Jdot v (F, 6), linear over angular, for v (nv,).");
  nb::class_<RowsObject>(module, "Rows", "The rows of a stack's own tasks and limits on one robot.")
      .def(nb::init<nb::object, nb::object, nb::object, nb::object, nb::object, nb::object, nb::object, nb::object, nb::object, int>(),
           nb::arg("items"), nb::arg("index"), nb::arg("numbers"), nb::arg("values"), nb::arg("rotations"), nb::arg("origins"),
           nb::arg("jacobians"), nb::arg("kinematics").none(), nb::arg("q").none(), nb::arg("time"))
      .def("place", &RowsObject::place, "Take up the table of items again.")
      .def("fill", &RowsObject::fill, nb::arg("matrix"), nb::arg("lower"), nb::arg("upper").none(), nb::arg("dt"), nb::arg("plain"),
           "Fill the rows of all items in (M, n), (M,) and (M,) or None, and judge all M rows: whether they are sound.")
      .def("fill_acceleration", &RowsObject::fill_acceleration, nb::arg("matrix"), nb::arg("lower"), nb::arg("upper").none(), nb::arg("dt"),
           nb::arg("v"), nb::arg("rates"), nb::arg("gains"), nb::arg("biases"), "The same on accelerations, for the velocity v (nv,).")
      .def("fill_many", &RowsObject::fill_many, nb::arg("rotations"), nb::arg("origins"), nb::arg("jacobians"), nb::arg("values"),
           nb::arg("matrices"), nb::arg("lowers"), "The same at N configurations, equalities alone: the first that is not sound, or -1.");
  module.def(
      "serial_arm",
      [](nb::handle q, nb::handle d, nb::handle a, nb::handle cos_alpha, nb::handle sin_alpha, int frame, nb::handle rotations,
         nb::handle origins, nb::handle jacobians) {
        SerialArm arm;
        arm.d = required<double>(d, 1, "d");
        arm.a = required<double>(a, 1, "a");
        arm.cos_alpha = required<double>(cos_alpha, 1, "cos_alpha");
        arm.sin_alpha = required<double>(sin_alpha, 1, "sin_alpha");
        arm.joints = static_cast<int>(length_of(d.ptr()));
        const double* Q = required<double>(q, 2, "q");
        const Py_ssize_t N = length_of(q.ptr());
        double *R = writable<double>(rotations, 3, "rotations"), *p = writable<double>(origins, 2, "origins");
        double* J = writable<double>(jacobians, 3, "jacobians");
        const bool fit = length_of(q.ptr(), 1) == arm.joints && length_of(a.ptr()) == arm.joints && length_of(cos_alpha.ptr()) == arm.joints &&
                         length_of(sin_alpha.ptr()) == arm.joints && length_of(rotations.ptr()) == N && length_of(origins.ptr()) == N &&
                         length_of(jacobians.ptr()) == N && length_of(jacobians.ptr(), 2) == arm.joints && 0 <= frame && frame <= arm.joints;
        if (!fit) throw nb::value_error("The arrays do not fit the arm.");
        nb::gil_scoped_release released;
        kernels().serial_arm(arm, Q, N, frame, R, p, J, thread_workspace());
      },
      nb::arg("q"), nb::arg("d"), nb::arg("a"), nb::arg("cos_alpha"), nb::arg("sin_alpha"), nb::arg("frame"), nb::arg("rotations"),
      nb::arg("origins"), nb::arg("jacobians"), "Pose and Jacobian of a frame of an arm at q (N, n).");
  module.def(
      "rotation_vector",
      [](nb::handle R) {
        const double* rotation = required<double>(R, 2, "R");
        if (length_of(R.ptr()) != 3 || length_of(R.ptr(), 1) != 3) throw nb::value_error("R must be (3, 3).");
        nb::object r = new_array({3});
        rotation_vector(rotation, numbers_in(r));
        return r;
      },
      nb::arg("R"), "log R (3,), of a rotation (3, 3).");
  module.def("allowed_step", &allowed_step, nb::arg("distance"), nb::arg("gain"), nb::arg("a"),
             "The signed step towards a limit at a signed distance; a = A dt^2.");
  module.def(
      "stop_change", [](double u, double c, double a, double j) { return JerkStop{a, j}.next(u, c); }, nb::arg("u"), nb::arg("c"), nb::arg("a"),
      nb::arg("j"), "The next change of the velocity u while it stops, after the change c; a = A dt, j = J dt^2.");
  module.def(
      "stop_rise", [](double u, double c, double a, double j) { return JerkStop{a, j}.rise(u, c); }, nb::arg("u"), nb::arg("c"), nb::arg("a"),
      nb::arg("j"), "How far above its place the position, over dt, comes to lie while u stops; arguments of `stop_change`, j finite.");
}

}  // namespace hqp::python
