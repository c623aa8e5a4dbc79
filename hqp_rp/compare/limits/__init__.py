"""Limits: what scenarios that measure violations say of solvers with and without hard rows.

What flows: `cases` boil the rows of a scenario with limits down to violations, counts and peaks for each solver, `tables` and
`figures` show them, `findings` say them in sentences, and `opening` says them first.
"""

from hqp_rp.core.extras import require_report

require_report("hqp_rp.compare.limits")
