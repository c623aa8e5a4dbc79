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
from hqp_rp.compare.report.words import number


def opening_of_comparison(comparison: ComparisonResult, sections: Sequence[Section]) -> Opening:
    """Of a comparison; `sections` hold its charts."""
    cases, limits = comparison.without_limits, comparison.limits
    advice: list[tuple[str, str]] = []
    numbers: list[tuple[str, str]] = []
    if cases:
        exact, through = exact_everywhere(cases), safe_everywhere(cases)
        advice.append((f"The exact answer (within {number(PARTING)} of it away from singularities)", advised(exact)))
        advice.append(("A path through a singularity, level 1 exact and |x| bounded", advised(through)))
        lost = losers_of_level_1(cases)
        if lost:
            advice.append(("Avoid, where level 1 matters", advised_against(lost)))
            numbers.append(
                (number(lost[0][1]), f"the most that level 1 lost, by {lost[0][0]}, in the unit of the task")
            )
        grown = [(o, case) for case in cases for o in case.outcomes if o.x_max is not None and case.far_norm]
        if grown:
            worst, case = max(grown, key=lambda pair: (pair[0].x_max or 0.0) / (pair[1].far_norm or 1.0))
            times = (worst.x_max or 0.0) / (case.far_norm or 1.0)
            numbers.append(
                (f"{number(times)} times", f"|x| of {worst.label} over what is needed far from the singularity")
            )
        if exact:
            everybody = {outcome.label for case in cases for outcome in case.outcomes}
            numbers.append((f"{len(exact)} of {len(everybody)}", "solvers are exact in every case that they take"))
    if limits:
        advice += limits_advice(limits)
        if not numbers:
            numbers = limits_numbers(limits)
    return Opening(tuple(advice), tuple(numbers[:3]), first_chart(sections))
