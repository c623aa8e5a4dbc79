#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "hqp_rp/tolerances.hpp"
#include "objects.hpp"

namespace hqp::python {

namespace {

// Which problems share a guess: those of the same unknowns and the same rows at each level.
struct Remembered {
  int unknowns = 0, hard_rows = 0;
  std::vector<std::int64_t> offsets;
  std::vector<int> side;
  std::vector<double> x;
  int misses = 0;  // guesses in a row that were not worth it
  std::uint64_t used = 0;

  bool fits(const Problem& p) const {
    return unknowns == p.unknowns && hard_rows == p.hard_rows && static_cast<int>(offsets.size()) == p.levels + 1 &&
           std::equal(offsets.begin(), offsets.end(), p.offsets);
  }
};

constexpr std::size_t remembered_shapes = 16;
constexpr int misses_allowed = 2;

// The solver with its settings, and the active rows of the last answer to each shape of problem.
//
// An answer must not depend on what came before. Where a search that began at the last answer came from afar, so that x carries the
// rounding error of where it was, or near a singularity, where rounding might have decided differently, it is done once more from
// nothing. Everything happens under the interpreter's lock: one object may be shared by any number of threads.
class ActiveSet {
 public:
  ActiveSet(double rank_tolerance, int max_iterations, bool warm_start, bool least_violation)
      : rank_tolerance_(rank_tolerance), max_iterations_(max_iterations), warm_start_(warm_start), least_violation_(least_violation) {}

  // A Solution where the search ended in one; else (code, iterations, x, side), code a position in Status: 1 asks for a verdict.
  nb::object solve(nb::handle problem, nb::handle secondary) {
    const Problem& view = nb::inst_ptr<ProblemObject>(problem)->view;
    const int n = view.unknowns, rows = view.hard_rows + view.rows;
    ActiveSetCall call;
    call.problem = &view;
    call.z = secondary_in(secondary, n);
    nb::object damping;  // holds the rows while they are read
    if (!nb::inst_ptr<ProblemObject>(problem)->damping.is_none()) {
      damping = problem.attr("damping_rows");
      nb::object D = damping[0], d = damping[1], offsets = damping[2];
      call.damped = {required<double>(D, 2, "damping rows"), required<double>(d, 1, "their right-hand sides"), required<std::int64_t>(offsets, 1, "their offsets")};
      if (length_of(offsets.ptr()) != view.levels + 1 || length_of(D.ptr(), 1) != n || call.damped.offsets[0] != 0 || length_of(d.ptr()) != length_of(D.ptr()) ||
          call.damped.offsets[view.levels] != length_of(D.ptr()))
        throw nb::value_error("The damping rows do not fit the problem.");
    }
    call.rank_tolerance = rank_tolerance_;
    const int searched = damping.is_valid() ? 2 * rows + n * view.levels : rows;
    call.limit = max_iterations_ < 0 ? 200 + 10 * searched : max_iterations_;
    call.least_violation = least_violation_;
    Workspace& workspace = thread_workspace();
    Workspace::Scope scope(workspace);
    call.side = workspace.counts(rows + 1);
    nb::object x = new_array({n});
    call.x = numbers_in(x);
    Remembered* before = warm_start_ ? remembered(view) : nullptr;
    Outcome outcome = Outcome::iteration_limit;
    bool done = false;
    if (before && before->misses < misses_allowed) {
      std::copy(before->side.begin(), before->side.end(), call.side);
      std::copy(before->x.begin(), before->x.end(), call.x);
      call.guessed = true;
      outcome = kernels().active_set(call, workspace);
      done = outcome == Outcome::solved && !call.delicate && length(before->x.data(), n) <= tolerance::afar * length(call.x, n);
      if (!done) before->misses = std::min(before->misses + 1, misses_allowed);
    }
    if (!done) {
      call.guessed = false;
      std::fill(call.x, call.x + n, 0.0);
      outcome = kernels().active_set(call, workspace);
    }
    if (outcome != Outcome::solved) {
      if (outcome != Outcome::inaccurate && before) forget(before);
      return nb::make_tuple(static_cast<int>(outcome), call.iterations, x, as_int8(call.side, rows));
    }
    if (warm_start_) remember(before, view, call.side, rows, call.x);
    nb::object solution = make_solution(problem, std::move(x), outcome, call.iterations, nb::object(),
                                        secondary.is_none() ? nb::object() : nb::borrow(secondary));
    nb::inst_ptr<SolutionObject>(solution)->held = as_int8(call.side, rows);
    return solution;
  }

  void reset() { kept_.clear(); }

 private:
  static double length(const double* x, int n) {
    double s = 0.0;
    for (int j = 0; j < n; ++j) s += x[j] * x[j];
    return std::sqrt(s);
  }

  Remembered* remembered(const Problem& view) {
    for (Remembered& one : kept_)
      if (one.fits(view)) return &one;
    return nullptr;
  }
  void forget(Remembered* one) { one->misses = misses_allowed; }

  void remember(Remembered* before, const Problem& view, const int* side, int rows, const double* x) {
    if (before) {
      int active = 0, other = 0;
      for (int i = 0; i < rows; ++i) {
        active += side[i] != 0;
        other += side[i] != before->side[i];
      }
      before->misses = 4 * other > active + 3 ? std::min(before->misses + 1, misses_allowed) : 0;
    } else {
      if (kept_.size() == remembered_shapes)
        kept_.erase(std::min_element(kept_.begin(), kept_.end(),
                                     [](const Remembered& a, const Remembered& b) { return a.used < b.used; }));
      kept_.push_back({view.unknowns, view.hard_rows, {view.offsets, view.offsets + view.levels + 1}, std::vector<int>(rows), std::vector<double>(view.unknowns), 0, 0});
      before = &kept_.back();
    }
    std::copy(side, side + rows, before->side.begin());
    std::copy(x, x + view.unknowns, before->x.begin());
    before->used = ++uses_;
  }

  const double rank_tolerance_;
  const int max_iterations_;  // -1: by the number of rows
  const bool warm_start_, least_violation_;
  std::vector<Remembered> kept_;
  std::uint64_t uses_ = 0;
};

}  // namespace

void bind_active_set(nb::module_& module) {
  nb::class_<ActiveSet>(module, "ActiveSet", "The hierarchical active set with its settings and its warm starts.")
      .def(nb::init<double, int, bool, bool>(), nb::arg("rank_tolerance"), nb::arg("max_iterations"), nb::arg("warm_start"),
           nb::arg("least_violation"), "max_iterations: working sets factored, -1 for 200 + 10 per row.")
      .def("solve", &ActiveSet::solve, nb::arg("problem"), nb::arg("secondary").none(),
           "Its Solution where the search ended in one, else (position in Status, iterations, x, side); 1 asks for a verdict.")
      .def("reset", &ActiveSet::reset, "Forget warm starts.");

  module.def(
      "proven_optimal",
      [](nb::object problem, nb::object x, nb::object zeta, double accept, double rank_tolerance) {
        const Problem& view = nb::inst_ptr<ProblemObject>(problem)->view;
        const double *point = required<double>(x, 1, "x"), *goal = required<double>(zeta, 1, "zeta");
        if (length_of(x.ptr()) != view.unknowns || length_of(zeta.ptr()) != view.unknowns)
          throw nb::value_error("x or zeta does not fit the problem.");
        return kernels().proven_optimal(view, point, goal, accept, rank_tolerance, thread_workspace());
      },
      nb::arg("problem"), nb::arg("x"), nb::arg("zeta"), nb::arg("accept"), nb::arg("rank_tolerance"),
      "Whether x (n,) is proven to be the lexicographic optimum nearest to zeta (n,); False proves nothing.");

  module.def(
      "active_set",
      [](nb::object problem, nb::object secondary, double rank_tolerance, int limit, bool least_violation, nb::object x,
         nb::object side) {
        const Problem& view = nb::inst_ptr<ProblemObject>(problem)->view;
        ActiveSetCall call;
        call.problem = &view;
        if (!secondary.is_none()) call.z = required<double>(secondary, 1, "secondary");
        call.rank_tolerance = rank_tolerance;
        call.limit = limit;
        call.least_violation = least_violation;
        call.guessed = true;
        call.x = writable<double>(x, 1, "x");
        auto* given = writable<std::int64_t>(side, 1, "side");
        const int rows = view.hard_rows + view.rows;
        if (length_of(x.ptr()) != view.unknowns || length_of(side.ptr()) != rows ||
            (call.z && length_of(secondary.ptr()) != view.unknowns))
          throw nb::value_error("x, side or secondary does not fit the problem.");
        Workspace& workspace = thread_workspace();
        Workspace::Scope scope(workspace);
        call.side = workspace.counts(rows + 1);
        std::copy(given, given + rows, call.side);
        const Outcome outcome = kernels().active_set(call, workspace);
        std::copy(call.side, call.side + rows, given);
        return nb::make_tuple(static_cast<int>(outcome), call.iterations);
      },
      nb::arg("problem"), nb::arg("secondary").none(), nb::arg("rank_tolerance"), nb::arg("limit"), nb::arg("least_violation"),
      nb::arg("x"), nb::arg("side"),
      "One search from x (n,) and side (hard rows and rows,) int64, both overwritten: (position in Status, iterations).");
}

}  // namespace hqp::python
