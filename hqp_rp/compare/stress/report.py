"""The report of a stress test: findings, claims, figures, tables, worst cases with the command that replays each."""

from __future__ import annotations

import pathlib

import numpy as np
from numpy.typing import NDArray

from hqp_rp.compare.comparison.findings import DAMPED
from hqp_rp.compare.figures.chart import Chart, Line, Lines, styles
from hqp_rp.compare.figures.panels import grouped
from hqp_rp.compare.machine import machine, versions
from hqp_rp.compare.measure.cases import BOUNDED, KEPT, PARTING
from hqp_rp.compare.report.report import Report, Section, Table
from hqp_rp.compare.report.words import number, share
from hqp_rp.compare.stress.findings import (
    FAR_FROM,
    answer,
    case_sentences,
    claims,
    growth,
    leaves,
    level_error,
    title_of,
    unsolved,
)
from hqp_rp.compare.stress.judge import JUMP, RESOLVED
from hqp_rp.compare.stress.opening import opening_of_stress
from hqp_rp.compare.stress.plan import FAR, KINDS, NEAR, PER_DECADE
from hqp_rp.compare.stress.record import StressResult
from hqp_rp.compare.stress.summary import RATIO_FINE, RATIOS, WORST, Summary, quantile, sigma_of_bins
from hqp_rp.compare.stress.worst import replay_command

ERROR_FLOOR, ERROR_CEILING = 1e-17, 1e4
NORM_FLOOR, NORM_CEILING = 1e-4, 1e16
SHOWN_DECADES = 8

_CANNOT_TELL = (
    "The search finds points of families of singular configurations, and no proof that there are no others.",
    "Every sample stands alone, at rest: a controller in motion takes other paths, and warm starts are not used.",
    f"Distances below {RESOLVED:g} are not told apart: where a problem is well conditioned the optimum is a double-precision "
    "one. Near a singularity it is the exact truth by the library's rank rule (1e-12 of the level's norm).",
    "Below the rank rule's threshold the exact rank and the rule differ; such samples are marked ambiguous, and count neither "
    "in errors nor in distances.",
    "Medians, quantiles and extremes along the paths come from histograms of 1/8 decade: they are right to within 15 %.",
    "Times are means over whole batches for closed forms and single calls for the others, with as many processes at work as "
    "there are cores: compare them with each other only, and only when they differ by more than a factor of two.",
)


def stress_report(test: StressResult) -> Report:
    """The whole report of a stress test, as data."""
    verdicts = claims(test)
    sections = [
        Section("The answer", answer(test), listed=True),
        Section("What this cannot tell", _CANNOT_TELL, listed=True),
        Section(
            "Towards the singularities",
            (
                f"Paths of {PER_DECADE} samples a decade lead from sigma = {FAR:g}, or the largest on their line, to {NEAR:g}.",
            )
            if test.summary.cases
            else ("There are no paths.",),
            sections=tuple(_case(test.summary, c, test) for c in range(len(test.summary.cases))),
        ),
        Section("Performance profiles", charts=(_profiles(test),)),
    ]
    opening = opening_of_stress(test, sections)
    if verdicts:
        rows = tuple((verdict.claim, verdict.case, verdict.holds, verdict.evidence) for verdict in verdicts)
        caption = (
            f"Exact means a relative error of at most {number(KEPT)}; bounded means within {BOUNDED:g} times what is "
        )
        caption += (
            f"needed where sigma >= {FAR_FROM:g}. The last claim, '{DAMPED}', has one row for each damped variant."
        )
        table = Table(
            "Each claim towards each kind of singularity",
            ("claim", "singularities", "holds", "evidence"),
            rows,
            caption,
            text=frozenset(range(4)),
        )
        sections.append(Section("What the paper on reverse priority claims", tables=(table,)))
    sections += [
        Section("All samples", tables=(_outcomes(test.summary), *_statuses(test))),
        Section("Worst cases", tables=(_worst(test),)),
        Section("Settings", tables=(_atlas(test), _solvers(test), _settings(test))),
    ]
    labels = [names for _, names in grouped(test.plan.contestants)]
    title = f"hqp_rp: {pathlib.PurePath(test.plan.model).name} under stress"
    question = (
        f"Which solver can be trusted near the singularities of {' > '.join(test.levels)}, and where does each fail?"
    )
    return Report(title, question, tuple(sections), styles(labels), opening)


def _case(summary: Summary, c: int, test: StressResult) -> Section:
    case = summary.cases[c]
    header = (
        "solver",
        "leaves at",
        *(f"error, {name}" for name in summary.levels),
        "|x|, times",
        "jumps",
        "between sigma",
    )
    rows = []
    for k, label in enumerate(summary.labels):
        left = leaves(summary, c, k)
        jumps = summary.jumps[c, k]
        where = sigma_of_bins()[jumps > 0]
        rows.append(
            (
                label,
                "-" if left is None else "never" if np.isnan(left) else number(left),
                *(number(level_error(summary, c, k, level)) for level in range(len(summary.levels))),
                number(growth(summary, c, k)),
                f"{int(jumps.sum())} of {int(summary.steps[c, k].sum())}",
                f"{number(float(where.max()))} and {number(float(where.min()))}" if where.size else "-",
            )
        )
    table = Table(
        f"On the way to singularities of {case.title}",
        header,
        tuple(rows),
        f"Leaves at: the largest sigma at which the median distance from the optimum exceeds {number(PARTING)}. Error of a "
        "level: the largest part of its residual that could be removed at no cost to the levels before it and that rounding "
        "does not explain, over ||A|| ||x|| + ||b||. |x|, times: the largest |x| over the largest "
        f"|x*| where sigma >= {FAR_FROM:g}. Jumps: steps of a quarter of a decade on which x changes by more than "
        f"{JUMP:.0%} of itself; growth like 1/sigma changes it by 44 %.",
        text=frozenset({0, 6 + len(summary.levels) - 1}),
    )
    return Section(title_of(case), case_sentences(summary, c), listed=True, charts=(_chart(test, c),), tables=(table,))


def _chart(test: StressResult, c: int) -> Chart:
    summary, groups = test.summary, grouped(test.plan.contestants)
    case = summary.cases[c]
    names = {"distance": "distance\nfrom x*", "x_norm": "|x|", "lipschitz": "Lipschitz\nestimate"}
    rows = [
        f"{summary.levels[i]}\nerror" if q.startswith("error") else names[q] for i, q in enumerate(summary.quantities)
    ]
    panels = [
        tuple(
            tuple(line for label in labels if (line := _line(summary, c, i, summary.labels.index(label))) is not None)
            for _, labels in groups
        )
        for i in range(len(summary.quantities))
    ]
    jumps = tuple(
        tuple(
            Line(label, sigma_of_bins(), summary.jumps[c, k] / np.maximum(summary.steps[c, k], 1))
            for label in labels
            for k in (summary.labels.index(label),)
        )
        for _, labels in groups
    )
    error = [q.startswith("error") or q == "distance" for q in summary.quantities]
    slug = "-".join(("approach", case.name, case.kind.lower())).replace(" ", "-").replace("/", "-")
    return Lines(
        name=slug,
        title=f"Towards singularities of {case.title}",
        caption=f"Medians over the paths, bands from 10 to 90 %. Errors are relative; 0 is drawn at "
        f"{ERROR_FLOOR:g}. Sigma is the vanishing singular value over the level's norm. The last row is the share of paths "
        "on which x jumps at this sigma.",
        x_label="sigma",
        columns=tuple(group for group, _ in groups),
        rows=(*rows, "share of paths\nthat jump"),
        panels=(*panels, jumps),
        log_x=True,
        reverse_x=True,
        log_y=(*(True for _ in rows), False),
        floor=(*(ERROR_FLOOR if own else NORM_FLOOR for own in error), 0.0),
        ceiling=(*(ERROR_CEILING if own else NORM_CEILING for own in error), 1.0),
    )


def _line(summary: Summary, c: int, i: int, k: int) -> Line | None:
    counts = summary.along[c][i, k]
    middle = quantile(counts, 0.5)
    if not np.isfinite(middle).any():
        return None
    return Line(summary.labels[k], sigma_of_bins(), middle, low=quantile(counts, 0.1), high=quantile(counts, 0.9))


def _profiles(test: StressResult) -> Chart:
    summary, groups = test.summary, grouped(test.plan.contestants)
    shown = SHOWN_DECADES * RATIO_FINE + 1
    ratio = 10.0 ** (np.arange(shown) / RATIO_FINE)
    total = max(int(summary.judged.sum()), 1)

    def lines(counts: NDArray[np.int64], labels: list[str]) -> tuple[Line, ...]:
        rows = [np.cumsum(counts[summary.labels.index(label)])[:shown] / total for label in labels]
        return tuple(Line(label, ratio, row) for label, row in zip(labels, rows, strict=True))

    measures = (summary.profile, summary.time_profile)
    assert shown < RATIOS
    return Lines(
        name="performance-profiles",
        title="Performance profiles",
        caption=f"The share of the {total} judged samples on which a solver is within a factor tau of the best one (Dolan and "
        f"More 2002): in distance from the optimum, where distances below {RESOLVED:g} count as equal, and in time, where an "
        f"answer farther than {number(PARTING)} from the optimum counts as none. The left end says how often a solver is "
        "best, the right end how often it arrives at all.",
        x_label="tau",
        columns=tuple(group for group, _ in groups),
        rows=("share, distance\nwithin tau of the best", "share, time\nwithin tau of the best"),
        panels=tuple(tuple(lines(counts, labels) for _, labels in groups) for counts in measures),
        log_x=True,
        log_y=(False, False),
        floor=(0.0, 0.0),
        ceiling=(1.0, 1.0),
    )


def _outcomes(summary: Summary) -> Table:
    header = ["solver", "solved"]
    kinds = [kind for i, kind in enumerate(KINDS) if summary.status[0, i].sum()]
    for kind in kinds:
        header += [f"{kind}: within {number(PARTING)}", "distance, median", "max", "|x|, max"]
    header += ["us, median", "us, 99 %"]
    rows = []
    for k, label in enumerate(summary.labels):
        row = [label, share(summary.solved(k))]
        for kind in kinds:
            i = KINDS.index(kind)
            judged = int(summary.judged[i])
            row += [
                share(float(summary.right[k, i] / judged)) if judged else "-",
                number(float(quantile(summary.distance[k, i], 0.5))),
                number(float(summary.worst_distance[k, i])) if judged else "-",
                number(float(summary.worst_norm[k, i])),
            ]
        row += [number(1e6 * float(quantile(summary.time[k], part))) for part in (0.5, 0.99)]
        rows.append(tuple(row))
    judged_counts = ", ".join(f"{int(summary.judged[KINDS.index(kind)])} {kind}" for kind in kinds)
    return Table(
        "Every kind of sample",
        tuple(header),
        tuple(rows),
        f"Distance is |x - x*| / (1 + |x*|), over the samples whose optimum is known and not ambiguous: {judged_counts} of "
        f"{summary.samples} in all.",
    )


def _statuses(test: StressResult) -> list[Table]:
    tables = []
    found = unsolved(test.summary)
    if found:
        rows = tuple((label, status, str(count)) for label, status, count in found)
        tables.append(
            Table("Where a status was not SOLVED", ("solver", "status", "samples"), rows, text=frozenset({0, 1}))
        )
    if test.left_out:
        header = ("solver", "why it is not here")
        tables.append(Table("Solvers that refuse this stack", header, test.left_out, text=frozenset({0, 1})))
    return tables


def _worst(test: StressResult) -> Table:
    rows = tuple(
        (case.contestant, WORST[case.criterion], number(case.value), str(case.sample), replay_command(test, case))
        for case in test.summary.worst
    )
    return Table(
        "The worst cases of each solver",
        ("solver", "what", "figure", "sample", "replay, in the report's folder"),
        rows,
        "Figure: distance from the optimum, |x| / (1 + |x*|), or the Lipschitz estimate in 1/s. Each file holds the problem to "
        "the last bit.",
        text=frozenset({0, 1, 4}),
    )


def _atlas(test: StressResult) -> Table:
    rows = []
    for level, name in enumerate(test.levels):
        for kind in dict.fromkeys(place.kind for place in test.catalogue if place.level == level):
            own = [place for place in test.catalogue if place.level == level and place.kind is kind]
            rates = [place.approach_rate for place in own]
            edges = sum(place.is_edge for place in own)
            rows.append(
                (name, kind.name.lower(), str(len(own)), f"{number(min(rates))} to {number(max(rates))}", str(edges))
            )
    header = ("level", "kind", "configurations", "growth of sigma, 1/rad", "edges")
    caption = "Edges: beyond them the level cannot be brought while those before it rest. All of them: atlas.json."
    return Table("The atlas", header, tuple(rows), caption, text=frozenset({0, 1}))


def _solvers(test: StressResult) -> Table:
    rows = tuple((item.label, item.group, repr(item.solver), item.why) for item in test.plan.contestants)
    return Table("Solvers", ("label", "group", "solver and settings", "why it is here"), rows, text=frozenset(range(4)))


def _settings(test: StressResult) -> Table:
    plan = test.plan
    counts = ", ".join(f"{count} {kind}" for kind, count in plan.counts.items())
    own = {
        "model": plan.model,
        "stack": plan.stack.origin,
        "samples": f"{plan.samples}: {counts}",
        "seed": str(plan.seed),
    }
    rows = tuple({**own, **versions(), **machine()}.items())
    return Table("Run, versions and machine", ("what", "which"), rows, text=frozenset({0, 1}))
