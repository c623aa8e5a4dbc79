"""The comparison: every solver on every scenario, and what follows from it.

What flows: `record` holds what a comparison found, `findings` rule on the cases that `measure` and `limits` made, in
sentences; `thresholds` say which of that hangs on one, `figures` draw them, `opening` picks what is said first, `report` puts
the page together, and `comparison` runs what is missing and writes all of it.
"""

from hqp_rp.core.extras import require_report

require_report("hqp_rp.compare.comparison")
