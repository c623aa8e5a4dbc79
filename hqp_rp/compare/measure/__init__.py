"""What a run of solvers on scenarios measured, before anybody rules on it.

What flows: `units` (scenario, solver, seed) are run in worker processes, each step judged by `metrics` against `reference`,
the optimum as exactly as it can be had; `cases` boil the rows of one scenario down to one outcome for each solver.
"""

from hqp_rp.core.extras import require_report

require_report("hqp_rp.compare.measure")
