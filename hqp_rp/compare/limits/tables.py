"""The tables of a scenario with limits: who violated what, by how much, for how long, and what each level paid."""

from __future__ import annotations

from hqp_rp.compare.limits.cases import COUNTS, LimitCase, LimitOutcome
from hqp_rp.compare.report.report import Table
from hqp_rp.compare.report.words import number, share
from hqp_rp.core.solution import Status


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
    told = (
        ""
        if case.told
        else "The problem of this case holds no limit: the table shows what is broken by those not told. "
    )
    start = (
        f"Some seeds start outside a position limit: what is there at the start does not count while it shrinks, and 'back "
        f"inside' is when the last of them was within {number(COUNTS)} again. "
        if back
        else ""
    )
    return Table(
        f"{_title(case)}: who violated what, by how much, for how long",
        tuple(header),
        tuple(rows),
        f"{told}Largest over all steps, joints and seeds; for: mean of the seeds, of {number(case.duration)} s; from: "
        f"earliest of the seeds. Kept: never exceeded by more than {number(COUNTS)}. {start}Commands beyond a velocity limit "
        "are clipped by the servos; without an answer the joints brake.",
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
        f"{_title(case)}: what each level paid",
        header,
        rows,
        "Error of each level's task: root mean square over the run / largest / at the end, over all seeds. The most important "
        "task stands first. Measured from outside, on the motion that each solver made."
        + (
            " Velocity change: of the joint that changes most from one step to the next, median / 99th percentile / largest "
            "of all steps."
            if shaken
            else ""
        ),
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
        f"{_title(case)}: what each level was denied / at the exact optimum / room left unused",
        header,
        rows,
        "Root mean square of the level's residual in the unit of its rates / the same of the exact optimum x* of the problems "
        "that this solver met / the largest part of a residual that points where the limits reached and the levels before it "
        "leave room, less what rounding explains: 0 is the optimum given the levels before, and what could have been avoided "
        f"is at most the figure. x* by {'; '.join(case.case.reference)}. Steps whose rank is ambiguous "
        f"({share(case.case.ambiguous)}) do not count in the room left, nor in the distance to x*.",
    )


def _title(case: LimitCase) -> str:
    return f"{case.case.title[0].upper()}{case.case.title[1:]}"
