#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "hqp_rp/finite.hpp"
#include "hqp_rp/torque_rows.hpp"
#include "objects.hpp"

namespace hqp::python {

namespace {

// The rows of one torque stack on one robot: arrays that stay where they are, and what is read at each step.
class TorqueRowsObject {
 public:
  // contacts (C, 6): frame, surface (-1: the world), points, first force, motion rows, first motion row. points (K, 3), bases (C, 6, 6),
  // axes (C, 3, 3), kd and activation (C,) of the contacts; frames: rotations (F, 3, 3), origins (F, 3), jacobians (F, 6, nv), twists and
  // biases (F, 6). mass_matrix (nv, nv) and bias (nv,): M and h + g, read at each step. passive, driven, limited: velocity indices, of the
  // torque limits `limit`. cones (G, forces), their bounds (G,).
  TorqueRowsObject(nb::dict arrays, int forces, double unit) : kept_(arrays) {
    rows_.forces = forces;
    rows_.unit = unit;
    rows_.rotations = of<double>("rotations", 3);
    rows_.origins = of<double>("origins", 2);
    rows_.jacobians = of<double>("jacobians", 3);
    rows_.twists = of<double>("twists", 2);
    rows_.biases = of<double>("biases", 2);
    rows_.nv = static_cast<int>(length_of(nb::object(kept_["jacobians"]).ptr(), 2));
    const std::int64_t* item = of<std::int64_t>("contacts", 2);
    const double *point = of<double>("points", 2), *basis = of<double>("bases", 3), *axes = of<double>("axes", 3);
    kd_ = of<double>("kd", 1);
    activation_ = of<double>("activation", 1);
    for (Py_ssize_t c = 0; c < size("contacts"); ++c, item += 6) {
      ContactItem made;
      made.frame = static_cast<int>(item[0]), made.on = static_cast<int>(item[1]), made.points = static_cast<int>(item[2]);
      made.first_force = static_cast<int>(item[3]), made.rows = static_cast<int>(item[4]), made.first_row = static_cast<int>(item[5]);
      made.place = point, made.basis = basis + 36 * c, made.axes = axes + 9 * c;
      point += 3 * item[2];
      motion_rows_ += made.rows;
      rows_.contacts.push_back(made);
    }
    passive_ = of<std::int64_t>("passive", 1);
    driven_ = of<std::int64_t>("driven", 1);
    limited_ = of<std::int64_t>("limited", 1);
    limit_ = of<double>("limit", 1);
    mass_ = of<double>("mass_matrix", 2), bias_ = of<double>("bias", 1);
    const nb::object mass(kept_["mass_matrix"]);
    if (length_of(mass.ptr()) != rows_.nv || length_of(mass.ptr(), 1) != rows_.nv || size("bias") != rows_.nv)
      throw nb::value_error("mass_matrix and bias do not fit together.");
    if (size("limit") != size("limited")) throw nb::value_error("limit and limited do not fit together.");
  }

  // Where rows stand: cones (G, forces) and their bounds (G,), N; the places (m,) of rows on accelerations, among `total` rows in all, and
  // that of the contacts' motion.
  void place(nb::object cones, nb::object cone_lower, nb::object cone_upper, nb::object places, Py_ssize_t motion_place, Py_ssize_t total) {
    const Py_ssize_t g = length_of(cones.ptr()), m = length_of(places.ptr());
    cones_ = required<double>(cones, 2, "cones"), cone_lower_ = required<double>(cone_lower, 1, "cone_lower");
    cone_upper_ = required<double>(cone_upper, 1, "cone_upper"), places_ = required<std::int64_t>(places, 1, "places");
    bool fit = length_of(cone_lower.ptr()) == g && length_of(cone_upper.ptr()) == g && (!g || length_of(cones.ptr(), 1) == rows_.forces) &&
               size("passive") + size("limited") + g <= total && motion_place >= 0 && motion_place + motion_rows_ <= total;
    for (Py_ssize_t i = 0; fit && i < m; ++i) fit = places_[i] >= 0 && places_[i] < total;
    if (!fit) throw nb::value_error("The arrays do not fit together.");
    placed_ = nb::make_tuple(cones, cone_lower, cone_upper, places);
    alone_ = m == total && rows_.forces == 0;
    for (Py_ssize_t i = 0; i < m; ++i) alone_ = alone_ && places_[i] == i;
    cone_rows_ = g, given_rows_ = m, motion_place_ = motion_place, total_ = total;
  }

  // matrix (M, n), lower and upper (M,) of all rows, those of tasks on forces left as they are: the equation of motion, torque limits, cones,
  // then the rows on accelerations, given (m, nv) and (m,), each in its place; the first place among the levels is that of the contacts'
  // motion. With them the map (d, n) and the offset (d,) of torques and the Jacobian (forces, nv) of the points. Where the given rows are all,
  // they are returned as they are.
  // None where mass matrix or bias is not finite.
  nb::object rows(nb::handle given, nb::handle given_lower, nb::handle given_upper) {
    const Py_ssize_t n = rows_.nv + rows_.forces, nv = rows_.nv;
    const double *mass = mass_, *bias = bias_;
    const double *B = required<double>(given, 2, "given"), *b_low = required<double>(given_lower, 1, "given_lower");
    const double* b_up = required<double>(given_upper, 1, "given_upper");
    const Py_ssize_t p = size("passive"), d = size("driven"), l = size("limited"), g = cone_rows_, m = given_rows_;
    const bool fit = length_of(given.ptr()) == m && (!m || length_of(given.ptr(), 1) == nv) && length_of(given_lower.ptr()) == m &&
                     length_of(given_upper.ptr()) == m;
    if (!fit) throw nb::value_error("The arrays do not fit together.");
    if (!all_finite(mass, nv * nv) || !all_finite(bias, nv)) return nb::none();
    const nb::object map = new_array({d, n}), offset = new_array({d}), point_jacobian = new_array({rows_.forces, nv});
    double *T = numbers_in(map), *o = numbers_in(offset), *J = numbers_in(point_jacobian);
    if (alone_) {
      rows_.torque_rows(mass, J, driven_, d, T);
      for (Py_ssize_t i = 0; i < d; ++i) o[i] = bias[driven_[i]];
      return nb::make_tuple(given, given_lower, given_upper, map, offset, point_jacobian);
    }
    const nb::object matrix = new_array({total_, n}), lower = new_array({total_}), upper = new_array({total_});
    double *A = numbers_in(matrix), *low = numbers_in(lower), *up = numbers_in(upper);
    const double *G = cones_, *g_low = cone_lower_, *g_up = cone_upper_;
    const std::int64_t* place = places_;
    const Py_ssize_t motion_place = motion_place_;
    const auto zeros = [&](Py_ssize_t row, Py_ssize_t first, Py_ssize_t count) {
      std::memset(A + row * n + first, 0, sizeof(double) * static_cast<std::size_t>(count));
    };
    for (Py_ssize_t i = 0; i < motion_rows_; ++i) zeros(motion_place + i, 0, n);
    for (std::size_t c = 0; c < rows_.contacts.size(); ++c) rows_.contacts[c].kd = kd_[c], rows_.contacts[c].open = activation_[c] == 0.0;
    rows_.contact_rows(J, A + motion_place * n, low + motion_place, n);
    for (int i = 0; i < motion_rows_; ++i) up[motion_place + i] = low[motion_place + i];
    rows_.torque_rows(mass, J, passive_, p, A);
    for (Py_ssize_t i = 0; i < p; ++i) low[i] = up[i] = -bias[passive_[i]];
    rows_.torque_rows(mass, J, driven_, d, T);
    for (Py_ssize_t i = 0; i < d; ++i) o[i] = bias[driven_[i]];
    if (l == d && std::equal(limited_, limited_ + l, driven_))
      std::copy(T, T + l * n, A + p * n);
    else
      rows_.torque_rows(mass, J, limited_, l, A + p * n);
    for (Py_ssize_t i = 0; i < l; ++i) {
      low[p + i] = -limit_[i] - bias[limited_[i]];
      up[p + i] = limit_[i] - bias[limited_[i]];
    }
    for (Py_ssize_t i = 0; i < g; ++i) {
      zeros(p + l + i, 0, nv);
      std::memcpy(A + (p + l + i) * n + nv, G + i * rows_.forces, sizeof(double) * static_cast<std::size_t>(rows_.forces));
      low[p + l + i] = g_low[i] / rows_.unit;
      up[p + l + i] = g_up[i] / rows_.unit;
    }
    for (Py_ssize_t i = 0; i < m; ++i) {
      zeros(place[i], nv, rows_.forces);
      std::memcpy(A + place[i] * n, B + i * nv, sizeof(double) * static_cast<std::size_t>(nv));
      low[place[i]] = b_low[i];
      up[place[i]] = b_up[i];
    }
    return nb::make_tuple(matrix, lower, upper, map, offset, point_jacobian);
  }

  // The Jacobian (forces, nv) of the points alone.
  nb::object points() {
    const nb::object jacobian = new_array({rows_.forces, rows_.nv});
    std::vector<double> motion(static_cast<std::size_t>(motion_rows_) * rows_.nv), rate(static_cast<std::size_t>(motion_rows_));
    rows_.contact_rows(numbers_in(jacobian), motion.data(), rate.data(), rows_.nv);
    return jacobian;
  }

 private:
  template <class T>
  const T* of(const char* name, int axes) {
    return required<T>(nb::object(kept_[name]), axes, name);
  }
  Py_ssize_t size(const char* name) { return length_of(nb::object(kept_[name]).ptr()); }

  nb::dict kept_;
  nb::tuple placed_;
  const double *cones_ = nullptr, *cone_lower_ = nullptr, *cone_upper_ = nullptr;
  const std::int64_t* places_ = nullptr;
  Py_ssize_t cone_rows_ = 0, given_rows_ = 0, motion_place_ = 0, total_ = 0;
  TorqueRows rows_;
  int motion_rows_ = 0;
  bool alone_ = false;  // rows on accelerations are all there are
  const double *kd_ = nullptr, *activation_ = nullptr, *limit_ = nullptr, *mass_ = nullptr, *bias_ = nullptr;
  const std::int64_t *passive_ = nullptr, *driven_ = nullptr, *limited_ = nullptr;
};

}  // namespace

// map x + offset, cut to the limits, read-only; None where x or the torques are not finite.
static nb::object torque_within(nb::handle map, nb::handle x, nb::handle offset, nb::handle limit) {
  const nb::object given = as_numbers(x);
  const double *T = required<double>(map, 2, "map"), *unknown = required<double>(given, 1, "x");
  const double *o = required<double>(offset, 1, "offset"), *most = required<double>(limit, 1, "limit");
  const Py_ssize_t d = length_of(map.ptr()), n = length_of(map.ptr(), 1);
  if (length_of(given.ptr()) != n || length_of(offset.ptr()) != d || length_of(limit.ptr()) != d)
    throw nb::value_error("The arrays do not fit together.");
  nb::object torque = new_array({d});
  double* tau = numbers_in(torque);
  bool sound = all_finite(unknown, n);
  for (Py_ssize_t i = 0; i < d; ++i) {
    double part[8] = {o[i]};  // sums that do not wait for one another
    Py_ssize_t j = 0;
    for (; j + 8 <= n; j += 8)
      for (int k = 0; k < 8; ++k) part[k] += T[i * n + j + k] * unknown[j + k];
    for (; j < n; ++j) part[0] += T[i * n + j] * unknown[j];
    const double sum = ((part[0] + part[4]) + (part[1] + part[5])) + ((part[2] + part[6]) + (part[3] + part[7]));
    sound = sound && std::isfinite(sum);
    tau[i] = sum > most[i] ? most[i] : sum < -most[i] ? -most[i] : sum;
  }
  if (!sound) return nb::none();
  PyArray_CLEARFLAGS(reinterpret_cast<PyArrayObject*>(torque.ptr()), NPY_ARRAY_WRITEABLE);
  return torque;
}

void bind_torque_rows(nb::module_& module) {
  module.def("torque_within", &torque_within, nb::arg("map"), nb::arg("x"), nb::arg("offset"), nb::arg("limit"),
             "map x + offset, cut to +-limit, read-only; None where x or the torques are not finite.");
  nb::class_<TorqueRowsObject>(module, "TorqueRows", "The rows of a torque stack on one robot.")
      .def(nb::init<nb::dict, int, double>(), nb::arg("arrays"), nb::arg("forces"), nb::arg("unit"))
      .def("place", &TorqueRowsObject::place, nb::arg("cones"), nb::arg("cone_lower"), nb::arg("cone_upper"), nb::arg("places"),
           nb::arg("motion_place"), nb::arg("total"), "Say where rows stand, and which the cones are; arrays of which nothing changes later.")
      .def("rows", &TorqueRowsObject::rows, nb::arg("given"), nb::arg("given_lower"), nb::arg("given_upper"),
           "All rows but those of tasks on forces: matrix, lower, upper, map, offset, Jacobian of the points; None where M or h is not finite.")
      .def("points", &TorqueRowsObject::points, "The Jacobian of the points alone.");
}

}  // namespace hqp::python
