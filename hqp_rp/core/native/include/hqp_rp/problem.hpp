// A prioritized problem as views of arrays that somebody else keeps: levels of rows lower <= A x <= upper, stacked, most
// important first, and hard rows that no answer may violate.
#pragma once

#include <cstddef>
#include <cstdint>

namespace hqp {

// Row-major, contiguous, in double precision. `offsets` has levels + 1 entries: level k holds rows offsets[k] ... offsets[k + 1] - 1.
// A level's row is an equality where its bounds coincide; an infinite bound is none.
struct Problem {
  const double* matrix = nullptr;  // (rows, unknowns)
  const double* lower = nullptr;   // (rows,)
  const double* upper = nullptr;   // (rows,)
  const std::int64_t* offsets = nullptr;
  int rows = 0;
  int unknowns = 0;
  int levels = 0;
  const double* hard_matrix = nullptr;  // (hard_rows, unknowns)
  const double* hard_lower = nullptr;
  const double* hard_upper = nullptr;
  int hard_rows = 0;
};

// Bytes that hold so many matrices of a problem's size, vectors beside each: what kernels reserve before they begin.
inline std::size_t room(const Problem& problem, int matrices) {
  const std::size_t n = static_cast<std::size_t>(problem.unknowns) + 8, rows = n + problem.rows + problem.hard_rows;
  return sizeof(double) * matrices * (rows * (n + 24) + 16 * static_cast<std::size_t>(problem.levels) + 64);
}

// Rows D_k beside those of level k, which then minimizes ||v_k||^2 + ||D_k x - d_k||^2; later levels keep what the level's own rows reached.
// Nothing for a level without such rows, or where `offsets` is null.
struct Damped {
  const double* rows = nullptr;           // (R, unknowns)
  const double* rhs = nullptr;            // (R,)
  const std::int64_t* offsets = nullptr;  // (levels + 1,)
  int of(int k) const { return offsets ? static_cast<int>(offsets[k + 1] - offsets[k]) : 0; }
};

// N problems of equalities of one shape, and where their answers go.
struct Batch {
  Problem shape;                    // its matrix and bounds are not used
  const double* matrix = nullptr;   // (N, rows, unknowns)
  const double* rhs = nullptr;      // (N, rows)
  const double* free = nullptr;     // (N, unknowns), or (unknowns,) where free_step is 0, or null
  std::int64_t free_step = 0;
  std::int64_t count = 0;           // N
  double* x = nullptr;              // (N, unknowns); nan where there is no answer
  unsigned char* codes = nullptr;   // (N,) positions in Status
};

// How a solve ended; the numbers are the positions in hqp_rp.Status.
enum class Outcome : int { solved = 0, inaccurate = 1, iteration_limit = 2, infeasible = 3, not_finite = 4, refused = 5 };

}  // namespace hqp
