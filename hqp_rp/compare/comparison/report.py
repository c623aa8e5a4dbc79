"""The comparison's report: question, answer, what the test cannot tell, figures, tables, settings."""

from __future__ import annotations

import polars as pl

from hqp_rp.compare.comparison.figures import scenario_charts
from hqp_rp.compare.comparison.findings import (
    Verdict,
    answer_of_comparison,
    case_sentences,
    claim_sentence,
    claims,
)
from hqp_rp.compare.comparison.opening import opening_of_comparison
from hqp_rp.compare.comparison.record import ComparisonResult
from hqp_rp.compare.comparison.thresholds import fragile_sentences
from hqp_rp.compare.figures.chart import styles
from hqp_rp.compare.figures.panels import grouped
from hqp_rp.compare.limits.figures import limit_charts
from hqp_rp.compare.limits.findings import limit_sentences
from hqp_rp.compare.limits.tables import limit_tables
from hqp_rp.compare.machine import machine, versions
from hqp_rp.compare.measure.cases import BOUNDED, KEPT, PARTING, Case
from hqp_rp.compare.report.report import Report, Section, Table
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.compare.report.words import number, share
from hqp_rp.core.solution import Status
from hqp_rp.scenarios.scenario import Scenario

say = Sentences(__file__)


def comparison_report(comparison: ComparisonResult) -> Report:
    """The whole report of a comparison, as data."""
    cases = comparison.without_limits
    verdicts = claims(cases)
    sections = [
        Section("The answer", answer_of_comparison(comparison)),
        Section("What this cannot tell", _limits(comparison), listed=True),
        Section("Figures", sections=tuple(_figures(scenario, comparison) for scenario in comparison.scenarios)),
    ]
    opening = opening_of_comparison(comparison, sections)
    if verdicts:
        sections.append(Section(say("heading_claims"), tables=(_claims(verdicts),)))
    if cases:
        sections.append(Section(say("heading_thresholds"), fragile_sentences(cases), listed=True))
    sections += [
        Section("Tables", tables=_tables(comparison) + tuple(_statuses(comparison))),
        Section("Times", (say("cannot_tell_times"),), tables=(_times(comparison.cases),)),
        Section("Settings", tables=(_contestants(comparison), _scenarios(comparison), _versions())),
    ]
    labels = [names for _, names in grouped(comparison.contestants)]
    limits = bool(comparison.limits)
    question = say("question", singularities=bool(cases) or not limits, limits=limits)
    return Report(say("title"), question, tuple(sections), styles(labels), opening)


def _tables(comparison: ComparisonResult) -> tuple[Table, ...]:
    limits = tuple(table for case in comparison.limits for table in limit_tables(case))
    return tuple(_outcomes(case) for case in comparison.without_limits) + limits


def _limits(comparison: ComparisonResult) -> tuple[str, ...]:
    own = [
        f"{_words(type(scenario).name)}: {sentence}"
        for scenario in comparison.scenarios
        for sentence in scenario.cannot_tell
    ]
    every = (say("cannot_tell_rounding"), say("cannot_tell_rank"), say("cannot_tell_times"))
    return (*comparison.left_out, *own, *every)


def _words(name: str) -> str:
    return name.replace("_", " ")


def _capital(title: str) -> str:
    return f"{title[0].upper()}{title[1:]}"


def _figures(scenario: Scenario, comparison: ComparisonResult) -> Section:
    title = _words(type(scenario).name).capitalize()
    limits = [case for case in comparison.limits if type(case.case.scenario) is type(scenario)]
    if limits:
        inner = [
            Section(
                _capital(case.case.title),
                limit_sentences(case),
                listed=True,
                charts=tuple(limit_charts(case, comparison.contestants, comparison.levels, comparison.measured)),
            )
            for case in limits
        ]
        return Section(title, (scenario.question,), sections=tuple(inner))
    own = [case for case in comparison.cases if type(case.scenario) is type(scenario)]
    charts = scenario_charts(scenario, comparison.contestants, comparison.steps, comparison.levels, comparison.measured)
    words = tuple(Section(f"{_capital(case.title)}: in words", case_sentences(case), listed=True) for case in own)
    return Section(title, (scenario.question,), charts=tuple(charts), sections=words)


def _claims(verdicts: tuple[Verdict, ...]) -> Table:
    rows = tuple((claim_sentence(verdict.claim), verdict.case, verdict.holds, verdict.evidence) for verdict in verdicts)
    return Table(
        say("table_claims"),
        ("claim", "case", "holds", "evidence"),
        rows,
        say("caption_claims", kept=KEPT, bounded=BOUNDED),
        text=frozenset(range(4)),
    )


def _outcomes(case: Case) -> Table:
    header = (
        "solver",
        "solved",
        "within 1e-06",
        "leaves at",
        "distance, median",
        "distance, max",
        *(f"excess, {name}" for name in case.levels),
        "|x|, max",
        "total variation",
    )
    rows = []
    for outcome in case.outcomes:
        excess = outcome.excess or (None,) * len(case.levels)
        rows.append(
            (
                outcome.label,
                share(outcome.solved),
                share(outcome.within),
                "-" if outcome.distance is None else number(outcome.parts_at) if outcome.parted else "never",
                number(outcome.distance),
                number(outcome.distance_max),
                *(number(value) for value in excess),
                number(outcome.x_max),
                number(outcome.variation),
            )
        )
    return Table(
        _capital(case.title),
        header,
        tuple(rows),
        say(
            "caption_outcomes",
            abscissa=case.scenario.abscissa,
            parting=PARTING,
            methods=case.reference,
            part=case.ambiguous,
        ),
    )


def _statuses(comparison: ComparisonResult) -> list[Table]:
    """Every status but SOLVED, with how often and the first message: a refusal appears with its sentence."""
    frame = (
        comparison.steps.filter(pl.col("status") != Status.SOLVED.name)
        .group_by("scenario", "case", "contestant", "status", maintain_order=True)
        .agg(pl.len().alias("steps"), pl.col("message").first())
    )
    if not frame.height:
        return []
    rows = tuple(
        (_words(row["scenario"]), row["case"], row["contestant"], row["status"], str(row["steps"]),
         row["message"] or Status[row["status"]].value)
        for row in frame.iter_rows(named=True)
    )  # fmt: skip
    header = ("scenario", "case", "solver", "status", "steps", "in its own words (first step)")
    return [Table(say("table_statuses"), header, rows, text=frozenset({0, 1, 2, 3, 5}))]


def _times(cases: tuple[Case, ...]) -> Table:
    labels = list(dict.fromkeys(outcome.label for case in cases for outcome in case.outcomes))
    by_case = [{outcome.label: outcome for outcome in case.outcomes} for case in cases]
    rows = []
    for label in labels:
        found = [outcomes[label] for outcomes in by_case]
        rows.append((label, *(f"{1e6 * o.time_p50:.0f} / {1e6 * o.time_p99:.0f}" if o.steps else "-" for o in found)))
    return Table(
        say("table_times"),
        ("solver", *(case.title for case in cases)),
        tuple(rows),
        say("caption_times"),
    )


def _contestants(comparison: ComparisonResult) -> Table:
    rows = tuple(
        (item.label, item.group, repr(item.solver), type(item.solver).source, item.why)
        for item in comparison.contestants
    )
    header = ("label", "group", "solver and settings", "source", "why it is here")
    return Table("Solvers", header, rows, text=frozenset(range(5)))


def _scenarios(comparison: ComparisonResult) -> Table:
    rows = tuple((type(scenario).name, repr(scenario)) for scenario in comparison.scenarios)
    return Table(
        "Scenarios", ("name", "settings"), rows, say("caption_seeds", last=comparison.seeds - 1), text=frozenset({0, 1})
    )


def _versions() -> Table:
    rows = tuple({**versions(), **machine()}.items())
    return Table("Versions and machine", ("what", "which"), rows, text=frozenset({0, 1}))
