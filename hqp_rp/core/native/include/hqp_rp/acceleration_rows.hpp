// The rows of tasks and limits on accelerations, from those on velocities.
#pragma once

#include <vector>

#include "hqp_rp/task_rows.hpp"

namespace hqp {

// With the velocity rows J v = ff of a task and its error e, all weighted by w:
//   J v-dot = kd (ff - J v) + kp e - (Jdot v - d/dt ff)
// The last term is the rate of J v - ff along the motion with v-dot = 0: the kernels of `TaskRows` on dual numbers with one column, in
// whose place the twists of the frames stand. Boxes bound the velocity after the step, v + dt v-dot.
class AccelerationRows {
 public:
  const double* number_rates = nullptr;  // how the numbers of the tasks change: accelerations of targets, velocities of their places
  const double *kp = nullptr, *kd = nullptr;  // of all rows of all items, one item after the other

  // rows: just filled into matrix, lower and upper. twists, biases (F, 6); v (n,); sizes: of numbers and of frames.
  void fill(const TaskRows& rows, const double* twists, const double* biases, const double* v, double dt, std::size_t numbers,
            std::size_t frames, double* lower, double* upper) {
    along(rows, twists, biases, numbers, frames);
    std::size_t first = 0;
    for (const RowItem& item : rows.items) {
      double *low = lower + item.first, *up = upper ? upper + item.first : nullptr;
      const double *stiff = kp + first, *damp = kd + first, *gain = rows.numbers + item.numbers, *weight = gain + item.rows;
      first += static_cast<std::size_t>(item.rows);
      if (item.kind == RowItem::box) {
        for (int i = 0; i < item.rows; ++i) low[i] = (low[i] - v[i]) / dt, up[i] = (up[i] - v[i]) / dt;
        continue;
      }
      if (item.kind == RowItem::posture) {
        const double *forward = weight + item.rows, *target = forward + item.rows, *change = number_rates + (forward - rows.numbers);
        const std::int64_t *velocity = rows.index + item.index, *coordinate = velocity + item.rows;
        for (int i = 0; i < item.rows; ++i)
          low[i] = weight[i] * (damp[i] * (forward[i] - v[velocity[i]]) + stiff[i] * (target[i] - rows.values[coordinate[i]]) + change[i]);
      } else {
        Dual plain[6], error[6], weighted[6], rate[6];
        dual_.fill_task(item, plain, error, true);
        dual_.fill_task(item, weighted, rate, false);
        for (int i = 0; i < item.rows; ++i) {
          const Dual forward = rate[i] * (1.0 / weight[i]) - error[i] * gain[i], missing = forward - plain[i];
          low[i] = weight[i] * (damp[i] * missing.value + stiff[i] * error[i].value + missing.rate);
        }
      }
      for (int i = 0; up && i < item.rows; ++i) up[i] = low[i];
    }
  }

 private:
  void along(const TaskRows& rows, const double* twists, const double* biases, std::size_t numbers, std::size_t frames) {
    numbers_.resize(numbers);
    for (std::size_t i = 0; i < numbers; ++i) numbers_[i] = {rows.numbers[i], number_rates[i]};
    rotations_.resize(9 * frames);
    origins_.resize(3 * frames);
    twists_.resize(6 * frames);
    for (std::size_t f = 0; f < frames; ++f) {
      const double *R = rows.rotations + 9 * f, *p = rows.origins + 3 * f, *V = twists + 6 * f, *w = V + 3;
      for (int j = 0; j < 3; ++j) {
        const double x = R[j], y = R[3 + j], z = R[6 + j];
        rotations_[9 * f + j] = {x, w[1] * z - w[2] * y};
        rotations_[9 * f + 3 + j] = {y, w[2] * x - w[0] * z};
        rotations_[9 * f + 6 + j] = {z, w[0] * y - w[1] * x};
        origins_[3 * f + j] = {p[j], V[j]};
      }
      for (int k = 0; k < 6; ++k) twists_[6 * f + k] = {V[k], biases[6 * f + k]};
    }
    dual_.n = 1;
    dual_.index = rows.index;
    dual_.numbers = numbers_.data();
    dual_.rotations = rotations_.data();
    dual_.origins = origins_.data();
    dual_.jacobians = twists_.data();
  }

  TaskRowsOf<Dual> dual_;
  std::vector<Dual> numbers_, rotations_, origins_, twists_;
};

}  // namespace hqp
