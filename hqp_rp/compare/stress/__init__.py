"""The stress test: one robot and stack, its singularities, every solver, as many samples as one likes.

What flows: `subject` says which robot and stack, `atlas` keeps its singularities, `plan` lays out samples in chunks, `levels`
and `judge` judge answers against references, `rows` solve and judge a chunk, `run` spreads chunks over workers, `summary`
counts over all rows, `infeasible` says why samples have no answer, and `record` holds what was found; `findings`, `worst`,
`opening` and `report` tell it, `stress` does all of it, and `reports` remakes the reports in docs.
"""

from hqp_rp.core.extras import require_report

require_report("hqp_rp.compare.stress")
