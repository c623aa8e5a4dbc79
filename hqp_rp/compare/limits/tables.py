"""The tables of a scenario with limits: who violated what, by how much, for how long, and what each level paid."""

from __future__ import annotations

from hqp_rp.compare.limits.cases import COUNTS, LimitCase, LimitOutcome
from hqp_rp.compare.report.report import Table
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.compare.report.words import number, share
from hqp_rp.core.solution import Status

say = Sentences(__file__)


def limit_tables(case: LimitCase) -> tuple[Table, ...]:
    """The three tables of one case."""
    return (_violations(case), _errors(case), _denied(case)) if case.answered else ()


def _violations(case: LimitCase) -> Table:
    kinds = [(violation.kind, violation.unit) for violation in case.answered[0].violations]
    back = any(outcome.outside for outcome in case.answered)
    header = ["solver", "ended as"]
    for kind, unit in kinds:
        header += [f"{kind}: largest [{unit}]", "for [s]", "from [s]"]
    if back:
        header.append("back inside after [s]")
    rows = []
    for outcome in case.outcomes:
        row = [outcome.label, _ended(outcome)]
        for i in range(len(kinds)):
            if not outcome.answered:
                row += ["-"] * 3
                continue
            violation = outcome.violations[i]
            largest = number(violation.largest) if violation.largest > COUNTS else "kept"
            row += [largest, number(violation.time), number(violation.first)]
        if back:
            row.append("-" if not outcome.answered else "never" if outcome.back is None else number(outcome.back))
        rows.append(tuple(row))
    return Table(
        say("table_violations", case=_title(case)),
        tuple(header),
        tuple(rows),
        say("caption_violations", told=case.told, outside=back, duration=case.duration, counts=COUNTS),
        text=frozenset({0, 1}),
    )


def _ended(outcome: LimitOutcome) -> str:
    """The statuses with their share of the steps."""
    if outcome.outcome.refused:
        return "refused"
    return ", ".join(
        f"{name.lower().replace('_', ' ')} {share(value)}" for name, value in outcome.statuses.items()
    ).replace(f"{Status.SOLVED.name.lower()} 100 %", "solved")


def _errors(case: LimitCase) -> Table:
    header = ("solver", *(f"{error.name} [{error.unit}]" for error in case.answered[0].errors))
    shaken = all(outcome.changes is not None for outcome in case.answered)
    if shaken:
        header += ("velocity change in a step [rad/s]",)
    rows = tuple(
        (
            outcome.label,
            *(f"{number(e.rms)} / {number(e.peak)} / {number(e.end)}" for e in outcome.errors),
            *([" / ".join(number(change) for change in outcome.changes)] if shaken and outcome.changes else []),
        )
        for outcome in case.answered
    )
    return Table(
        say("table_errors", case=_title(case)),
        header,
        rows,
        say("caption_errors", changes=shaken),
    )


def _denied(case: LimitCase) -> Table:
    header = ("solver", "within 1e-06 of x*", *(f"{level.name}" for level in case.answered[0].denied))
    rows = tuple(
        (
            outcome.label,
            share(outcome.outcome.within),
            *(f"{number(level.rms)} / {number(level.optimum)} / {number(level.open)}" for level in outcome.denied),
        )
        for outcome in case.answered
    )
    return Table(
        say("table_denied", case=_title(case)),
        header,
        rows,
        say("caption_denied", methods=case.case.reference, part=case.case.ambiguous),
    )


def _title(case: LimitCase) -> str:
    return f"{case.case.title[0].upper()}{case.case.title[1:]}"
