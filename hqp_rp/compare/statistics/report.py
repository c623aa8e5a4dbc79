"""The report of the statistics: one picture, what it says in a few lines, the verdicts, and the figures behind them."""

from __future__ import annotations

from collections.abc import Sequence

from hqp_rp.compare.figures.chart import styles
from hqp_rp.compare.machine import machine, versions
from hqp_rp.compare.report.report import Opening, Report, Section, Table
from hqp_rp.compare.report.words import counted, listing, number, share
from hqp_rp.compare.statistics.arms import arm_named
from hqp_rp.compare.statistics.passages import FARTHEST, NEAREST
from hqp_rp.compare.statistics.picture import NAME, picture
from hqp_rp.compare.statistics.record import Statistics
from hqp_rp.compare.statistics.trials import FACTOR, FAR
from hqp_rp.compare.statistics.verdicts import (
    BOUNDED,
    COVERAGE,
    KEPT_FIRST,
    KEPT_SECOND,
    QUESTIONS,
    QUORUM,
    RESAMPLES,
    YES,
    Result,
    Spread,
)
from hqp_rp.core.variant import GROUPS

_NOBODY = "no solver here"
_SHOWN = 6
_HEADERS = {
    "error_1": "level 1, largest error",
    "error_2_far": "level 2, far",
    "error_3_far": "level 3, far",
    "growth": "||x||, of what is needed",
    "jump": "largest jump [rad/s]",
    "time": "one call [us]",
}


def statistics_report(study: Statistics) -> Report:
    """The report as data."""
    groups = [[c.label for c in study.contestants if c.group == group] for group in GROUPS]
    chart = picture(study.results, study.contestants)
    sections = (
        Section("What was asked", _design(study), charts=(chart,)),
        Section("Verdicts", _meaning(), tables=(_verdict_table(study),)),
        Section("What hangs on a threshold or on the draw", _fragile(study), listed=True),
        Section("Figures", tables=tuple(_figures(study, arm) for arm in study.arms)),
        Section("What this cannot tell", _CANNOT_TELL, listed=True),
        Section("Made with", tables=(_made_with(),)),
    )
    return Report(
        "Passages through algorithmic singularities",
        "On many paths of several arms, which method keeps level 1, which keeps level 2, and which stays bounded?",
        sections,
        styles([group for group in groups if group]),
        Opening(_advice(study), _numbers(study), NAME),
    )


_CANNOT_TELL = (
    "The arms are driven by their kinematics alone: the next configuration does not depend on the answer. What a controller "
    "makes of its own answers is in the crossing scenarios of the comparison.",
    "What is asked for has one direction for a whole path, drawn at random: no target is reached, and none lies out of reach.",
    "Singularities of the second level alone, of codimension one or two; nothing is said of those of the first.",
    "Where a method has a setting, it has the one of the comparison's line-up; other settings move its marks.",
    "Times are of single calls from Python while other processes run: their order, not their size, carries over.",
)


def _of(study: Statistics, label: str) -> list[Result]:
    return [result for result in study.results if result.contestant == label]


def _with(study: Statistics, questions: Sequence[str]) -> list[str]:
    """Contestants for which the answer to all of the questions is yes, on every arm."""
    return [
        contestant.label
        for contestant in study.contestants
        if all(result.verdicts[q].word == YES for result in _of(study, contestant.label) for q in questions)
    ]


def _advice(study: Statistics) -> tuple[tuple[str, str], ...]:
    first, second, bounded = QUESTIONS
    everything = _with(study, QUESTIONS)
    kept = [label for label in _with(study, (first, bounded)) if label not in everything]
    exact = [label for label in _with(study, (first, second)) if label not in everything]
    rows = (
        ("Level 1 always, level 2 far from singularities, and bounded", everything),
        ("Level 1 always and bounded, at the price of level 2", kept),
        ("Levels 1 and 2 exactly, at any joint velocity", exact),
        ("Bounded, at the price of level 1", [x for x in _with(study, (bounded,)) if x not in everything + kept]),
    )
    return tuple((need, _names(labels)) for need, labels in rows)


def _names(labels: Sequence[str]) -> str:
    if not labels:
        return _NOBODY
    more = f" and {len(labels) - _SHOWN} more" if len(labels) > _SHOWN else ""
    return f"{', '.join(labels[:_SHOWN])}{more}" if more else listing(labels)


def _numbers(study: Statistics) -> tuple[tuple[str, str], ...]:
    paths = study.design.configurations * study.design.paths * len(study.arms)
    fragile = sum(bool(v.hangs_on) for result in study.results for v in result.verdicts.values())
    verdicts = sum(len(result.verdicts) for result in study.results)
    return (
        (f"{paths}", f"paths, {study.design.samples} samples each, on {counted(len(study.arms), 'arm')}"),
        (f"{len(study.contestants)}", "solvers and settings"),
        (f"{fragile} of {verdicts}", "verdicts that hang on a threshold or on the draw, and are marked"),
    )


def _design(study: Statistics) -> tuple[str, ...]:
    design = study.design
    titles = listing([arm_named(arm).title for arm in study.arms])
    return (
        f"Arms: {titles}, each with three levels: the tool's position, an orientation (on the planar arm the direction of "
        "its second link), a posture. Algorithmic singularities of the second level were searched from random starts, "
        f"{design.configurations} for each arm, and straight paths in joint space drawn past each, {design.paths} for each, "
        f"{design.reach:g} rad to both sides, at a distance of {NEAREST:g} to {FARTHEST:.2g} rad (even in its logarithm). "
        f"Along a path levels 1 and 2 ask for {design.speed:g} m/s or rad/s and the posture for {design.posture_speed:g} "
        f"rad/s, in directions drawn once for the path. Seed {design.seed}.",
    )


def _meaning() -> tuple[str, ...]:
    first, second, third = (question.capitalize() for question in QUESTIONS)
    return (
        f"The answer is yes where it holds on at least {share(QUORUM)} of an arm's paths, no on at most "
        f"{share(1 - QUORUM)}, else partly; the share stands behind it.",
        f"{first}: it never misses more than {KEPT_FIRST:g} of what it asks for.",
        f"{second}: it misses no more than {KEPT_SECOND:g} of it far from the singularity, that is where the distance is at "
        f"least {FAR:g} of the largest on the path; near it no bounded method can.",
        f"{third}: ||x|| never exceeds {BOUNDED:g} times the largest optimum far from the singularity.",
        f"A star: the answer is another one when a threshold is moved by a factor of {FACTOR:g}, or in more than "
        f"{share(1 - COVERAGE)} of {RESAMPLES} random draws of the configurations.",
    )


def _verdict_table(study: Statistics) -> Table:
    rows = []
    for contestant in study.contestants:
        for result in _of(study, contestant.label):
            cells = [
                f"{v.word} ({share(v.share)}){' *' if v.hangs_on else ''}"
                for v in (result.verdicts[question] for question in QUESTIONS)
            ]
            rows.append((contestant.label, arm_named(result.arm).title, *cells))
    return Table("Verdicts", ("solver", "arm", *QUESTIONS), tuple(rows), text=frozenset(range(5)))


def _fragile(study: Statistics) -> tuple[str, ...]:
    """A sentence for each question and thing that its answers hang on."""
    found: dict[tuple[str, str], list[str]] = {}
    for result in study.results:
        for question, verdict in result.verdicts.items():
            for name in verdict.hangs_on:
                found.setdefault((question, name), []).append(f"{result.contestant} ({arm_named(result.arm).title})")
    if not found:
        return ("No verdict does.",)
    return tuple(f"{question}, {name}: {listing(labels)}." for (question, name), labels in found.items())


def _figures(study: Statistics, arm: str) -> Table:
    rows = []
    for contestant in study.contestants:
        for result in _of(study, contestant.label):
            if result.arm == arm:
                cells = [_cell(result.spreads[name], 1e6 if name == "time" else 1.0) for name in _HEADERS]
                rows.append((contestant.label, *cells, share(result.answered)))
    return Table(
        arm_named(arm).title,
        ("solver", *_HEADERS.values(), "answered"),
        tuple(rows),
        f"Median of the paths [its {COVERAGE:.0%} interval, bootstrapped over configurations] (5 to 95 % of the paths). "
        "Errors are shares of what the level asks for; of level 3 what exceeds the optimum's.",
    )


def _cell(spread: Spread, factor: float) -> str:
    median, low, high, q05, q95 = (
        number(factor * value) for value in (spread.median, spread.low, spread.high, spread.q05, spread.q95)
    )
    return f"{median} [{low}, {high}] ({q05} to {q95})"


def _made_with() -> Table:
    rows = tuple((name, value) for name, value in (machine() | versions()).items())
    return Table("Machine and versions", ("what", "which"), rows, text=frozenset({0, 1}))
