// Damping policies: what replaces 1 / sigma when singular values become small. Equations (14)-(19) of the paper.
#pragma once

namespace hqp {

// none: 1 / sigma for every singular value that the rank rule keeps (17).
// constant: sigma / (sigma^2 + first^2) (15).
// variable: the same with lambda_0^2 = (1 - (sigma_m / first)^2) second^2 where sigma_m < first, else 0 (18)-(19).
// truncation: 1 / sigma for sigma > first, else 0.
// manipulability: constant damping by (1 - w / first) second where w, the product of all singular values, is below first.
// filtering: variable damping of the last singular direction alone.
// (4 is a damping of single levels, by their error, which no inverse knows.)
struct Damping {
  enum Kind : int { none = 0, constant = 1, variable = 2, truncation = 3, manipulability = 5, filtering = 6 };
  int kind = none;
  double first = 0.0;   // in the unit of the matrix that is inverted; w's, of manipulability
  double second = 0.0;
  double unit = 1.0;    // what that matrix was multiplied by before its singular values were taken
};

}  // namespace hqp
