"""The report of made-up results: the wording follows the answers, and what hangs on no result is as the kept report has it."""

from __future__ import annotations

import json
import pathlib
from collections.abc import Sequence

import polars as pl

from hqp_rp.compare.contestants import default_contestants
from hqp_rp.compare.report.report import Report
from hqp_rp.compare.statistics.passages import Design
from hqp_rp.compare.statistics.record import Statistics
from hqp_rp.compare.statistics.report import statistics_report
from hqp_rp.compare.statistics.settings import FACTORS
from hqp_rp.compare.statistics.verdicts import NO, QUANTITIES, QUESTIONS, YES, Result, Spread, Verdict

KEPT = pathlib.Path(__file__).parents[3] / "docs" / "reports" / "statistics"
CONTESTANTS = default_contestants(limits=False, torques=False, transitions=False)
THIRD, THREE_TIMES = FACTORS[0], FACTORS[2]


def result(label: str, arm: str, words: Sequence[str], factor: float = 1.0, hangs_on: tuple[str, ...] = ()) -> Result:
    """These answers, at this factor of the setting; no to every question at every other."""
    at = {f: dict(zip(QUESTIONS, words if f == factor else (NO,) * 3, strict=True)) for f in FACTORS}
    verdicts = {q: Verdict(word, float(word == YES), hangs_on) for q, word in at.pop(1.0).items()}
    return Result(arm, label, dict.fromkeys(QUANTITIES, Spread(1.0, 1.0, 1.0, 1.0, 1.0)), verdicts, 1.0, at)


def report(found: Sequence[Result], design: Design | None = None, arms: tuple[str, ...] = ("planar4",)) -> Report:
    return statistics_report(Statistics(design or Design(), arms, CONTESTANTS, pl.DataFrame(), tuple(found)))


def advice(*found: Result) -> list[str]:
    others = {contestant.label for contestant in CONTESTANTS} - {one.contestant for one in found}
    opening = report([*found, *(result(label, "planar4", (NO, NO, NO)) for label in others)]).opening
    assert opening is not None
    return [labels for _, labels in opening.advice]


def test_each_need_names_who_serves_it_at_the_best_of_its_settings() -> None:
    labels = [contestant.label for contestant in CONTESTANTS]
    assert advice() == ["no solver here"] * 4
    served = advice(
        result(labels[0], "planar4", (YES, YES, YES)),
        result(labels[1], "planar4", (YES, YES, YES), THIRD),
        result(labels[2], "planar4", (YES, NO, YES), THREE_TIMES),
        result(labels[3], "planar4", (YES, YES, NO)),
    )
    assert served == [
        f"{labels[0]} and {labels[1]} (setting / 3)",
        f"{labels[2]} (setting x 3)",
        labels[3],
        "no solver here",
    ]


def test_more_than_six_that_serve_a_need_are_counted() -> None:
    labels = [contestant.label for contestant in CONTESTANTS[:8]]
    bounded = [result(label, "planar4", (NO, NO, YES)) for label in labels]
    assert advice(*bounded[:6])[3] == f"{', '.join(labels[:5])} and {labels[5]}"
    assert advice(*bounded)[3] == f"{', '.join(labels[:6])} and 2 more"


def test_what_a_verdict_hangs_on_is_said_and_that_none_does() -> None:
    def fragile(*found: Result) -> tuple[str, ...]:
        return next(section.sentences for section in report(found).sections if section.title.startswith("What hangs"))

    labels = [contestant.label for contestant in CONTESTANTS[:2]]
    assert fragile(result(labels[0], "planar4", (YES, YES, YES))) == ("No verdict does.",)
    found = fragile(*(result(label, "planar4", (YES, YES, YES), hangs_on=("configurations",)) for label in labels))
    named = " and ".join(f"{label} (planar arm of 4 joints)" for label in labels)
    assert found == tuple(f"{question}, configurations: {named}." for question in QUESTIONS)


def test_the_kept_report_says_what_its_run_asked() -> None:
    """Every sentence, caption and heading that hangs on the design alone, and the number of paths."""
    run, text = json.loads((KEPT / "run.json").read_text())["run"], (KEPT / "report.md").read_text()
    design, arms = Design(**run["design"]), tuple(run["arms"])
    made = report([result(c.label, arm, (YES, YES, YES)) for c in CONTESTANTS for arm in arms], design, arms)
    assert made.opening is not None
    paths, words = made.opening.numbers[0]
    assert f"- **{paths}**: {words}\n" in text
    assert text.startswith(f"# {made.title}\n\n**{made.question}**\n")
    asked = ("What was asked", "Verdicts", "At other settings", "What this cannot tell")
    for section in made.sections:
        assert f"## {section.title}\n" in text
        for sentence in section.sentences if section.title in asked else ():
            assert sentence in text
        for table in section.tables:
            assert table.caption in text
    for chart in made.charts():
        assert chart.title in text
        assert chart.caption in text
    assert all(need in text for need, _ in made.opening.advice)
