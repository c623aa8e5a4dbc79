"""The report of a stress test: findings, claims, figures, tables, worst cases with the command that replays each."""

from __future__ import annotations

import pathlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hqp_rp.compare.comparison.findings import DAMPED, Verdict, claim_sentence
from hqp_rp.compare.figures.chart import Chart, Line, Lines, styles
from hqp_rp.compare.figures.panels import grouped
from hqp_rp.compare.machine import machine, versions
from hqp_rp.compare.measure.cases import BOUNDED, KEPT, PARTING
from hqp_rp.compare.report.report import Report, Section, Table
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.compare.report.words import number, share
from hqp_rp.compare.stress.findings import (
    FAR_FROM,
    answer,
    case_sentences,
    claims,
    growth,
    infeasible_file,
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

say = Sentences(__file__)


def stress_report(test: StressResult) -> Report:
    """The whole report of a stress test, as data."""
    verdicts = claims(test)
    sections = [
        Section("The answer", answer(test), listed=True),
        Section("What this cannot tell", _cannot_tell(), listed=True),
        Section(
            "Towards the singularities",
            (say("paths", per_decade=PER_DECADE, far=FAR, near=NEAR) if test.summary.cases else say("no_paths"),),
            sections=tuple(_case(test.summary, c, test) for c in range(len(test.summary.cases))),
        ),
        Section("Performance profiles", charts=(_profiles(test),)),
    ]
    opening = opening_of_stress(test, sections)
    if verdicts:
        sections.append(Section(say("heading_claims"), tables=(_claims(verdicts),)))
    sections += [
        Section("All samples", tables=(_outcomes(test.summary), *_statuses(test))),
        Section("Worst cases", tables=(_worst(test),)),
        Section("Settings", tables=(_atlas(test), _solvers(test), _settings(test))),
    ]
    labels = [names for _, names in grouped(test.plan.contestants)]
    title = say("title", model=pathlib.PurePath(test.plan.model).name)
    question = say("question", levels=test.levels)
    return Report(title, question, tuple(sections), styles(labels), opening)


def _cannot_tell() -> tuple[str, ...]:
    return (
        say("cannot_tell_families"),
        say("cannot_tell_motion"),
        say("cannot_tell_small", resolved=RESOLVED),
        say("cannot_tell_rank"),
        say("cannot_tell_bins"),
        say("cannot_tell_times"),
    )


def _claims(verdicts: Sequence[Verdict]) -> Table:
    rows = tuple((claim_sentence(v.claim), v.case, v.holds, v.evidence) for v in verdicts)
    damped = claim_sentence(DAMPED)
    return Table(
        say("table_claims"),
        ("claim", "singularities", "holds", "evidence"),
        rows,
        say("caption_claims", kept=KEPT, bounded=BOUNDED, far=FAR_FROM, damped=damped),
        text=frozenset(range(4)),
    )


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
        say("table_case", title=case.title),
        header,
        tuple(rows),
        say("caption_case", parting=PARTING, far=FAR_FROM, jump=JUMP),
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
        title=say("chart_case", title=case.title),
        caption=say("caption_chart", floor=ERROR_FLOOR),
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
        caption=say("caption_profiles", judged=int(summary.judged.sum()), resolved=RESOLVED, parting=PARTING),
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
            of = int(summary.judged[i])
            row += [
                share(float(summary.right[k, i] / of)) if of else "-",
                number(float(quantile(summary.distance[k, i], 0.5))),
                number(float(summary.worst_distance[k, i])) if of else "-",
                number(float(summary.worst_norm[k, i])),
            ]
        row += [number(1e6 * float(quantile(summary.time[k], part))) for part in (0.5, 0.99)]
        rows.append(tuple(row))
    judged = [(int(summary.judged[KINDS.index(kind)]), kind) for kind in kinds]
    return Table(
        "Every kind of sample",
        tuple(header),
        tuple(rows),
        say("caption_outcomes", judged=judged, samples=summary.samples),
    )


def _statuses(test: StressResult) -> list[Table]:
    tables = []
    found = unsolved(test.summary)
    if found:
        rows = tuple((label, status, str(count)) for label, status, count in found)
        tables.append(Table(say("table_statuses"), ("solver", "status", "samples"), rows, text=frozenset({0, 1})))
    if test.left_out:
        header = ("solver", "why it is not here")
        tables.append(Table(say("table_refusals"), header, test.left_out, text=frozenset({0, 1})))
    return tables


def _worst(test: StressResult) -> Table:
    rows = tuple(
        (case.contestant, WORST[case.criterion], number(case.value), str(case.sample), replay_command(test, case))
        for case in test.summary.worst
    )
    found = () if test.infeasible is None else test.infeasible.kept
    conflicts = tuple(
        ("every one", say("contradiction", groups=item.groups), number(item.conflict.gap), str(item.sample),
         f"hqp-rp check {infeasible_file(place)}")
        for place, item in enumerate(found)
    )  # fmt: skip
    rows = conflicts + rows
    return Table(
        say("table_worst"),
        ("solver", "what", "figure", "sample", "replay, in the report's folder"),
        rows,
        say("caption_worst"),
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
    return Table("The atlas", header, tuple(rows), say("caption_atlas"), text=frozenset({0, 1}))


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
