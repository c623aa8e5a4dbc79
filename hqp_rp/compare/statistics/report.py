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

_NOBODY = "no solver here"
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
        Section("At other settings", (_OTHER_SETTINGS,), tables=(_settings_table(study),)),
        Section("What hangs on a number that was chosen, or on the draw", _fragile(study), listed=True),
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
    "A method has the setting of the comparison's line-up, and three times less and more; nothing was tuned beyond that.",
    "A path may leave the arm's joint limits: what is judged is the answer at a configuration, not whether the arm gets there.",
    "Times are of single calls from Python while other processes run: their order, not their size, carries over.",
)


_OTHER_SETTINGS = (
    "Each method's own setting, its damping or the number that bounds its steps, three times smaller, as it is, and three "
    "times larger: the answers to the three questions, the worst of the arms'."
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
        ("Level 1 always, level 2 far from singularities, and bounded", {first, second, bounded}),
        ("Level 1 always and bounded, at the price of level 2", {first, bounded}),
        ("Levels 1 and 2 exactly, at any joint velocity", {first, second}),
        ("Bounded, at the price of level 1", {bounded}),
    )
    served: dict[str, list[str]] = {need: [] for need, _ in needs}
    for contestant in study.contestants:
        kept = {factor: _kept_by(study, contestant.label, factor) for factor in _IN_TURN}
        found = next(((need, f) for need, asked in needs for f in _IN_TURN if asked <= kept[f]), None)
        if found is not None:
            served[found[0]].append(contestant.label + _AT[found[1]])
    return tuple((need, _names(labels)) for need, labels in served.items())


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
        (f"{fragile} of {verdicts}", "verdicts that hang on a number that was chosen or on the draw, and are marked"),
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


def _meaning(study: Statistics) -> tuple[str, ...]:
    first, second, third = (question.capitalize() for question in QUESTIONS)
    return (
        f"The answer is yes where it holds on at least {share(QUORUM)} of an arm's paths, no on at most "
        f"{share(1 - QUORUM)}, else partly; the share stands behind it.",
        f"{first}: it never misses more than {KEPT_FIRST:g} of what it asks for.",
        f"{second}: it misses no more than {KEPT_SECOND:g} of it far from the singularity, that is where the distance is at "
        f"least {FAR:g} of the largest on the path; near it no bounded method can.",
        f"{third}: ||x|| never exceeds {BOUNDED:g} times the largest optimum far from the singularity.",
        f"A star: the answer is another one when a threshold or the method's own setting is moved by a factor of {FACTOR:g}, "
        f"or in more than {share(1 - COVERAGE)} of {RESAMPLES} random draws of the configurations.",
        "What was not drawn nobody sees: that something holds at all of "
        f"{study.design.configurations} configurations of an arm says, with {share(COVERAGE)} confidence, that it holds at "
        f"{share((1 - COVERAGE) ** (1 / study.design.configurations))} of such configurations at least.",
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
