// What a cascade of QPs asks of a back end, and the face by which it is driven, whatever instruction set it was compiled for.
#pragma once

#include "hqp_rp/problem.hpp"

namespace hqp {

// min 1/2 u^T hessian u + gradient . u over u = (t, s), lower <= slack_rows u <= upper; rows are slack_rows on t alone.
struct QP {
  int n = 0;     // entries of t
  int m = 0;     // rows
  int soft = 0;  // the first of them have a slack each
  bool guessed = false;
  double* hessian = nullptr;     // (n + soft, n + soft)
  double* gradient = nullptr;    // (n + soft,)
  double* rows = nullptr;        // (m, n)
  double* slack_rows = nullptr;  // (m, n + soft)
  double* lower = nullptr;       // (m,), 1e20 or more where there is no bound
  double* upper = nullptr;
  double* start = nullptr;       // (n + soft,) a guess
  double* y = nullptr;           // (m,) its multipliers, > 0 at an upper bound
};

class QPStages {
 public:
  enum class Asked : int {
    nothing = 0,     // done: x is the answer
    not_finite = 1,
    plain = 2,       // a QP without rows
    rows = 3,        // a QP with rows
    violated = 4     // hard rows remain violated beyond the tolerance after their stage; `answer` without one goes on all the same
  };
  virtual ~QPStages() = default;
  virtual Asked begin(const Problem& problem, const double* start, double accept, double rank_tolerance, bool polish) = 0;
  virtual Asked answer(const double* t, const double* y) = 0;
  virtual Asked go_on() = 0;  // after `violated`
  virtual const QP& qp() const = 0;
  virtual const double* x() const = 0;
  virtual const double* least() const = 0;  // the point of least violation of the hard rows
  virtual const int* side() const = 0;
  virtual int stage() const = 0;
};

}  // namespace hqp
