"""Figures: charts as data, their two forms, and films of an arm.

What flows: `chart` holds the records (lines, dots, bars, grids: numbers and words, nothing drawn), `panels` lays measured
curves out in them, `html` and `png` draw a chart for a page and for a file. Of a film, `film_shot` records what an arm did,
`film_stage` poses and lights it, `film_sheet` sets pictures and curves beside each other, and `film` writes the pictures.
"""

from hqp_rp.core.extras import require_report

require_report("hqp_rp.compare.figures")
