"""The paper's claims as a report: two pages with every verdict, then the evidence."""

from __future__ import annotations

import dataclasses
import functools
import os
import pathlib
from collections.abc import Sequence

import polars as pl

from hqp_rp.compare.claims.charts.curves import Curves
from hqp_rp.compare.claims.charts.evidence import evidence
from hqp_rp.compare.claims.charts.styles import chart_styles
from hqp_rp.compare.claims.experiments import POSTURES, SEEDS, Places, find_places, trials
from hqp_rp.compare.claims.judges.criteria import FAILS
from hqp_rp.compare.claims.judges.study import Study
from hqp_rp.compare.claims.methods import FIXED, SWEPT, method
from hqp_rp.compare.claims.outcomes import FACTOR, HALF, MOST, RESAMPLES
from hqp_rp.compare.claims.overview import overview
from hqp_rp.compare.claims.places import LEAST_SIGMA, ROOM
from hqp_rp.compare.claims.shown import curves, films, halved, shown
from hqp_rp.compare.claims.sources import digest_of_sources
from hqp_rp.compare.claims.trials import Trial, run_trials
from hqp_rp.compare.claims.verdicts import DEPENDS, HOLDS, UNRULED, Verdict, verdicts
from hqp_rp.compare.figures.chart import Chart, Picture
from hqp_rp.compare.machine import machine, usable_cores, versions
from hqp_rp.compare.report.report import Opening, Report, Section, Table
from hqp_rp.compare.report.sentences import Sentences
from hqp_rp.compare.report.words import number, share
from hqp_rp.compare.report.write import write_report
from hqp_rp.compare.run_folder import RunFolder, write_parquet
from hqp_rp.scenarios._interaction import Interaction

say = Sentences(__file__)

FILES = ("report.html", "report.md", "figures", "results", "films")
_COUNTED = (
    "rms",
    "late_rms",
    "peak",
    "settling",
    "position",
    "commanded",
    "translation",
    "rotation",
    "gain 0",
    "lag 0",
)
"""Figures that are compared with those of half the time step."""


@dataclasses.dataclass(frozen=True, eq=False)
class ClaimsStudy:
    """What was run: a row for each trial, the curves of a few, and the figures of those with half the time step."""

    rows: pl.DataFrame
    shown: Sequence[Trial]
    steps: Sequence[pl.DataFrame]
    figures: pl.DataFrame
    halved: pl.DataFrame
    places: Places
    quick: bool = False

    @functools.cached_property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Every claim, judged."""
        return verdicts(self.rows)

    def report(self, films: Sequence[str] = (), folder: pathlib.Path | None = None) -> Report:
        """The report as data; `films` is what `film_all` returned for the folder, whose stills are shown."""
        return _report(self, films, folder)


def study_claims(
    output: str | os.PathLike[str],
    *,
    quick: bool = False,
    overwrite: bool = False,
    workers: int | None = None,
    films: bool = True,
    progress: bool = False,
) -> list[str]:
    """Run every experiment on the paper's claims and write the report; each claim with its verdict, in words.

    A study that was stopped goes on where it stopped when it is started again with the same folder and the same code.

    Args:
        output: the folder for report.html, report.md, figures, films and the rows as Parquet.
        quick: the short study: fewer experiments; claims that need the others are not ruled on.
        overwrite: replace the report of another run in `output`.
        workers: processes; None means one for each usable core.
        films: render short films too, where a GL back end is there; the short study has none.
        progress: show a progress bar with the time left on standard error.

    Raises:
        FileError: `output` holds another run's report or foreign files, or cannot be written.
    """
    # How a report is drawn makes no other study of it: the digest stands for the package's own version.
    others = {name: version for name, version in versions().items() if name != "hqp_rp"}
    made_with = {"sources": digest_of_sources(), "versions": others}
    study_of = {"kind": "claims", "study": "short" if quick else "full", "postures": POSTURES, "seeds": SEEDS}
    description = study_of | made_with
    folder = RunFolder(output, description, files=FILES, overwrite=overwrite)
    places = find_places()
    rows = run_trials(
        trials(places, quick=quick), folder, made_with=repr(made_with), workers=workers, progress=progress
    )
    drawn = shown(places, quick=quick)
    cores = workers or usable_cores()
    steps, figures = curves(drawn, folder, workers=cores)
    fine = figures if quick else curves(halved(drawn), folder, workers=cores)[1]
    (folder.path / "results").mkdir(exist_ok=True)
    write_parquet(rows, folder.path / "results" / "trials.parquet")
    study = ClaimsStudy(rows, drawn, steps, figures, fine, places, quick)
    rendered: list[str] = []
    if films and not quick:
        rendered = _films(places, folder)
    write_report(study.report(rendered, folder.path / "films"), folder.path, workers=cores)
    return [f"{v.claim} {v.word}: {v.number or v.why}" for v in study.verdicts] + rendered


def _films(places: Places, folder: RunFolder) -> list[str]:
    from hqp_rp.compare.figures.film import film_all

    return film_all(films(places), folder.path / "films")


def _report(study: ClaimsStudy, films: Sequence[str], folder: pathlib.Path | None) -> Report:
    judged = study.verdicts
    charts = evidence(Study(study.rows), Curves(study.shown, study.steps))
    every = [chart for own in charts.values() for chart in own]
    styles = chart_styles(every)
    picture = overview(judged, every, styles)
    sections = (
        Section("Every claim", charts=(picture,), tables=(_claims(judged),)),
        Section("What this cannot tell", _limits(study.shown), listed=True),
        Section("How it was tested", _method(study), listed=True),
        Section("The verdicts", sections=tuple(_verdict(v) for v in judged)),
        Section("Figures", sections=tuple(Section(title, charts=tuple(own)) for title, own in charts.items())),
        _film_section(films, folder),
        *(() if study.quick else (Section("Half the time step", tables=(_halved(study),)),)),
        Section("Settings", tables=_settings(study)),
    )
    return Report(
        say("title", quick=study.quick),
        say("question"),
        sections,
        styles,
        _opening(judged, picture),
    )


def _opening(judged: Sequence[Verdict], picture: Chart) -> Opening:
    kinds = (HOLDS, DEPENDS, FAILS, UNRULED)
    advice = tuple(
        (f"{kind[0].upper()}{kind[1:]}", "; ".join(own))
        for kind in kinds
        if (own := [v.claim.rstrip(".") for v in judged if v.word == kind])
    )
    numbers = tuple((str(sum(v.word == kind for v in judged)), kind) for kind in kinds[:3])
    return Opening(
        advice, tuple((f"{n} of {len(judged)}", words) for n, words in numbers), picture.name, ("verdict", "claims")
    )


def _claims(judged: Sequence[Verdict]) -> Table:
    return Table(
        "The claims",
        ("claim", "where", "verdict", "the one number"),
        tuple((v.claim, v.where, v.word, v.number or v.why) for v in judged),
        say("claims_caption"),
        text=frozenset(range(4)),
    )


def _verdict(verdict: Verdict) -> Section:
    sentences = (say("judged", verdict=verdict), verdict.tested, verdict.why, verdict.theorem)
    rows = tuple(
        (
            o.label,
            str(o.runs),
            share(o.passed),
            f"{share(o.low)} to {share(o.high)}",
            share(o.stricter),
            share(o.looser),
            number(o.median),
            f"{number(o.median_low)} to {number(o.median_high)}",
        )
        for o in verdict.outcomes
    )
    header = (
        "condition",
        "runs",
        "holds in",
        "interval",
        f"threshold / {FACTOR:g}",
        f"x {FACTOR:g}",
        "median",
        "interval",
    )
    tables = (Table("In how many runs", header, rows),) if rows else ()
    title = verdict.name[0].upper() + verdict.name[1:]
    return Section(title, tuple(filter(None, sentences)), tables=tables)


def _limits(drawn: Sequence[Trial]) -> tuple[str, ...]:
    own = dict.fromkeys(sentence for trial in drawn for sentence in type(trial.scenario).cannot_tell)
    return (*own, say("no_robot"), say("not_given"), say("best_of_sweep"))


def _method(study: ClaimsStudy) -> tuple[str, ...]:
    return (
        say("runs", runs=study.rows.height, postures=POSTURES, seeds=SEEDS),
        say("postures", room=ROOM, least_sigma=LEAST_SIGMA, count=POSTURES),
        say("criterion", most=MOST, half=HALF, factor=FACTOR),
        say("intervals", resamples=RESAMPLES),
    )


def _film_section(films: Sequence[str], folder: pathlib.Path | None) -> Section:
    """A still of each film that is there, at the moment at which its runs differ most; else why there is none."""
    stills = []
    for name in (film.removesuffix(".webp") for film in films if film.endswith(".webp")):
        still = None if folder is None else folder / f"{name}.png"
        if still is not None and still.exists():
            title, caption = say("film", name=name), say("still", name=name)
            stills.append(Picture(f"film-{name.replace('_', '-')}", title, caption, still.read_bytes()))
    reasons = tuple(words for words in films if not words.endswith(".webp"))
    words = reasons if films else (say("no_films"),)
    return Section("Films", words, charts=tuple(stills))


def _halved(study: ClaimsStudy) -> Table:
    rows, same = [], 0
    for k, trial in enumerate(study.shown):
        changed = []
        for what in _COUNTED:
            if what in study.figures.columns and study.figures[what][k] is not None:
                a, b = (number(frame[what][k]) for frame in (study.figures, study.halved))
                if a != b:
                    changed.append(f"{what}: {a} -> {b}")
        same += not changed
        hard = ", hard limits" if trial.scenario.hard_limits else ""
        words = f"{trial.gains}, servo x {trial.scenario.servo:g}{hard}"
        rows.append((trial.experiment, trial.method.label, words, "; ".join(changed) or "none"))
    return Table(
        say("halved_title"),
        ("experiment", "method", "settings", "figures that change, to two digits"),
        tuple(rows),
        say("halved_caption", same=same, runs=len(rows)),
        text=frozenset(range(4)),
    )


def _settings(study: ClaimsStudy) -> tuple[Table, ...]:
    solvers = [(label, repr(method(label).solver), "damping 0.01 to 0.3") for label in SWEPT]
    solvers += [(label, repr(method(label).solver), "") for label in FIXED]
    scenarios: dict[str, Interaction] = {type(t.scenario).name: t.scenario for t in study.shown}
    places = (
        ("regular", str(len(study.places.regular)), number(LEAST_SIGMA)),
        *((name, str(len(own)), "") for name, own in (("corner and wall", study.places.corner), ("wipe", study.places.wipe),
                                                      ("conflict", study.places.conflict))),
    )  # fmt: skip
    made = tuple({"sources": digest_of_sources(), **versions(), **machine()}.items())
    return (
        Table("Methods", ("label", "solver and settings", "swept"), tuple(solvers), text=frozenset(range(3))),
        Table(
            "Scenarios of the drawn runs",
            ("name", "settings"),
            tuple((name, repr(s)) for name, s in scenarios.items()),
            text=frozenset({0, 1}),
        ),
        Table("Places", ("kind", "how many", "least singular value"), places),
        Table("Versions and machine", ("what", "which"), made, text=frozenset({0, 1})),
    )
