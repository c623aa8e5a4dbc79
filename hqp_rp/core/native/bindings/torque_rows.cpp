#include <cstring>
#include <utility>

#include "hqp_rp/torque_rows.hpp"
#include "objects.hpp"

namespace hqp::python {

namespace {

// The rows of one torque stack on one robot: arrays that stay where they are, and what is read at each step.
class TorqueRowsObject {
 public:
  // contacts (C, 6): frame, surface (-1: the world), points, first force, motion rows, first motion row. points (K, 3), bases (C, 6, 6),
  // axes (C, 3, 3), kd and activation (C,) of the contacts; frames: rotations (F, 3, 3), origins (F, 3), jacobians (F, 6, nv), twists and
  // biases (F, 6). passive, driven, limited: velocity indices, of the torque limits `limit`. cones (G, forces), their bounds (G,).
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
    if (size("limit") != size("limited")) throw nb::value_error("limit and limited do not fit together.");
  }

  // Fills matrix (M, n), lower and upper (M,) but for the rows of tasks on forces: the equation of motion, torque limits, cones, then the
  // rows on accelerations, given (m, nv) and (m,), each in its place; the first place among the levels is that of the contacts' motion.
  // Also the map (d, n) and the offset (d,) of torques and the Jacobian (forces, nv) of the points.
  // False where M or h is not finite.
  bool fill(nb::handle matrix, nb::handle lower, nb::handle upper, nb::handle M, nb::handle h, nb::handle cones, nb::handle cone_lower,
            nb::handle cone_upper, nb::handle given, nb::handle given_lower, nb::handle given_upper, nb::handle places,
            Py_ssize_t motion_place, nb::handle map, nb::handle offset, nb::handle point_jacobian) {
    const Py_ssize_t n = rows_.nv + rows_.forces, nv = rows_.nv, total = length_of(matrix.ptr());
    double *A = writable<double>(matrix, 2, "matrix"), *low = writable<double>(lower, 1, "lower"), *up = writable<double>(upper, 1, "upper");
    double *T = writable<double>(map, 2, "map"), *J = writable<double>(point_jacobian, 2, "point_jacobian");
    double* o = writable<double>(offset, 1, "offset");
    const double *mass = required<double>(M, 2, "M"), *bias = required<double>(h, 1, "h");
    const double *G = required<double>(cones, 2, "cones"), *g_low = required<double>(cone_lower, 1, "cone_lower");
    const double* g_up = required<double>(cone_upper, 1, "cone_upper");
    const double *B = required<double>(given, 2, "given"), *b_low = required<double>(given_lower, 1, "given_lower");
    const double* b_up = required<double>(given_upper, 1, "given_upper");
    const std::int64_t* place = required<std::int64_t>(places, 1, "places");
    const Py_ssize_t p = size("passive"), d = size("driven"), l = size("limited"), g = length_of(cones.ptr()), m = length_of(given.ptr());
    bool fit = length_of(matrix.ptr(), 1) == n && length_of(lower.ptr()) == total && length_of(upper.ptr()) == total &&
               length_of(M.ptr()) == nv && length_of(M.ptr(), 1) == nv && length_of(h.ptr()) == nv && length_of(map.ptr()) == d && length_of(offset.ptr()) == d &&
               length_of(map.ptr(), 1) == n && length_of(point_jacobian.ptr()) == rows_.forces && length_of(cone_lower.ptr()) == g &&
               length_of(cone_upper.ptr()) == g && (!g || length_of(cones.ptr(), 1) == rows_.forces) && (!m || length_of(given.ptr(), 1) == nv) &&
               length_of(given_lower.ptr()) == m && length_of(given_upper.ptr()) == m && length_of(places.ptr()) == m &&
               p + l + g <= total && motion_place + motion_rows_ <= total && motion_place >= 0;
    for (Py_ssize_t i = 0; fit && i < m; ++i) fit = place[i] >= 0 && place[i] < total;
    if (!fit) throw nb::value_error("The arrays do not fit together.");
    std::memset(A, 0, sizeof(double) * static_cast<std::size_t>(total * n));
    for (std::size_t c = 0; c < rows_.contacts.size(); ++c) rows_.contacts[c].kd = kd_[c], rows_.contacts[c].open = activation_[c] == 0.0;
    rows_.contact_rows(J, A + motion_place * n, low + motion_place, n);
    for (int i = 0; i < motion_rows_; ++i) up[motion_place + i] = low[motion_place + i];
    rows_.torque_rows(mass, J, passive_, p, A);
    for (Py_ssize_t i = 0; i < p; ++i) low[i] = up[i] = -bias[passive_[i]];
    rows_.torque_rows(mass, J, driven_, d, T);
    for (Py_ssize_t i = 0; i < d; ++i) o[i] = bias[driven_[i]];
    rows_.torque_rows(mass, J, limited_, l, A + p * n);
    for (Py_ssize_t i = 0; i < l; ++i) {
      low[p + i] = -limit_[i] - bias[limited_[i]];
      up[p + i] = limit_[i] - bias[limited_[i]];
    }
    for (Py_ssize_t i = 0; i < g; ++i) {
      std::memcpy(A + (p + l + i) * n + nv, G + i * rows_.forces, sizeof(double) * static_cast<std::size_t>(rows_.forces));
      low[p + l + i] = g_low[i] / rows_.unit;
      up[p + l + i] = g_up[i] / rows_.unit;
    }
    for (Py_ssize_t i = 0; i < m; ++i) {
      std::memcpy(A + place[i] * n, B + i * nv, sizeof(double) * static_cast<std::size_t>(nv));
      low[place[i]] = b_low[i];
      up[place[i]] = b_up[i];
    }
    double finite = 0.0;  // zero times nan or infinity is nan
    for (Py_ssize_t i = 0; i < nv * nv; ++i) finite += 0.0 * mass[i];
    for (Py_ssize_t i = 0; i < nv; ++i) finite += 0.0 * bias[i];
    return finite == 0.0;
  }

 private:
  template <class T>
  const T* of(const char* name, int axes) {
    return required<T>(nb::object(kept_[name]), axes, name);
  }
  Py_ssize_t size(const char* name) { return length_of(nb::object(kept_[name]).ptr()); }

  nb::dict kept_;
  TorqueRows rows_;
  int motion_rows_ = 0;
  const double *kd_ = nullptr, *activation_ = nullptr, *limit_ = nullptr;
  const std::int64_t *passive_ = nullptr, *driven_ = nullptr, *limited_ = nullptr;
};

}  // namespace

void bind_torque_rows(nb::module_& module) {
  nb::class_<TorqueRowsObject>(module, "TorqueRows", "The rows of a torque stack on one robot.")
      .def(nb::init<nb::dict, int, double>(), nb::arg("arrays"), nb::arg("forces"), nb::arg("unit"))
      .def("fill", &TorqueRowsObject::fill, nb::arg("matrix"), nb::arg("lower"), nb::arg("upper"), nb::arg("M"), nb::arg("h"),
           nb::arg("cones"), nb::arg("cone_lower"), nb::arg("cone_upper"), nb::arg("given"), nb::arg("given_lower"), nb::arg("given_upper"),
           nb::arg("places"), nb::arg("motion_place"), nb::arg("map"), nb::arg("offset"), nb::arg("point_jacobian"),
           "Fill all rows but those of tasks on forces; false where M or h is not finite.");
}

}  // namespace hqp::python
