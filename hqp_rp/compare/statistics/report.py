"""The report of the statistics: one picture, what it says in a few lines, the verdicts, and the figures behind them."""

from __future__ import annotations

from hqp_rp.compare.figures.chart import styles
from hqp_rp.compare.machine import machine, versions
from hqp_rp.compare.report.report import Opening, Report, Section, Table
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.compare.report.words import number, share
from hqp_rp.compare.statistics.arms import arm_named
from hqp_rp.compare.statistics.passages import FARTHEST, NEAREST
from hqp_rp.compare.statistics.picture import NAME, picture
from hqp_rp.compare.statistics.record import Statistics
from hqp_rp.compare.statistics.settings import FACTOR, FACTORS, setting_of
from hqp_rp.compare.statistics.trials import FAR
from hqp_rp.compare.statistics.verdicts import (
    BOUNDED,
    COVERAGE,
    KEPT_FIRST,
    KEPT_SECOND,
    NO,
    PARTLY,
    QUESTIONS,
    QUORUM,
    RESAMPLES,
    YES,
    Result,
    Spread,
)
from hqp_rp.core.variant import GROUPS

say = Sentences(__file__)

_IN_TURN = sorted(FACTORS, key=lambda factor: factor != 1.0)
_AT = {1.0: "", FACTORS[0]: " (setting / 3)", FACTORS[2]: " (setting x 3)"}
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
        Section("Verdicts", _meaning(study), tables=(_verdict_table(study),)),
        Section("At other settings", (say("other_settings"),), tables=(_settings_table(study),)),
        Section(say("fragile_heading"), _fragile(study), listed=True),
        Section("Figures", tables=tuple(_figures(study, arm) for arm in study.arms)),
        Section("What this cannot tell", _cannot_tell(), listed=True),
        Section("Made with", tables=(_made_with(),)),
    )
    return Report(
        say("title"),
        say("question"),
        sections,
        styles([group for group in groups if group]),
        Opening(_advice(study), _numbers(study), NAME),
    )


def _cannot_tell() -> tuple[str, ...]:
    return (
        say("kinematics_alone"),
        say("one_direction"),
        say("second_level_alone"),
        say("not_tuned"),
        say("joint_limits"),
        say("times"),
    )


def _of(study: Statistics, label: str) -> list[Result]:
    return [result for result in study.results if result.contestant == label]


def _kept_by(study: Statistics, label: str, factor: float) -> set[str]:
    """The questions whose answer is yes on every arm, with the contestant's setting times `factor`."""
    return {q for q in QUESTIONS if all(result.word(q, factor) == YES for result in _of(study, label))}


def _advice(study: Statistics) -> tuple[tuple[str, str], ...]:
    """For each need who serves it, each method at the best of its settings."""
    first, second, bounded = QUESTIONS
    needs = (
        (say("all_three"), {first, second, bounded}),
        (say("first_and_bounded"), {first, bounded}),
        (say("first_and_second"), {first, second}),
        (say("bounded_alone"), {bounded}),
    )
    served: dict[str, list[str]] = {need: [] for need, _ in needs}
    for contestant in study.contestants:
        kept = {factor: _kept_by(study, contestant.label, factor) for factor in _IN_TURN}
        found = next(((need, f) for need, asked in needs for f in _IN_TURN if asked <= kept[f]), None)
        if found is not None:
            served[found[0]].append(contestant.label + _AT[found[1]])
    return tuple((need, say("served_by", labels=labels, shown=_SHOWN)) for need, labels in served.items())


def _numbers(study: Statistics) -> tuple[tuple[str, str], ...]:
    paths = study.design.configurations * study.design.paths * len(study.arms)
    fragile = sum(bool(v.hangs_on) for result in study.results for v in result.verdicts.values())
    verdicts = sum(len(result.verdicts) for result in study.results)
    return (
        (f"{paths}", say("paths", samples=study.design.samples, arms=len(study.arms))),
        (f"{len(study.contestants)}", "solvers and settings"),
        (f"{fragile} of {verdicts}", say("fragile_verdicts")),
    )


def _design(study: Statistics) -> tuple[str, ...]:
    titles = [arm_named(arm).title for arm in study.arms]
    return (say("design", arms=titles, design=study.design, nearest=NEAREST, farthest=FARTHEST),)


def _meaning(study: Statistics) -> tuple[str, ...]:
    first, second, third = QUESTIONS
    count = study.design.configurations
    at_least = (1 - COVERAGE) ** (1 / count)
    return (
        say("answers", quorum=QUORUM),
        say("keeps_first", question=first, kept=KEPT_FIRST),
        say("keeps_second", question=second, kept=KEPT_SECOND, far=FAR),
        say("stays_bounded", question=third, bounded=BOUNDED),
        say("star_meaning", factor=FACTOR, coverage=COVERAGE, resamples=RESAMPLES),
        say("not_drawn", configurations=count, coverage=COVERAGE, at_least=at_least),
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


def _settings_table(study: Statistics) -> Table:
    order = (YES, PARTLY, NO)
    rows = []
    for contestant in study.contestants:
        found = _of(study, contestant.label)
        if not found or not found[0].elsewhere:
            continue
        cells = [
            " / ".join(max((result.word(q, factor) for result in found), key=order.index) for q in QUESTIONS)
            for factor in FACTORS
        ]
        rows.append((contestant.label, setting_of(contestant.solver), *cells))
    header = ("solver", "setting", "a third of it", "as it is", "three times it")
    return Table(" / ".join(QUESTIONS), header, tuple(rows), text=frozenset(range(5)))


def _fragile(study: Statistics) -> tuple[str, ...]:
    """A sentence for each question and thing that its answers hang on."""
    found: dict[tuple[str, str], list[str]] = {}
    for result in study.results:
        for question, verdict in result.verdicts.items():
            for name in verdict.hangs_on:
                found.setdefault((question, name), []).append(f"{result.contestant} ({arm_named(result.arm).title})")
    if not found:
        return (say("nothing_fragile"),)
    return tuple(
        say("fragile", question=question, hangs_on=name, labels=labels) for (question, name), labels in found.items()
    )


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
        say("figures_caption", coverage=COVERAGE),
    )


def _cell(spread: Spread, factor: float) -> str:
    median, low, high, q05, q95 = (
        number(factor * value) for value in (spread.median, spread.low, spread.high, spread.q05, spread.q95)
    )
    return f"{median} [{low}, {high}] ({q05} to {q95})"


def _made_with() -> Table:
    rows = tuple((name, value) for name, value in (machine() | versions()).items())
    return Table("Machine and versions", ("what", "which"), rows, text=frozenset({0, 1}))
