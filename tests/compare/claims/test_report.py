"""The report of a made-up study: every claim on its first screen, every chart in both forms, equal curves drawn once."""

from __future__ import annotations

import dataclasses
import json
import pathlib
import re

import numpy as np
import polars as pl
import pytest

from hqp_rp.compare.claims import report as module
from hqp_rp.compare.claims.charts.curves import EQUAL, merged
from hqp_rp.compare.claims.experiments import Places, trials
from hqp_rp.compare.claims.methods import FIXED, SWEPT, WITHIN_LIMITS
from hqp_rp.compare.claims.report import ClaimsStudy, study_claims
from hqp_rp.compare.claims.shown import films, halved, shown
from hqp_rp.compare.claims.sources import digest_of_sources
from hqp_rp.compare.claims.trials import Trial, row
from hqp_rp.compare.claims.verdicts import verdicts
from hqp_rp.compare.figures.chart import Dots, Grid, Lines, Picture
from hqp_rp.compare.report.report import Report
from hqp_rp.compare.report.write import write_report
from hqp_rp.core.problem import FloatArray
from tests.compare.claims.study import made_up, places

KEPT = pathlib.Path(__file__).parents[3] / "docs" / "reports" / "paper_claims" / "report.md"


def short(trial: Trial) -> Trial:
    return dataclasses.replace(trial, scenario=dataclasses.replace(trial.scenario, duration=0.02))


def made(rows: pl.DataFrame, *, quick: bool = False) -> Report:
    drawn = [short(trial) for trial in shown(places(1), quick=quick)]
    steps = [trial.steps() for trial in drawn]
    figures = pl.DataFrame([row(t, s) for t, s in zip(drawn, steps, strict=True)], infer_schema_length=None)
    return ClaimsStudy(rows, drawn, steps, figures, figures, places(2), quick).report()


@pytest.fixture(scope="module")
def full() -> Report:
    return made(made_up(count=2))


def test_the_first_screen_has_every_claim_its_verdict_and_the_overview(full: Report) -> None:
    opening = full.opening
    assert opening is not None
    assert sum(int(number.split()[0]) for number, _ in opening.numbers) == 13
    assert isinstance(full.picture, Picture)
    assert full.picture.png.startswith(b"\x89PNG")
    table = full.sections[0].tables[0]
    assert len(table.rows) == 13
    assert [section.title for section in full.sections][:2] == ["Every claim", "What this cannot tell"]
    verdict_sections = next(section for section in full.sections if section.title == "The verdicts").sections
    assert len(verdict_sections) == 13
    assert all(section.tables for section in verdict_sections)


def test_every_method_is_in_the_sweeps_and_every_chart_has_a_style_for_every_label(full: Report) -> None:
    names = [chart.name for chart in full.charts()]
    assert len(set(names)) == len(names)
    for name in ("corner", "wall", "wipe", "conflict"):
        sweep = next(chart for chart in full.charts() if chart.name == f"sweep-{name}")
        assert isinstance(sweep, Lines)
        drawn = {line.label for panel in sweep.panels[0] for line in panel}
        assert drawn == {*SWEPT, *FIXED} - set(WITHIN_LIMITS)
    for chart in full.charts():
        if isinstance(chart, Lines):
            assert all(line.label in full.styles for r in chart.panels for panel in r for line in panel)
        elif isinstance(chart, Dots):
            assert all(label in full.styles for label in chart.labels)
    assert sum(isinstance(chart, Grid) for chart in full.charts()) == 4


def test_it_is_written_in_both_forms(full: Report, tmp_path: pathlib.Path) -> None:
    page, markdown = write_report(full, tmp_path)
    text = markdown.read_text()
    for section in full.sections:
        assert f"## {section.title}" in text
    assert len(list((tmp_path / "figures").glob("*.png"))) == len(full.charts())
    assert "data:image/png;base64" in page.read_text()


def test_the_kept_report_says_what_hangs_on_no_result(full: Report) -> None:
    """Claims, how each is tested, captions, what this cannot tell: word for word as this code writes them."""
    text = KEPT.read_text()
    assert text.startswith(f"# {full.title}\n\n**{full.question}**\n")
    by_title = {section.title: section for section in full.sections}
    for claim, where, *_ in by_title["Every claim"].tables[0].rows:
        assert f"| {claim} | {where} |" in text
    for section in by_title["The verdicts"].sections:
        tested = section.sentences[1]
        assert f"{tested}\n" in text
        assert re.match(r"Tested: .*[.?]$", tested)
    for title, first in (("What this cannot tell", 0), ("How it was tested", 1)):
        assert all(f"- {sentence}\n" in text for sentence in by_title[title].sentences[first:])
    for chart in full.charts():
        assert f"![{chart.title}](figures/{chart.name}.png)\n" in text
        assert chart.caption in text
    assert by_title["Every claim"].tables[0].caption in text
    assert by_title["Half the time step"].tables[0].title in text


def test_the_short_study_has_no_charts_of_what_it_did_not_run() -> None:
    report = made(made_up(quick=True, count=2), quick=True)
    assert "(short study)" in report.title
    assert not any(isinstance(chart, Grid) for chart in report.charts())
    opening = report.opening
    assert opening is not None
    assert [words for words, _ in opening.advice][-1] == "Not ruled on"


def test_equal_curves_are_drawn_once_under_all_their_names() -> None:
    x = np.arange(5.0)
    rows: list[dict[str, tuple[FloatArray, FloatArray]]] = [
        {"a": (x, x), "b": (x, x + EQUAL), "c": (x, 2.0 * x)},
        {"a": (x, x), "b": (x, x), "c": (x, x)},
    ]
    found = merged(rows)
    assert [[line.label for line in panel] for panel in found] == [["a = b", "c"], ["a = b", "c"]]


def test_a_study_is_resumed_and_says_what_it_was_made_with(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A few trials in place of all, and nothing drawn that takes a simulation of seconds."""
    own = places(1)
    monkeypatch.setattr(module, "find_places", lambda: own)

    def few(places: Places, *, quick: bool = False) -> list[Trial]:
        found = {trial.experiment: short(trial) for trial in trials(places, quick=quick)}
        return [found["push"], found["tilted wipe"]]

    monkeypatch.setattr(module, "trials", few)
    monkeypatch.setattr(
        module, "shown", lambda places, *, quick: [short(trial) for trial in shown(places, quick=quick)]
    )
    monkeypatch.setattr(module, "evidence", lambda study, curves: {})
    monkeypatch.setattr(module, "verdicts", lambda rows: verdicts(rows.filter(pl.col("experiment") == "none")))
    out = tmp_path / "out"
    sentences = study_claims(out, quick=True, workers=1, films=False)
    assert len(sentences) == 13
    assert all("not ruled on" in sentence for sentence in sentences)
    run = json.loads((out / "run.json").read_text())["run"]
    assert (run["study"], run["postures"], run["seeds"]) == ("short", 20, 5)
    assert run["sources"] == digest_of_sources()
    assert pl.read_parquet(out / "results" / "trials.parquet").height == 2
    parts = {path: path.stat().st_mtime_ns for path in (out / "parts").iterdir()}
    study_claims(out, quick=True, workers=1, films=False)
    assert {path: path.stat().st_mtime_ns for path in (out / "parts").iterdir()} == parts


def test_drawn_runs_are_halved_and_films_set_methods_side_by_side() -> None:
    drawn = shown(places(1))
    for coarse, fine in zip(drawn, halved(drawn), strict=True):
        assert fine.scenario.substeps == 2 * coarse.scenario.substeps
    found = films(places(1))
    assert all(len(shots) == 2 for shots in found.values())
    assert all(a.scenario == b.scenario for a, b in found.values())
    assert all(a.title != b.title for a, b in found.values())


def test_a_film_is_shown_by_its_still_and_a_missing_one_by_the_reason(tmp_path: pathlib.Path) -> None:
    (tmp_path / "wall.png").write_bytes(b"still")
    section = module._film_section(["wall.webp", "wipe.webp", "No film: no GL."], tmp_path)
    assert [(chart.name, chart.png) for chart in section.charts] == [("film-wall", b"still")]  # type: ignore[union-attr]
    assert section.sentences == ("No film: no GL.",)
    assert module._film_section((), None).sentences == ("There are none in this run.",)
    titles = {module.say("film", name=name) for name in films(places(1))}
    assert len(titles) == len(films(places(1)))
