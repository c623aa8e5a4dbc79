"""Verdicts follow from figures: each claim's verdict flips when its figures do; the report is written from a run."""

from __future__ import annotations

import dataclasses

import polars as pl
import pytest

from hqp_rp.compare import claims_report
from hqp_rp.compare.claims import (
    CLASSICAL,
    CONFLICT,
    LINE_UP,
    NULL_SPACE,
    REVERSE,
    REVERSE_DAMPED,
    TRACKING,
    WALL,
    WIPE,
    Ruling,
    Study,
    rulings,
)
from hqp_rp.compare.claims_report import ClaimsStudy, line_up
from hqp_rp.compare.contact_runs import ContactFigures, run_contacts
from hqp_rp.core.errors import HqpError
from hqp_rp.scenarios._interaction import DAMPED, PAPER, REGULAR, SINGULAR
from hqp_rp.scenarios.sawyer_force_tracking import SawyerForceTracking
from hqp_rp.scenarios.sawyer_hybrid_wipe import SawyerHybridWipe
from hqp_rp.scenarios.sawyer_priority_conflict import SawyerPriorityConflict
from hqp_rp.scenarios.sawyer_wall_contact import SawyerWallContact

PERFECT = ContactFigures(
    scenario="",
    case="",
    contestant="",
    axis="x",
    ended="",
    rms=1.0,
    late_rms=0.1,
    peak=31.0,
    overshoot=1.0,
    settling=0.1,
    contact=1.0,
    energy=0.005,
    position=0.001,
    orientation=0.01,
    drift=None,
    commanded=0.5,
    measured=0.5,
    shortened=0.0,
    first_level=1e-15,
    final=0.01,
)


def study(**changes: dict[str, float]) -> Study:
    """Everybody perfect, everybody else but reverse priority twice as bad, and then the changes: "scenario/place/label"."""
    figures = []
    for scenario in (TRACKING, WALL, WIPE, CONFLICT):
        for gains in (PAPER, DAMPED):
            for place in (REGULAR, SINGULAR):
                for label in LINE_UP:
                    for axis in "xy" if scenario == TRACKING else "x":
                        own = label in (REVERSE, REVERSE_DAMPED)
                        f = dataclasses.replace(
                            PERFECT, scenario=scenario, case=f"{gains}, {place}", contestant=label, axis=axis
                        )
                        if not own:
                            f = dataclasses.replace(f, rms=2.0, late_rms=0.2)
                        if gains == PAPER and scenario == WALL:
                            f = dataclasses.replace(f, overshoot=1.2)
                        for which, values in changes.items():
                            if which in (f"{scenario}/{place}/{label}", f"{scenario}/{gains}/{label}"):
                                f = dataclasses.replace(f, **values)
                        figures.append(f)
    return Study(figures)


def ruling(words: str, **changes: dict[str, float]) -> Ruling:
    (found,) = [r for r in rulings(study(**changes)) if words in r.claim]
    return found


def test_everything_holds_where_everything_is_perfect() -> None:
    found = rulings(study())
    assert len(found) == 12
    assert {r.verdict for r in found} == {"holds"}
    assert all(r.measured and r.tested and r.where for r in found)


def test_a_quick_run_rules_on_nothing() -> None:
    found, full = rulings(study(), quick=True), rulings(study())
    assert {r.verdict for r in found} == {"not ruled on: a quick run is too short"}
    assert [r.measured for r in found] == [r.measured for r in full]


@pytest.mark.parametrize(
    ("words", "where", "values", "verdict"),
    [
        ("not disturb", f"{WALL}/{SINGULAR}/{REVERSE}", {"first_level": 1e-3}, "does not hold"),
        ("not disturb", f"{WALL}/{SINGULAR}/{REVERSE}", {"late_rms": 5.0}, "holds only when the answer fits"),
        (
            "no algorithmic",
            f"{WIPE}/{SINGULAR}/{REVERSE}",
            {"commanded": 900.0},
            "does not hold as printed; holds only",
        ),
        ("alternating", f"{TRACKING}/{REGULAR}/{REVERSE}", {"late_rms": 3.0}, "does not hold"),
        (
            "F_x is obviously",
            f"{TRACKING}/{REGULAR}/{CLASSICAL}",
            {"late_rms": 0.1},
            "holds only when compared with DLS",
        ),
        ("F_x is obviously", f"{TRACKING}/{REGULAR}/{REVERSE}", {"late_rms": 0.2}, "does not hold"),
        ("overwhelms", f"{WALL}/{SINGULAR}/{CLASSICAL}", {"late_rms": 0.01}, "holds only when compared with DLS"),
        ("Close approach", f"{WALL}/{PAPER}/{REVERSE}", {"overshoot": 59.0}, "holds only when B_d is chosen"),
        ("Close approach", f"{WALL}/{REGULAR}/{REVERSE}", {"overshoot": 59.0}, "does not hold"),
        ("30 N, and stable", f"{WALL}/{SINGULAR}/{REVERSE}", {"final": -2.0}, "does not hold"),
        ("M_d and B_d", f"{WALL}/{REGULAR}/{REVERSE}", {"overshoot": 3.0}, "does not hold"),
        ("(47)", f"{WALL}/{SINGULAR}/{REVERSE}", {"position": 0.02}, "does not hold"),
        (
            "strict priority, (53)",
            f"{CONFLICT}/{SINGULAR}/{REVERSE}",
            {"position": 0.2},
            "holds only when there are two",
        ),
        ("tasks conflict", f"{WIPE}/{SINGULAR}/{REVERSE}", {"late_rms": 20.0}, "holds only when T_k is damped"),
        ("improves", f"{CONFLICT}/{REGULAR}/{NULL_SPACE}", {"rms": 0.5}, "holds only when compared with"),
    ],
)
def test_a_verdict_flips_with_its_figures(words: str, where: str, values: dict[str, float], verdict: str) -> None:
    assert ruling(words).verdict == "holds"
    found = ruling(words, **{where: values})
    assert found.verdict.startswith(verdict)


def test_the_line_up_has_every_label_and_says_which_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    assert {c.label for c in line_up()} == set(LINE_UP)
    monkeypatch.setattr(claims_report, "LINE_UP", (*LINE_UP, "nobody"))
    with pytest.raises(HqpError, match="No contestant is labelled 'nobody'; the default line-up has null space"):
        line_up()


def test_the_report_shows_every_claim_case_and_solver() -> None:
    """A run of a few periods, under everybody's name: figures are poor and everything is there."""
    kinds = (SawyerForceTracking, SawyerWallContact, SawyerHybridWipe, SawyerPriorityConflict)
    scenarios = tuple(kind(duration=0.01) for kind in kinds)
    contestants = line_up()
    once = run_contacts(scenarios, [c for c in contestants if c.label == NULL_SPACE])
    steps = pl.concat([once.with_columns(pl.lit(label).alias("contestant")) for label in LINE_UP])
    halved = steps.filter(pl.col("contestant").is_in(claims_report.HALVED))
    report = ClaimsStudy(scenarios, contestants, steps, halved).report()
    names = [chart.name for chart in report.charts()]
    assert len(names) == len(set(names)) == 32
    for chart in report.charts():
        drawn = {line.label for row in chart.panels for panel in row for line in panel}
        assert drawn - {"desired"} == set(LINE_UP)
    claims, *_ = next(section for section in report.sections if section.tables).tables
    assert len(claims.rows) == 12
    tables = next(section for section in report.sections if section.title == "Tables").tables
    assert len(tables) == 16
    half = next(section for section in report.sections if section.title == "Half the time step").tables[0]
    assert all(row[-1] == "none" for row in half.rows)
