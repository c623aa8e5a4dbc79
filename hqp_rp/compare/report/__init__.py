"""Reports: one as data, the words it is written in, and its two forms.

What flows: `report` holds the records (`Report`, `Section`, `Table`, `Opening`: ready-made sentences, cells and charts),
`words` spells figures and names, `opening` picks what is said first, and `write` turns a `Report` into report.html, report.md
and figures with the files in `templates`. What is said is put together where it was measured: in `comparison`, `limits`,
`stress`, `claims` and the benchmark.
"""

from hqp_rp.core.extras import require_report

require_report("hqp_rp.compare.report")
