"""What the report of a stress test says first: which solver to take for what, one picture, three numbers.

Times are not among it: they differ from run to run, and stand in their own section.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from hqp_rp.compare.measure.cases import BOUNDED, KEPT, PARTING
from hqp_rp.compare.report.opening import advised, advised_against, first_chart
from hqp_rp.compare.report.report import Opening, Section
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.compare.report.words import number, share
from hqp_rp.compare.stress.findings import growth, level_error
from hqp_rp.compare.stress.plan import KINDS, LIMITS, RANDOM
from hqp_rp.compare.stress.record import StressResult

say = Sentences(__file__)


def opening_of_stress(test: StressResult, sections: Sequence[Section]) -> Opening:
    """Of a stress test; `sections` hold its charts."""
    summary = test.summary
    kinds = [KINDS.index(kind) for kind in (RANDOM, LIMITS)]
    judged = int(summary.judged[kinds].sum())
    advice: list[tuple[str, str]] = []
    numbers: list[tuple[str, str]] = []
    why = test.infeasible
    if why is not None:
        groups = [item.groups for item in why.found[:1]]
        numbers.append((share(why.samples / summary.samples), say("figure_infeasible", groups=groups)))
    if judged:
        right = summary.right[:, kinds].sum(axis=1)
        exact = [label for k, label in enumerate(summary.labels) if right[k] == judged]
        advice.append((say("need_anywhere", within=PARTING, judged=judged), advised(exact)))
        numbers.append((f"{len(exact)} of {len(summary.labels)}", say("figure_anywhere")))
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
        if any(not math.isnan(value) for value in times.values()):
            advice.append((say("need_passage", kept=KEPT, times=BOUNDED), advised(kept)))
            label, most = max(times.items(), key=lambda item: -1.0 if math.isnan(item[1]) else item[1])
            numbers.append((f"{number(most)} times", say("figure_growth", label=label)))
        lost = sorted(((label, e) for label, e in error.items() if e > KEPT), key=lambda item: -item[1])
        if lost:
            advice.append((say("need_level_1"), advised_against(lost)))
            label, most = lost[0]
            numbers.append((number(most), say("figure_lost", label=label)))
    return Opening(tuple(advice), tuple(numbers[:3]), first_chart(sections))
