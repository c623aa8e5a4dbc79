#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "hqp_rp/tolerances.hpp"
#include "objects.hpp"

namespace hqp::python {

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// The box that hard rows of one non-zero entry each put on x: (-2, -1) when all is well, (row, -1) for a row of zeros that cannot be met,
// (row, row) for two rows in conflict, (-1, row) for a row with more than one entry.
std::pair<int, int> box_of(const Problem& problem, double* low, double* high, int* first, int* second) {
  const int n = problem.unknowns;
  for (int j = 0; j < n; ++j) low[j] = -infinity, high[j] = infinity, first[j] = second[j] = -1;
  for (int i = 0; i < problem.hard_rows; ++i) {
    const double* row = problem.hard_matrix + static_cast<std::ptrdiff_t>(i) * n;
    int at = -1;
    for (int j = 0; j < n; ++j) {
      if (row[j] == 0.0) continue;
      if (at >= 0) return {-1, i};
      at = j;
    }
    if (at < 0) {
      if (problem.hard_lower[i] > 0.0 || problem.hard_upper[i] < 0.0) return {i, -1};
      continue;
    }
    double a = problem.hard_lower[i] / row[at], b = problem.hard_upper[i] / row[at];
    if (a > b) std::swap(a, b);
    if (a > low[at]) low[at] = a, first[at] = i;
    if (b < high[at]) high[at] = b, second[at] = i;
  }
  for (int j = 0; j < n; ++j) {
    if (!(low[j] > high[j])) continue;
    if (low[j] - high[j] > tolerance::saturation_slack * (std::fabs(low[j]) + std::fabs(high[j])))
      return {std::min(first[j], second[j]), std::max(first[j], second[j])};
    low[j] = high[j];  // two rows that meet up to rounding
  }
  return {-2, -1};
}

}  // namespace

void bind_saturation(nb::module_& module) {
  module.def(
      "saturation_null_space",
      [](nb::object problem, nb::object secondary, double rank_tolerance, bool optimal) -> nb::tuple {
        const Problem& view = nb::inst_ptr<ProblemObject>(problem)->view;
        const int n = view.unknowns;
        Workspace& workspace = thread_workspace();
        Workspace::Scope scope(workspace);
        double *low = workspace.numbers(n), *high = workspace.numbers(n), *zeta = workspace.numbers(n);
        const auto [first, second] = box_of(view, low, high, workspace.counts(n), workspace.counts(n));
        if (first != -2) return nb::make_tuple(first, second);
        const double* free = secondary_in(secondary, n);
        for (int j = 0; j < n; ++j) zeta[j] = free ? free[j] : 0.0;
        nb::object x = new_array({n}), scales = new_array({view.levels});
        SaturationCall call;
        call.problem = &view;
        call.low = low, call.high = high, call.zeta = zeta;
        call.rank_tolerance = rank_tolerance;
        call.optimal = optimal;
        call.x = numbers_in(x);
        call.scales = numbers_in(scales);
        const bool finite = kernels().saturation(call, workspace);
        return nb::make_tuple(x, scales, finite, call.tried, call.unfinished, call.missed);
      },
      nb::arg("problem"), nb::arg("secondary").none(), nb::arg("rank_tolerance"), nb::arg("optimal"),
      "(x, scale of each level, finite, tried, unfinished level, missed level), -1 for no level; for a box without a point or rows that are "
      "none (row, row), see the source.");
}

}  // namespace hqp::python
