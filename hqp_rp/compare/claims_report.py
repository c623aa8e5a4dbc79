"""The paper's experiments and claims as a report: runs the force scenarios and writes report.html, report.md and figures."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping, Sequence

import numpy as np
import polars as pl

from hqp_rp.compare.chart import Line, Lines, Style, styles, thinned
from hqp_rp.compare.claims import (
    CONFLICT,
    HOLDS,
    LINE_UP,
    REVERSE,
    REVERSE_DAMPED,
    TRACKING,
    WALL,
    WIPE,
    Ruling,
    Study,
    rulings,
)
from hqp_rp.compare.contact_runs import ContactFigures, contact_figures, run_contacts
from hqp_rp.compare.contestants import Contestant, default_contestants
from hqp_rp.compare.machine import machine, usable_cores, versions
from hqp_rp.compare.openings import first_chart
from hqp_rp.compare.panels import grouped, slug
from hqp_rp.compare.report import Opening, Report, Section, Table, listing, number, share, write_report
from hqp_rp.compare.run_folder import RunFolder, write_parquet
from hqp_rp.core.errors import HqpError
from hqp_rp.scenarios._interaction import DAMPED, PAPER, Interaction
from hqp_rp.scenarios.scenario import get_scenario

FILES = ("report.html", "report.md", "figures", "results", "films")
SCENARIOS = (TRACKING, WALL, WIPE, CONFLICT)
HALVED = (REVERSE, REVERSE_DAMPED)
"""Whose runs are repeated with half the time step."""

DESIRED = "desired"
_QUANTITIES: dict[str, tuple[tuple[str, str, bool], ...]] = {
    # scenario -> (column, row label, log axis)
    TRACKING: (("force x [N]", "F_x (N)", False), ("force y [N]", "F_y (N)", False)),
    WALL: (("force x [N]", "F_x (N)", False),),
    WIPE: (("force x [N]", "F_x (N)", False),),
    CONFLICT: (("force x [N]", "F_x (N)", False),),
}
_ERRORS = (
    ("position error y [m]", "error in y (m)", False),
    ("position error z [m]", "error in z (m)", False),
    ("orientation error [rad]", "orientation (rad)", False),
)
_SPEED = (("commanded speed [rad/s]", "|x| asked for\n(rad/s)", True),)
_GAINS = {
    PAPER: "M_d and B_d are the paper's",
    DAMPED: "B_d across the wall is the well-damped set's, M_d the paper's",
}
_MIRRORS = {
    TRACKING: "Mirrors the paper's Figure 5 (reverse priority) and Figure 6 (classical)",
    WALL: "Mirrors the paper's Figure 7 (contact force)",
    WIPE: "Not in the paper",
    CONFLICT: "Not in the paper",
}


@dataclasses.dataclass(frozen=True, eq=False)
class ClaimsStudy:
    """What was run: scenarios, contestants, every step (`contact_steps`), and the same for half the time step."""

    scenarios: tuple[Interaction, ...]
    contestants: tuple[Contestant, ...]
    steps: pl.DataFrame
    halved: pl.DataFrame
    quick: bool = False

    def report(self, films: Sequence[str] = ()) -> Report:
        """The report as data; `films` is what `film_all` returned."""
        return _report(self, films)


def line_up() -> tuple[Contestant, ...]:
    """The contestants of `LINE_UP`, in the order of the groups."""
    known = {contestant.label: contestant for contestant in default_contestants()}
    missing = [label for label in LINE_UP if label not in known]
    if missing:
        raise HqpError(f"No contestant is labelled {missing[0]!r}; the default line-up has {', '.join(known)}.")
    return tuple(contestant for contestant in known.values() if contestant.label in LINE_UP)


def study_claims(
    output: str | os.PathLike[str],
    *,
    quick: bool = False,
    overwrite: bool = False,
    workers: int | None = None,
    films: bool = True,
) -> list[str]:
    """Run the four force scenarios with the line-up and write the report of the paper's claims; what it found, in words.

    A run that was stopped after the simulations goes on where it stopped when it is started again with the same folder.

    Args:
        output: the folder for report.html, report.md, figures, films and the steps as Parquet.
        quick: the scenarios' own quick versions; too short for verdicts, so that none is given.
        overwrite: replace the report of another run in `output`.
        workers: processes; None means one for each usable core.
        films: render a short film of each scenario too, where a GL back end is there.

    Raises:
        FileError: `output` holds another run's report or foreign files, or cannot be written.
    """
    scenarios = tuple(_interaction(name, quick) for name in SCENARIOS)
    contestants = line_up()
    description = {
        "kind": "claims",
        "scenarios": {type(scenario).name: repr(scenario) for scenario in scenarios},
        "contestants": {contestant.label: repr(contestant.solver) for contestant in contestants},
        "versions": versions(),
    }
    folder = RunFolder(output, description, files=FILES, overwrite=overwrite)
    cores = workers or usable_cores()
    finer = [dataclasses.replace(scenario, substeps=2 * scenario.substeps) for scenario in scenarios]
    study = ClaimsStudy(
        scenarios,
        contestants,
        _kept(folder, "steps", scenarios, contestants, cores),
        _kept(folder, "halved", finer, [c for c in contestants if c.label in HALVED], cores),
        quick,
    )
    shown: list[str] = []
    if films:
        from hqp_rp.compare.film import Shot, film_all

        halved = [contestant for contestant in contestants if contestant.label in HALVED]
        shots = {type(s).name: [Shot(s, s.cases()[-1], contestant) for contestant in halved] for s in scenarios}
        shown = film_all(shots, folder.path / "films")
    write_report(study.report(shown), folder.path, workers=cores)
    return [f"{r.claim} {r.verdict}" for r in rulings(Study(contact_figures(study.steps)), quick=quick)] + shown


def _interaction(name: str, quick: bool) -> Interaction:
    scenario = get_scenario(name)
    assert isinstance(scenario, Interaction)
    return scenario.quick() if quick else scenario


def _kept(
    folder: RunFolder,
    name: str,
    scenarios: Sequence[Interaction],
    contestants: Sequence[Contestant],
    workers: int,
) -> pl.DataFrame:
    """The runs, or what an earlier call with the same settings kept of them."""
    path = folder.path / "results" / f"{name}.parquet"
    if path.exists():
        return pl.read_parquet(path)
    found = run_contacts(scenarios, contestants, workers=workers)
    path.parent.mkdir(exist_ok=True)
    write_parquet(found, path)
    return found


def _report(study: ClaimsStudy, films: Sequence[str]) -> Report:
    figures = contact_figures(study.steps)
    judged = rulings(Study(figures), quick=study.quick)
    groups = [names for _, names in grouped(study.contestants)]
    limits = list(dict.fromkeys(sentence for scenario in study.scenarios for sentence in type(scenario).cannot_tell))
    counts = {words: sum(r.verdict.startswith(words) for r in judged) for words in ("holds", "does not hold")}
    only = sum(r.verdict.startswith("holds only") for r in judged)
    answer: tuple[str, ...] = (
        f"Of {len(judged)} claims {counts['holds'] - only} hold as they stand, {only} hold only under a condition that the "
        f"paper does not state, and {counts['does not hold']} {'does' if counts['does not hold'] == 1 else 'do'} not hold as "
        "printed.",
    )
    if study.quick:
        answer = (
            f"A quick run: each of the {len(judged)} claims is shown with what was measured, and none is ruled on.",
        )
    claims = Table(
        "Claims of the paper",
        ("claim", "where", "what was run", "measured", "verdict"),
        tuple((r.claim, r.where, r.tested, r.measured, r.verdict) for r in judged),
        "Every figure and every verdict is computed from the runs of this report. Late: the last third of a case. Better: "
        "smaller by more than 5 % and 0.01 N.",
        text=frozenset(range(5)),
    )
    sections = (
        Section("The answer", answer, tables=(claims,)),
        Section(
            "What this cannot tell",
            (
                *limits,
                "Not tested: experiments on a robot, which the paper has none of; the bandwidth of inner position loops (4.1); "
                "underwater, space and mobile manipulators (4.3).",
                "(47) as printed has no J_1 J_2^+ in front of the second integral; dimensions need it, and (30) has it.",
            ),
            listed=True,
        ),
        Section(
            "Figures",
            sections=tuple(_figures(study, scenario) for scenario in study.scenarios),
        ),
        Section("Films", _films(films), listed=True),
        Section("Tables", tables=tuple(_table(scenario, case, figures) for scenario, case in _cases(study))),
        Section("Half the time step", tables=(_halved(figures, contact_figures(study.halved)),)),
        Section("Settings", tables=_settings(study)),
    )
    return Report(
        "The paper's experiments and claims" + (" (quick run)" if study.quick else ""),
        "Which claims about reverse-priority force, impedance and hybrid control hold in simulation?",
        sections,
        _styles(groups),
        _opening(study, judged, figures, sections),
    )


def _opening(
    study: ClaimsStudy, judged: Sequence[Ruling], figures: Sequence[ContactFigures], sections: Sequence[Section]
) -> Opening:
    """The claims by verdict, and what the experiments came to."""
    advice = []
    if study.quick:
        advice.append(("Nothing is ruled on", "this was a quick run; leave --quick out for verdicts"))
    else:
        kinds: dict[str, list[str]] = {"Holds": [], "Holds under a condition": [], "Does not hold as printed": []}
        for ruling in judged:
            holds = ruling.verdict.startswith("holds")
            kind = (
                "Holds"
                if ruling.verdict == HOLDS
                else "Holds under a condition"
                if holds
                else "Does not hold as printed"
            )
            kinds[kind].append(ruling.claim.rstrip("."))
        advice += [(words, "; ".join(which) or "none") for words, which in kinds.items()]
    tracked = [f for f in figures if f.scenario == TRACKING and f.contestant == REVERSE]
    walls = [f for f in figures if f.scenario == WALL and f.contestant == REVERSE]
    largest = max(figures, key=lambda f: f.commanded)
    numbers = (
        (f"{number(min(f.late_rms for f in tracked))} to {number(max(f.late_rms for f in tracked))} N",
         "late RMS error of the tracked force with reverse priority as printed"),
        (f"{number(max(f.peak for f in walls), 3)} N", "the largest peak at the wall with it; 30 N were asked for"),
        (f"{number(largest.commanded)} rad/s", f"the largest joint velocity asked for, by {largest.contestant}"),
    )  # fmt: skip
    return Opening(tuple(advice), numbers, first_chart(sections), ("verdict", "claims"))


def _films(films: Sequence[str]) -> tuple[str, ...]:
    if not films:
        return ("None was asked for.",)
    return tuple(
        f"films/{name}: the last case (well damped, near singular), {listing(HALVED)} side by side, in real time."
        if name.endswith(".webp")
        else name
        for name in films
    )


def _styles(groups: Sequence[Sequence[str]]) -> Mapping[str, Style]:
    return styles(groups) | {DESIRED: Style("#888888", "dot", max(len(group) for group in groups) - 1)}


def _cases(study: ClaimsStudy) -> list[tuple[Interaction, str]]:
    return [(scenario, case.name) for scenario in study.scenarios for case in scenario.cases()]


def _figures(study: ClaimsStudy, scenario: Interaction) -> Section:
    name = type(scenario).name
    charts = []
    for case in (case.name for case in scenario.cases()):
        steps = study.steps.filter((pl.col("scenario") == name) & (pl.col("case") == case))
        charts.append(
            _chart(study, steps, name, case, "force", "Contact force", (*_QUANTITIES[name], *_SPEED), _MIRRORS[name])
        )
        errors = [row for row in _ERRORS if row[0] in steps.columns and steps[row[0]].null_count() < steps.height]
        if errors:
            mirrors = "Mirrors the paper's Figure 8 (position tracking errors)" if name == WALL else "Not in the paper"
            charts.append(_chart(study, steps, name, case, "errors", "Errors of the lower levels", errors, mirrors))
    return Section(_words(name).capitalize(), (scenario.question,), charts=tuple(charts))


def _chart(
    study: ClaimsStudy,
    steps: pl.DataFrame,
    name: str,
    case: str,
    kind: str,
    title: str,
    rows: Sequence[tuple[str, str, bool]],
    mirrors: str,
) -> Lines:
    groups = grouped(study.contestants)
    return Lines(
        name=slug(name, kind, case),
        title=f"{title} ({_words(name)}; {case})",
        caption=f"{mirrors}, for every solver; {_GAINS[case.split(', ')[0]]}.",
        x_label="time (s)",
        columns=tuple(group for group, _ in groups),
        rows=tuple(label for _, label, _ in rows),
        panels=tuple(tuple(_panel(steps, column, labels) for _, labels in groups) for column, _, _ in rows),
        log_y=tuple(log for _, _, log in rows),
        floor=(1e-4,) * len(rows),
        ceiling=(1e6,) * len(rows),
    )


def _panel(steps: pl.DataFrame, column: str, labels: Sequence[str]) -> tuple[Line, ...]:
    lines = []
    for label in labels:
        part = steps.filter(pl.col("contestant") == label)
        lines.append(_line(label, part, column))
    if column.startswith("force"):
        longest = max((steps.filter(pl.col("contestant") == label) for label in labels), key=lambda part: part.height)
        lines.append(_line(DESIRED, longest, f"desired {column}"))
    return tuple(lines)


def _line(label: str, part: pl.DataFrame, column: str) -> Line:
    y = np.asarray(part[column].cast(pl.Float64).to_numpy(), dtype=np.float64)
    chosen = thinned(y)
    return Line(label, np.asarray(part["time"].to_numpy(), dtype=np.float64)[chosen], y[chosen])


_HEADER = (
    "solver",
    "RMS (N)",
    "late RMS (N)",
    "peak (N)",
    "overshoot (N)",
    "settling (s)",
    "in contact",
    "energy (J)",
    "position (mm)",
    "orientation (rad)",
    "|x| (rad/s)",
    "|dq/dt| (rad/s)",
    "shortened",
    "ended",
)


def _cells(f: ContactFigures) -> tuple[str, ...]:
    position = f.position if f.position is not None else f.drift
    return (
        number(f.rms),
        number(f.late_rms),
        number(f.peak),
        number(f.overshoot),
        number(f.settling),
        share(f.contact),
        number(f.energy),
        number(None if position is None else 1e3 * position),
        number(f.orientation),
        number(f.commanded),
        number(f.measured),
        share(f.shortened),
    )


def _table(scenario: Interaction, case: str, figures: Sequence[ContactFigures]) -> Table:
    own = [f for f in figures if f.scenario == type(scenario).name and f.case == case]
    two = len({f.axis for f in own}) > 1
    rows = tuple(
        (f"{f.contestant}, F_{f.axis}" if two else f.contestant, *_cells(f), f.ended.lower() or "no") for f in own
    )
    return Table(
        f"{_words(type(scenario).name).capitalize()}, {case}",
        _HEADER,
        rows,
        "RMS error from the first contact on, and in the last third; settling: until the error stays within 5 % of F_d, - for "
        "never; in contact: share of the simulation steps after the first contact; position and orientation: largest error "
        "(or drift, in force tracking); shortened: share of the periods in which the velocity limits shortened x.",
    )


def _halved(whole: Sequence[ContactFigures], half: Sequence[ContactFigures]) -> Table:
    rows, same = [], 0
    by = {(f.scenario, f.case, f.contestant, f.axis): f for f in whole}
    for fine in half:
        coarse = by[fine.scenario, fine.case, fine.contestant, fine.axis]
        changed = [
            f"{what}: {a} -> {b}"
            for what, a, b in zip(_HEADER[1:], _cells(coarse), _cells(fine), strict=False)
            if a != b
        ]
        same += not changed
        rows.append(
            (_words(fine.scenario), fine.case, f"{fine.contestant}, F_{fine.axis}", "; ".join(changed) or "none")
        )
    return Table(
        "Which printed figures change when the simulation's time step is halved",
        ("scenario", "case", "run", "printed figures that change"),
        tuple(rows),
        f"In {same} of {len(rows)} runs no printed figure changes. Where the force bounces, a run is chaotic and its figures "
        "are one sample.",
        text=frozenset(range(4)),
    )


def _settings(study: ClaimsStudy) -> tuple[Table, ...]:
    solvers = tuple((c.label, c.group, repr(c.solver), c.why) for c in study.contestants)
    scenarios = tuple((type(s).name, repr(s)) for s in study.scenarios)
    made = tuple({**versions(), **machine()}.items())
    return (
        Table(
            "Solvers", ("label", "group", "solver and settings", "why it is here"), solvers, text=frozenset(range(4))
        ),
        Table(
            "Scenarios", ("name", "settings"), scenarios, "Seed 0: no sensor noise, no offset.", text=frozenset({0, 1})
        ),
        Table("Versions and machine", ("what", "which"), made, text=frozenset({0, 1})),
    )


def _words(name: str) -> str:
    return name.removeprefix("sawyer_").replace("_", " ")
