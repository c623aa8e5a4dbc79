// Rows of a stack's tasks and limits from the poses and Jacobians of frames: all of them in one call.
//
// A Jacobian (6, n) holds the velocity of a frame's origin over the angular velocity, in world axes. Every task has gains and weights,
// one for each row; `plain` gives rows without weights, and errors in the place of rates. T is double, or `Dual` for what is
// differentiated along a motion.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "hqp_rp/dual.hpp"
#include "hqp_rp/finite.hpp"
#include "hqp_rp/joint_box.hpp"
#include "hqp_rp/rotation.hpp"

namespace hqp {

// One task or limit. `numbers`: gain (m), weight (m), then what the kind needs (see each function).
struct RowItem {
  enum Kind : int { frame = 0, twist = 1, posture = 2, relative = 3, pointing = 4, box = 5 };
  int kind = frame;
  int rows = 0;
  int first = 0;              // its first row
  std::ptrdiff_t numbers = 0;  // where its numbers begin
  int moved = -1;             // its frame
  int axes = -1;              // the frame of its axes, -1 for the world
  std::ptrdiff_t index = 0;    // where its indices begin
};

template <class T>
class TaskRowsOf {
 public:
  int n = 0;                       // unknowns
  std::vector<RowItem> items;
  const std::int64_t* index = nullptr;
  const T* numbers = nullptr;
  const T* values = nullptr;  // coordinates that posture tasks and limits refer to, dt, velocity and acceleration before the step
  const T* rotations = nullptr;  // (F, 3, 3)
  const T* origins = nullptr;    // (F, 3)
  const T* jacobians = nullptr;  // (F, 6, n)

  // Fills the rows of all items in matrix (M, n), lower and upper (M,), then judges all M rows; rows of others stand in the arrays
  // already. upper null: every row is an equality. True where every entry is finite, bounds are ordered, and each row has an answer.
  bool fill(double* matrix, double* lower, double* upper, std::int64_t M, bool plain) const {
    for (const RowItem& item : items) {
      double* rows = matrix + static_cast<std::ptrdiff_t>(item.first) * n;
      double* rate = lower + item.first;
      switch (item.kind) {
        case RowItem::posture: posture_task(item, rows, rate, plain); break;
        case RowItem::box: box_limit(item, rows, rate, upper + item.first); continue;
        default: fill_task(item, rows, rate, plain);
      }
      for (int i = 0; upper && i < item.rows; ++i) upper[item.first + i] = lower[item.first + i];
    }
    bool sound = all_finite(matrix, M * n) && (upper || all_finite(lower, M));
    const double infinity = std::numeric_limits<double>::infinity();
    for (std::int64_t i = 0; upper && i < M; ++i) sound = sound && lower[i] <= upper[i] && lower[i] < infinity && upper[i] > -infinity;
    return sound;
  }

  // The rows of one task of frames, (m, n), and its rates (m,); false for postures and boxes, which name velocities.
  bool fill_task(const RowItem& item, T* rows, T* rate, bool plain) const {
    switch (item.kind) {
      case RowItem::frame: frame_task(item, rows, rate, plain); return true;
      case RowItem::twist: twist_task(item, rows, rate, plain); return true;
      case RowItem::relative: relative_task(item, rows, rate, plain); return true;
      case RowItem::pointing: pointing_task(item, rows, rate, plain); return true;
      default: return false;
    }
  }

 private:
  const T* rotation(int f) const { return rotations + 9 * f; }
  const T* origin(int f) const { return origins + 3 * f; }
  const T* jacobian(int f) const { return jacobians + static_cast<std::ptrdiff_t>(6) * n * f; }

  // row (n,) <- w times row `axis` of J, in the world's axes or, for axes >= 0, in those of that frame.
  void frame_row(const T* J, int axes, int axis, T w, T* row) const {
    if (axes < 0) {
      for (int j = 0; j < n; ++j) row[j] = w * J[axis * n + j];
      return;
    }
    const T* R = rotation(axes);
    const int half = axis >= 3 ? 3 : 0;
    const T x = w * R[axis - half], y = w * R[3 + axis - half], z = w * R[6 + axis - half];
    for (int j = 0; j < n; ++j) row[j] = x * J[half * n + j] + y * J[(half + 1) * n + j] + z * J[(half + 2) * n + j];
  }

  // lever (3,) <- from the origin of frame f to a point (3,) given in its axes, in world axes; whether it is not zero.
  bool lever_of(int f, const T* point, T* lever) const {
    const T* R = rotation(f);
    for (int k = 0; k < 3; ++k) lever[k] = R[3 * k] * point[0] + R[3 * k + 1] * point[1] + R[3 * k + 2] * point[2];
    return point[0] != 0.0 || point[1] != 0.0 || point[2] != 0.0;
  }

  // row (n,) += r . (omega x lever) = (lever x r) . omega: what turning adds to the velocity of a point along r.
  void add_turning(const T* J, const T* r, const T* lever, T* row) const {
    const T x = lever[1] * r[2] - lever[2] * r[1], y = lever[2] * r[0] - lever[0] * r[2], z = lever[0] * r[1] - lever[1] * r[0];
    for (int j = 0; j < n; ++j) row[j] += x * J[3 * n + j] + y * J[4 * n + j] + z * J[5 * n + j];
  }

  // r (3,) <- w times an axis, 0 to 2, of the world or, for axes >= 0, of that frame.
  void axis_of_frame(int axes, int axis, T w, T* r) const {
    for (int k = 0; k < 3; ++k) r[k] = axes < 0 ? (k == axis ? w : 0.0) : w * rotation(axes)[3 * k + axis];
  }

  // Position over orientation along chosen axes: numbers gain, weight, world feed-forward (6), R* (9), p* (3), the point of the frame
  // that is meant, in its axes (3); index: axes.
  // [R_f^T J_p - [e_p]x R_f^T J_omega,f; R_f^T J_omega] and e = [R_f^T (p* - p); R_f^T log(R* R^T)].
  void frame_task(const RowItem& item, T* rows, T* rate, bool plain) const {
    const int m = item.rows, f = item.moved, axes = item.axes;
    const T *gain = numbers + item.numbers, *weight = gain + m, *forward = weight + m, *target = forward + 6, *place = target + 9;
    const std::int64_t* axis_of = index + item.index;
    const T* J = jacobian(f);
    T e[6] = {}, feed[6], lever[3], r[3];
    const bool offset = lever_of(f, place + 3, lever);
    bool linear = false, angular = false;
    for (int i = 0; i < m; ++i) (axis_of[i] < 3 ? linear : angular) = true;
    if (linear)
      for (int k = 0; k < 3; ++k) e[k] = place[k] - (origin(f)[k] + lever[k]);
    if (angular) rotation_error(target, rotation(f), e + 3);
    for (int k = 0; k < 6; ++k) feed[k] = forward[k];
    if (axes >= 0)
      for (int half = 0; half < 6; half += 3) {
        to_local(rotation(axes), e + half, e + half);
        to_local(rotation(axes), feed + half, feed + half);
      }
    for (int i = 0; i < m; ++i) {
      const int axis = static_cast<int>(axis_of[i]);
      const T w = plain ? 1.0 : weight[i];
      T* row = rows + static_cast<std::ptrdiff_t>(i) * n;
      rate[i] = plain ? e[axis] : w * (feed[axis] + gain[i] * e[axis]);
      frame_row(J, axes, axis, w, row);
      if (offset && axis < 3) {
        axis_of_frame(axes, axis, w, r);
        add_turning(J, r, lever, row);
      }
      if (axes < 0 || axis >= 3) continue;
      // ([e]x R^T omega)_c = e_a (R^T omega)_b - e_b (R^T omega)_a with (c, a, b) in cyclic order
      const T *R = rotation(axes), *turning = jacobian(axes);
      const int a = (axis + 1) % 3, b = (axis + 2) % 3;
      const T x = w * (e[a] * R[b] - e[b] * R[a]), y = w * (e[a] * R[3 + b] - e[b] * R[3 + a]);
      const T z = w * (e[a] * R[6 + b] - e[b] * R[6 + a]);
      for (int j = 0; j < n; ++j) row[j] -= x * turning[3 * n + j] + y * turning[4 * n + j] + z * turning[5 * n + j];
    }
  }

  // A commanded velocity: numbers gain (not used), weight, velocity (m), point (3); index: axes. Rows (R_f^T J)[axes].
  void twist_task(const RowItem& item, T* rows, T* rate, bool plain) const {
    const int m = item.rows;
    const T *weight = numbers + item.numbers + m, *velocity = weight + m, *J = jacobian(item.moved);
    T lever[3], r[3];
    const bool offset = lever_of(item.moved, velocity + m, lever);
    for (int i = 0; i < m; ++i) {
      const int axis = static_cast<int>(index[item.index + i]);
      const T w = plain ? 1.0 : weight[i];
      T* row = rows + static_cast<std::ptrdiff_t>(i) * n;
      rate[i] = w * velocity[i];
      frame_row(J, item.axes, axis, w, row);
      if (!offset || axis >= 3) continue;
      axis_of_frame(item.axes, axis, w, r);
      add_turning(J, r, lever, row);
    }
  }

  // Chosen joints: numbers gain, weight, feed-forward, target (m each); index: velocities (m), then where in `values` their
  // coordinates are (m).
  void posture_task(const RowItem& item, T* rows, T* rate, bool plain) const {
    const int m = item.rows;
    const T *gain = numbers + item.numbers, *weight = gain + m, *forward = weight + m, *target = forward + m;
    const std::int64_t *velocity = index + item.index, *coordinate = velocity + m;
    for (int i = 0; i < m; ++i) {
      const T w = plain ? 1.0 : weight[i];
      const T error = target[i] - values[coordinate[i]];
      rate[i] = plain ? error : w * (forward[i] + gain[i] * error);
      T* row = rows + static_cast<std::ptrdiff_t>(i) * n;
      for (int j = 0; j < n; ++j) row[j] = 0.0;
      row[velocity[i]] = w;
    }
  }

  // Pose of frame b seen from a (the frame of the axes): numbers as of `frame_task`, all in a's axes.
  // e = [p* - R_a^T (p_b - p_a); log(R* (R_a^T R_b)^T)],
  // J = [R_a^T (J_p,b - J_p,a + [p_b - p_a]x J_omega,a); R_a^T (J_omega,b - J_omega,a)].
  void relative_task(const RowItem& item, T* rows, T* rate, bool plain) const {
    const int m = item.rows, b = item.moved, a = item.axes;
    const T *gain = numbers + item.numbers, *weight = gain + m, *forward = weight + m, *target = forward + 6, *place = target + 9;
    const T *R_a = rotation(a), *R_b = rotation(b), *J_a = jacobian(a), *J_b = jacobian(b);
    T e[6], between[3], local[3], seen[9], lever[3];
    const bool offset = lever_of(b, place + 3, lever);
    for (int k = 0; k < 3; ++k) between[k] = origin(b)[k] + lever[k] - origin(a)[k];
    to_local(R_a, between, local);
    for (int k = 0; k < 3; ++k) e[k] = place[k] - local[k];
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) seen[3 * i + j] = R_a[i] * R_b[j] + R_a[3 + i] * R_b[3 + j] + R_a[6 + i] * R_b[6 + j];
    rotation_error(target, seen, e + 3);
    for (int i = 0; i < m; ++i) {
      const int axis = static_cast<int>(index[item.index + i]);
      const T w = plain ? 1.0 : weight[i];
      T* row = rows + static_cast<std::ptrdiff_t>(i) * n;
      rate[i] = plain ? e[axis] : w * (forward[axis] + gain[i] * e[axis]);
      const int half = axis >= 3 ? 3 : 0;
      const T x = R_a[axis - half], y = R_a[3 + axis - half], z = R_a[6 + axis - half];
      for (int j = 0; j < n; ++j)
        row[j] = x * (J_b[half * n + j] - J_a[half * n + j]) + y * (J_b[(half + 1) * n + j] - J_a[(half + 1) * n + j]) +
                 z * (J_b[(half + 2) * n + j] - J_a[(half + 2) * n + j]);
      if (half == 0) {
        // r . ([d]x omega) = (r x d) . omega
        const T u = y * between[2] - z * between[1], v = z * between[0] - x * between[2], s = x * between[1] - y * between[0];
        for (int j = 0; j < n; ++j) row[j] += u * J_a[3 * n + j] + v * J_a[4 * n + j] + s * J_a[5 * n + j];
        const T r[3] = {x, y, z};
        if (offset) add_turning(J_b, r, lever, row);
      }
      for (int j = 0; j < n && w != 1.0; ++j) row[j] *= w;
    }
  }

  // An axis onto a direction: numbers gain, weight (2), feed-forward (3), basis (9), direction d (3), whether it is the direction of a
  // place (1), the point from where it is seen, in the frame's axes (3); two rows.
  // With B = R basis = (b1, b2, a): e = theta (-d . b2, d . b1) / |a x d|, J = (b1, b2)^T J_omega. A place p* at the distance r from the
  // point p is seen in the direction d = (p* - p) / r, which turns as p moves: J = (b1, b2)^T (J_omega + [d]x J_p / r).
  void pointing_task(const RowItem& item, T* rows, T* rate, bool plain) const {
    using std::atan2, std::hypot, std::sqrt;
    const T *gain = numbers + item.numbers, *weight = gain + 2, *forward = weight + 2, *basis = forward + 3, *given = basis + 9;
    const T *R = rotation(item.moved), *J = jacobian(item.moved);
    const bool place = given[3] != 0.0;
    T B[9], d[3], feed[3], direction[3] = {given[0], given[1], given[2]}, turning[3] = {forward[0], forward[1], forward[2]}, lever[3] = {};
    T distance = 0.0;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) B[3 * i + j] = R[3 * i] * basis[j] + R[3 * i + 1] * basis[3 + j] + R[3 * i + 2] * basis[6 + j];
    if (place) {
      lever_of(item.moved, given + 4, lever);
      for (int k = 0; k < 3; ++k) direction[k] -= origin(item.moved)[k] + lever[k];
      distance = sqrt(direction[0] * direction[0] + direction[1] * direction[1] + direction[2] * direction[2]);
      for (int k = 0; k < 3; ++k) direction[k] = distance > 0.0 ? direction[k] / distance : B[3 * k + 2];
      // The velocity of the place turns the direction by d x forward / r.
      const T *u = direction, scale = distance > 0.0 ? 1.0 / distance : 0.0;
      turning[0] = scale * (u[1] * forward[2] - u[2] * forward[1]);
      turning[1] = scale * (u[2] * forward[0] - u[0] * forward[2]);
      turning[2] = scale * (u[0] * forward[1] - u[1] * forward[0]);
    }
    to_local(B, direction, d);
    const T sine = hypot(d[0], d[1]);
    T error[2] = {d[2] > 0.0 ? 0.0 : 3.14159265358979323846, 0.0};
    if (sine > 0.0) {
      const T factor = atan2(sine, d[2]) / sine;
      error[0] = -factor * d[1], error[1] = factor * d[0];
    }
    to_local(B, turning, feed);
    for (int i = 0; i < 2; ++i) {
      const T w = plain ? 1.0 : weight[i];
      rate[i] = plain ? error[i] : w * (feed[i] + gain[i] * error[i]);
      T* row = rows + static_cast<std::ptrdiff_t>(i) * n;
      for (int j = 0; j < n; ++j) row[j] = w * (B[i] * J[3 * n + j] + B[3 + i] * J[4 * n + j] + B[6 + i] * J[5 * n + j]);
      if (distance == 0.0) continue;
      // b . (d x u) = (b x d) . u
      const T b[3] = {B[i], B[3 + i], B[6 + i]}, scale = w / distance;
      const T r[3] = {scale * (b[1] * direction[2] - b[2] * direction[1]), scale * (b[2] * direction[0] - b[0] * direction[2]),
                           scale * (b[0] * direction[1] - b[1] * direction[0])};
      for (int j = 0; j < n; ++j) row[j] += r[0] * J[j] + r[1] * J[n + j] + r[2] * J[2 * n + j];
      add_turning(J, r, lever, row);
    }
  }

  // Rows of the identity and the box: numbers gain, then least and greatest position, V, A and, where it is bounded, J (n each); index:
  // where in `values` each coordinate is, -1 for a velocity without one (n), then where dt is, which the velocity before the step
  // follows, then where the acceleration before the step is, -1 without J.
  void box_limit(const RowItem& item, double* rows, double* lower, double* upper) const {
    const double* given = numbers + item.numbers;
    const std::int64_t* coordinate = index + item.index;
    const std::int64_t time = coordinate[n], before = coordinate[n + 1];
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) rows[static_cast<std::ptrdiff_t>(i) * n + j] = i == j ? 1.0 : 0.0;
      JointBox box{given[0], given[1 + i], given[1 + n + i], given[1 + 2 * n + i], given[1 + 3 * n + i]};
      const double q = coordinate[i] >= 0 ? values[coordinate[i]] : 0.0, v = values[time + 1 + i], dt = values[time];
      if (before < 0) {
        box.at(q, v, dt, lower + i, upper + i);
      } else {
        box.jerk = given[1 + 4 * n + i];
        box.at(q, v, values[before + i], dt, lower + i, upper + i);
      }
    }
  }
};

using TaskRows = TaskRowsOf<double>;

}  // namespace hqp
