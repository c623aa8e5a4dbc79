"""The paper's claims, tested: experiments over many postures and seeds, what they measured, verdicts, and the report.

What flows: `places` (where the arm starts) and `methods` (who solves) make the `trials` of `experiments`; each becomes one row
of figures (`contact_figures`, `response_figures`); `outcomes` boil rows down to shares and intervals, `judges` ask each claim
of them, `algebra` says what needs no run, `verdicts` rule; `charts`, `overview` and `report` show them. What a reader reads is
in `sentences.j2`, here and in the two folders.
"""

from hqp_rp.core.extras import require_report

require_report("hqp_rp.compare.claims")
