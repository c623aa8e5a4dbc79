"""What the report of a stress test says first: which solver to take for what, one picture, three numbers.

Times are not among it: they differ from run to run, and stand in their own section.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from hqp_rp.compare.measure.cases import BOUNDED, KEPT, PARTING
from hqp_rp.compare.report.opening import advised, advised_against, first_chart
from hqp_rp.compare.report.report import Opening, Section
from hqp_rp.compare.report.words import number
from hqp_rp.compare.stress.findings import growth, level_error
from hqp_rp.compare.stress.plan import KINDS, LIMITS, RANDOM
from hqp_rp.compare.stress.record import StressResult


def opening_of_stress(test: StressResult, sections: Sequence[Section]) -> Opening:
    """Of a stress test; `sections` hold its charts."""
    summary = test.summary
    kinds = [KINDS.index(kind) for kind in (RANDOM, LIMITS)]
    judged = int(summary.judged[kinds].sum())
    advice: list[tuple[str, str]] = []
    numbers: list[tuple[str, str]] = []
    if judged:
        right = summary.right[:, kinds].sum(axis=1)
        exact = [label for k, label in enumerate(summary.labels) if right[k] == judged]
        advice.append(
            (f"Anywhere but near singularities (within {number(PARTING)} in all {judged} samples)", advised(exact))
        )
        numbers.append((f"{len(exact)} of {len(summary.labels)}", "solvers were right in all of these"))
    cases = range(len(summary.cases))
    if summary.cases:
        error = {
            label: max((e for c in cases if not math.isnan(e := level_error(summary, c, k, 0))), default=math.nan)
            for k, label in enumerate(summary.labels)
        }
        times = {
            label: max((g for c in cases if not math.isnan(g := growth(summary, c, k))), default=math.nan)
            for k, label in enumerate(summary.labels)
        }
        kept = [label for label in error if error[label] <= KEPT and times[label] <= BOUNDED]
        need = f"A path through a singularity, level 1 to {number(KEPT)} and |x| within {BOUNDED:g} times"
        if any(not math.isnan(value) for value in times.values()):
            advice.append((need, advised(kept)))
            label, most = max(times.items(), key=lambda item: -1.0 if math.isnan(item[1]) else item[1])
            numbers.append((f"{number(most)} times", f"|x| of {label} over what is needed far from the singularity"))
        lost = sorted(((label, e) for label, e in error.items() if e > KEPT), key=lambda item: -item[1])
        if lost:
            advice.append(("Avoid, where level 1 matters", advised_against(lost)))
            numbers.append((number(lost[0][1]), f"the largest relative error of level 1, by {lost[0][0]}"))
    return Opening(tuple(advice), tuple(numbers[:3]), first_chart(sections))
