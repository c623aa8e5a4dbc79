"""What the report of a comparison says first: which solver to take for what, one picture, three numbers, all measured.

Times are not among it: they differ from run to run, and stand in their own section.
"""

from __future__ import annotations

from collections.abc import Sequence

from hqp_rp.compare.comparison.findings import exact_everywhere, losers_of_level_1, safe_everywhere
from hqp_rp.compare.comparison.record import ComparisonResult
from hqp_rp.compare.limits.opening import limits_advice, limits_numbers
from hqp_rp.compare.measure.cases import PARTING
from hqp_rp.compare.report.opening import advised, advised_against, first_chart
from hqp_rp.compare.report.report import Opening, Section
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.compare.report.words import number

say = Sentences(__file__)


def opening_of_comparison(comparison: ComparisonResult, sections: Sequence[Section]) -> Opening:
    """Of a comparison; `sections` hold its charts."""
    cases, limits = comparison.without_limits, comparison.limits
    advice: list[tuple[str, str]] = []
    numbers: list[tuple[str, str]] = []
    if cases:
        exact, through = exact_everywhere(cases), safe_everywhere(cases)
        advice.append((say("need_exact", within=PARTING), advised(exact)))
        advice.append((say("need_passage"), advised(through)))
        lost = losers_of_level_1(cases)
        if lost:
            advice.append((say("need_level_1"), advised_against(lost)))
            label, most = lost[0]
            numbers.append((number(most), say("figure_lost", label=label)))
        grown = [(o, case) for case in cases for o in case.outcomes if o.x_max is not None and case.far_norm]
        if grown:
            worst, case = max(grown, key=lambda pair: (pair[0].x_max or 0.0) / (pair[1].far_norm or 1.0))
            times = (worst.x_max or 0.0) / (case.far_norm or 1.0)
            numbers.append((f"{number(times)} times", say("figure_growth", label=worst.label)))
        if exact:
            everybody = {outcome.label for case in cases for outcome in case.outcomes}
            numbers.append((f"{len(exact)} of {len(everybody)}", say("figure_exact")))
    if limits:
        advice += limits_advice(limits)
        if not numbers:
            numbers = limits_numbers(limits)
    return Opening(tuple(advice), tuple(numbers[:3]), first_chart(sections))
